"""Files that the commands of ``tms floor`` write, and what is wrong with those that they read."""

from __future__ import annotations

import contextlib
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import IO

from tms_agents.files import written_whole
from tms_client.cli import CommandError


def warn(text: str) -> None:
    """Something that does not keep the command from its work, in one line."""
    sys.stderr.write(f"tms: {text}\n")


def require_place(path: Path | None, suffix: str = "") -> None:
    """That a result can be written there: to be found out before the work, not after it. Raises CommandError."""
    if path is None:
        return
    if suffix and path.suffix.lower() != suffix:
        raise CommandError(f"{path}: the name of a picture ends in {suffix}")
    if path.is_dir():
        raise CommandError(f"{path}: that is a folder")
    if not path.parent.is_dir():
        raise CommandError(f"{path}: there is no folder {path.parent}")


@contextlib.contextmanager
def result(path: Path) -> Iterator[IO[bytes]]:
    """A file for what a command finds out bit by bit; an older one stays where the work does not come to its end.

    Raises:
        CommandError: it cannot be written.
    """
    try:
        # What is no file (/dev/stdout, a pipe) is written to; anything else would replace it.
        with path.open("wb") if path.exists() and not path.is_file() else written_whole(path.resolve()) as file:
            yield file
    except OSError as error:
        raise CommandError(f"{path}: {error.strerror}") from error


def write_file(path: Path, data: bytes) -> None:
    """Raises CommandError where that cannot be."""
    with result(path) as file:
        file.write(data)
