"""A real server for the agents, and a room of its own for each test."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import pytest
from server_process import ServerProcess

from tms_client import Town
from tms_schemas.rooms import RoomIn

Polygon = list[list[float]]


@pytest.fixture(scope="module")  # a tag that one module registers is unknown in another
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[ServerProcess]:
    with ServerProcess(tmp_path_factory.mktemp("server")) as server:
        yield server


@pytest.fixture
def town(server: ServerProcess) -> Iterator[Town]:
    with Town(server.url) as town:
        yield town


@pytest.fixture
def make_room(town: Town, request: pytest.FixtureRequest) -> Callable[[str, dict[str, Polygon]], str]:
    """Register the room of this test with one sensor, agent ``<room>-<kind>``, and its zones; the name of the room."""

    def make(kind: str, zones: dict[str, Polygon]) -> str:
        name = f"r{abs(hash(request.node.nodeid))}"
        found = [{"id": zone, "polygon": polygon} for zone, polygon in zones.items()]
        sensors = [{"agent": f"{name}-{kind}", "kind": kind, "zones": found}]
        town.rooms.put(
            name, RoomIn.model_validate({"name": "Lab", "outline": [[0, 0], [5, 0], [5, 4]], "sensors": sensors})
        )
        return name

    return make
