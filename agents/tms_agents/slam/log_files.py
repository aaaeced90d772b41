"""Recorded drives out of files, by the kind of file."""

from __future__ import annotations

from pathlib import Path

from tms_agents.slam.logs import Log, LogError, lines_of_file
from tms_agents.slam.logs_carmen import parse_carmen
from tms_agents.slam.logs_recording import parse_recording


def read_log(path: Path) -> Log:
    """A CARMEN log (``.log``, ``.clf``, old or new messages) or a recording (``.jsonl``), each perhaps ``.gz``.

    Raises:
        LogError: it is neither, or holds no usable scan.
        OSError: the file cannot be read.
    """
    name = path.name.removesuffix(".gz").lower()
    if name.endswith(".jsonl"):
        models = path.with_name("models.json")
        return parse_recording(lines_of_file(path), models.read_text() if models.exists() else None)
    if name.endswith((".log", ".clf")):
        return parse_carmen(lines_of_file(path))
    path.open("rb").close()  # a file that is not there is said to be so
    raise LogError("not a log: its name ends in .log, .clf or .jsonl (or one of them and .gz)")
