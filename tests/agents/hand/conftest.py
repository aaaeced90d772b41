"""A real server with one room, and configuration files for the hand agent."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from server_process import ServerProcess

from tms_client import Town
from tms_schemas.rooms import RoomIn

Configure = Callable[..., Path]


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[ServerProcess]:
    with ServerProcess(tmp_path_factory.mktemp("server")) as server:
        yield server


@pytest.fixture
def town(server: ServerProcess) -> Iterator[Town]:
    with Town(server.url) as town:
        yield town


@pytest.fixture
def room(town: Town, request: pytest.FixtureRequest) -> str:
    """A room of its own for each test."""
    name = f"r{abs(hash(request.node.nodeid))}"
    zones = [{"id": "hand", "polygon": [[0, 0], [1, 0], [1, 1]]}]
    sensors = [{"agent": f"{name}-hand", "kind": "hand", "zones": zones}]
    town.rooms.put(
        name, RoomIn.model_validate({"name": "Lab", "outline": [[0, 0], [5, 0], [5, 4]], "sensors": sensors})
    )
    return name


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
