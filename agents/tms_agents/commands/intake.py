"""``tms intake``: register things where they are put away. Scan the barcode, hold the thing at the reader, done."""

from __future__ import annotations

import argparse
import asyncio
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from tms_agents.config import Server, read_config
from tms_agents.intake.codes import Unusable, barcode, tag_id
from tms_agents.intake.config import IntakeConfig
from tms_agents.intake.runner import once, run
from tms_agents.intake.session import Said
from tms_agents.running import until_signalled
from tms_client.cli import ArgumentParser, CommandError
from tms_client.commands.options import add_server_options
from tms_client.errors import TownError

_HELLO = "Scan a barcode and hold the thing at the reader, in any order; or type them. Ctrl-C ends."


def main(argv: Sequence[str]) -> int:
    """Status 0: everything was registered (or was before); 1: something was not, the line says why; 2: wrong call."""
    parser = ArgumentParser(prog="tms intake", description=__doc__.partition(": ")[2])
    parser.add_argument("--config", type=Path, metavar="FILE", help="TOML file that names reader and scanner")
    parser.add_argument("--room", help="room that the things are in (default: where their tags were seen)")
    parser.add_argument("--tag", help="register this tag and leave")
    parser.add_argument("--jan", help="with --tag: its JAN, EAN, UPC or GTIN (an SGTIN-96 tag needs none)")
    parser.add_argument("--name", help="with --tag: name of a thing that has no JAN, or whose JAN is not known yet")
    add_server_options(parser)
    arguments = parser.parse_args(argv)
    given = {name: value for name in ("url", "key") if (value := getattr(arguments, name)) != parser.get_default(name)}
    config = _config(arguments, given)
    try:
        if arguments.tag is not None:
            return _once(config, arguments)
        if arguments.jan is not None or arguments.name is not None:
            raise CommandError("--jan and --name go with --tag; without it, scan and read")
        return _until_stopped(config)
    except TownError as error:
        raise CommandError(str(error)) from error


def _once(config: IntakeConfig, arguments: argparse.Namespace) -> int:
    tag = tag_id(arguments.tag)
    code = None if arguments.jan is None else barcode(arguments.jan)
    if isinstance(tag, Unusable):
        raise CommandError(tag.why)
    if isinstance(code, Unusable):
        raise CommandError(code.why)
    digits = None if code is None else code.digits
    done = asyncio.run(once(config, _said(beep=False), tag=tag.tag, code=digits, name=arguments.name))
    return 0 if done else 1


def _until_stopped(config: IntakeConfig) -> int:
    person = sys.stdin is not None and sys.stdin.isatty()
    fd = None if sys.stdin is None or sys.stdin.closed else sys.stdin.fileno()
    say = _said(beep=sys.stdout.isatty())
    if person:
        sys.stdout.write(f"{_HELLO}\n")
    tally = asyncio.run(until_signalled(run(config, say, fd=fd, can_ask=person)))
    # Behind the ^C that the terminal shows.
    sys.stdout.write(f"{chr(10) if person else ''}{tally.in_words()}\n")
    return 1 if tally.failed else 0


def _config(arguments: argparse.Namespace, given: dict[str, str]) -> IntakeConfig:
    """The file, if there is one; options that are ``given`` win over it."""
    changes: dict[str, Any] = {}
    if not arguments.url.startswith(("http://", "https://")):
        raise CommandError(f"the address {arguments.url!r} does not begin with http:// or https://")
    try:
        if arguments.config is None:
            changes["server"] = Server(url=arguments.url, key=arguments.key)
            config = IntakeConfig()
        else:
            config = read_config(arguments.config, IntakeConfig)
            changes["server"] = Server.model_validate(dict(config.server) | given)
        if arguments.room is not None:
            changes["room"] = arguments.room
        return IntakeConfig.model_validate(dict(config) | changes)
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        raise CommandError(f"{'.'.join(map(str, first['loc']))}: {first['msg']}") from error


def _said(*, beep: bool) -> Said:
    def good(text: str) -> None:
        bell = "\a" if beep and text.startswith("Registered") else ""
        sys.stdout.write(f"{text}{bell}\n")
        sys.stdout.flush()

    def bad(text: str) -> None:
        sys.stderr.write(f"{text}\n")
        sys.stderr.flush()

    return Said(good, bad)
