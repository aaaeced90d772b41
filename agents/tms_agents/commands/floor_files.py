"""Files that the commands of ``tms floor`` write, and what is wrong with those that they read."""

from __future__ import annotations

import sys
from pathlib import Path

from tms_client.cli import CommandError


def warn(text: str) -> None:
    """Something that does not keep the command from its work, in one line."""
    sys.stderr.write(f"tms: {text}\n")


def write_file(path: Path, data: bytes) -> None:
    """Raises CommandError where that cannot be."""
    try:
        path.write_bytes(data)
    except OSError as error:
        raise CommandError(f"{path}: {error.strerror}") from error
