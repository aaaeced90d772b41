"""A room and configuration files for the hand agent."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import pytest
from server_process import ServerProcess

Configure = Callable[..., Path]


@pytest.fixture
def room(make_room: Callable[..., str]) -> str:
    """A room of its own for each test."""
    return make_room("hand", {"hand": [[0, 0], [1, 0], [1, 1]]})


@pytest.fixture
def configure(tmp_path: Path, server: ServerProcess, room: str) -> Configure:
    """Write a configuration; keyword arguments are its sections, names before them its top level."""

    def write(source: dict[str, object], *, url: str = server.url, **more: object) -> Path:
        lines = [f'agent = "{room}-hand"', f'room = "{room}"']
        lines += [f"{name} = {json.dumps(value)}" for name, value in more.items() if not isinstance(value, dict)]
        sections = {"server": {"url": url}, "spool": {"path": "hand.spool"}, "source": source}
        sections |= {name: value for name, value in more.items() if isinstance(value, dict)}
        for name, values in sections.items():
            lines.append(f"[{name}]")
            lines += [f"{key} = {json.dumps(value)}" for key, value in values.items()]
        path = tmp_path / "hand.toml"
        path.write_text("\n".join(lines))
        return path

    return write
