"""``tms``: finds its subcommands in the entry-point group ``tms.commands`` and imports only the one called.

A command is ``main(argv) -> int``. Bad input ends in one line on stderr and exit status 2; Ctrl-C in 130.
"""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Callable, Sequence
from importlib import metadata
from typing import NoReturn, cast

GROUP = "tms.commands"
DISTRIBUTION = "robot-town-tms"
Command = Callable[[Sequence[str]], int]


class CommandError(Exception):
    """Wrong input or an unmet condition, said in one line for the person at the terminal."""


class ArgumentParser(argparse.ArgumentParser):
    """argparse with errors of one line instead of the whole usage text."""

    def error(self, message: str) -> NoReturn:
        raise CommandError(f"{message} (try {self.prog} --help)")


def main(argv: Sequence[str] | None = None) -> int:
    """Run ``tms``; returns the exit status."""
    name, *rest = list(sys.argv[1:] if argv is None else argv) or ["--help"]
    try:
        if name in ("-h", "--help", "help"):
            sys.stdout.write(_help())
            return 0
        if name in ("-V", "--version", "version"):
            sys.stdout.write(f"tms {metadata.version(DISTRIBUTION)}\n")
            return 0
        return _load(name)(rest)
    except CommandError as error:
        one_line = " ".join(str(error).split())
        sys.stderr.write(f"tms: {one_line}\n")
        return 2
    except KeyboardInterrupt:
        return 130
    except BrokenPipeError:
        # The reader of our output (head, less) left; keep the interpreter from complaining at exit.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 141
    except SystemExit as stop:  # argparse: --help is 0, its own errors are 2
        return stop.code if isinstance(stop.code, int) else 2


def _load(name: str) -> Command:
    found = {point.name: point for point in metadata.entry_points(group=GROUP)}
    point = found.get(name)
    if point is None:
        raise CommandError(f"unknown command {name!r}; there are: {', '.join(sorted(found))}")
    try:
        return cast(Command, point.load())
    except ImportError as error:
        if error.name is None or error.name.partition(".")[0].startswith("tms_"):
            raise CommandError(f"command {name!r} is broken in this installation: {error}") from error
        extra = f"[{','.join(point.extras)}]" if point.extras else ""
        raise CommandError(
            f'{name!r} needs {error.name}, which is not installed: pip install "{DISTRIBUTION}{extra}"'
        ) from error


def _help() -> str:
    names = sorted(point.name for point in metadata.entry_points(group=GROUP))
    commands = "".join(f"  {name}\n" for name in names)
    return (
        "usage: tms COMMAND [ARGUMENTS]\n\n"
        "Town Management System: where every tagged object in an instrumented room probably is.\n\n"
        f"commands:\n{commands}\n"
        "tms COMMAND --help explains one command; tms --version prints the version.\n"
    )
