"""What an agent remembers across restarts: a JSON file beside its spool, replaced in one step."""

from __future__ import annotations

import contextlib
import json
import logging
from pathlib import Path
from typing import Any

from tms_agents.files import write_atomically

log = logging.getLogger(__name__)
_FORMAT = 1


def state_path(spool: Path) -> Path:
    return spool.with_name(spool.name + ".state.json")


def peek_state(path: Path, agent: str) -> dict[str, Any]:
    """What was saved, for somebody who only looks; nothing where that cannot be used."""
    try:
        return _read(path, agent)
    except (OSError, ValueError):
        return {}


def load_state(path: Path, agent: str) -> dict[str, Any]:
    """What was saved; nothing where there is no file, or one that cannot be used (kept beside it, as ``.broken``)."""
    try:
        return _read(path, agent)
    except FileNotFoundError:
        return {}
    except (OSError, ValueError) as error:
        log.warning("state %s cannot be used, starting without: %s", path, error)
        with contextlib.suppress(OSError):
            path.replace(path.with_name(path.name + ".broken"))
        return {}


def save_state(path: Path, agent: str, state: dict[str, Any], *, quiet: bool = False) -> bool:
    """False where the disk refuses, which is said; the agent goes on, an old state is better than none."""
    try:
        write_atomically(path, json.dumps({"format": _FORMAT, "agent": agent} | state).encode())
    except OSError as error:
        if not quiet:
            log.warning("state %s: %s; it stays as it was saved last", path, error.strerror or error)
        return False
    return True


def _read(path: Path, agent: str) -> dict[str, Any]:
    saved = json.loads(path.read_bytes())
    if not isinstance(saved, dict) or saved.get("format") != _FORMAT or saved.get("agent") != agent:
        raise ValueError("it is of another agent or format")
    return saved
