"""A real server for the cabinet agent, and a room of its own for each test."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from server_process import ServerProcess

sys.path.append(str(Path(__file__).parent))  # for cabinet_rig

from cabinet_rig import Rig, calibration_toml, config_toml

from tms_client import Town
from tms_schemas.rooms import RoomIn

MakeRig = Callable[..., Rig]


@pytest.fixture(scope="package")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[ServerProcess]:
    with ServerProcess(tmp_path_factory.mktemp("server")) as server:
        yield server


@pytest.fixture
def town(server: ServerProcess) -> Iterator[Town]:
    with Town(server.url) as town:
        yield town


@pytest.fixture
def rig(server: ServerProcess, town: Town, tmp_path: Path, request: pytest.FixtureRequest) -> MakeRig:
    """Make a cabinet: what weighs it (TOML), and options of ``config_toml``."""
    name = f"r{abs(hash(request.node.nodeid))}"
    zones = [{"id": "shelf", "polygon": [[1, 1], [3, 1], [3, 3], [1, 3]]}]
    sensors = [{"agent": f"{name}-cabinet", "kind": "cabinet", "zones": zones}]
    town.rooms.put(
        name, RoomIn.model_validate({"name": "Lab", "outline": [[0, 0], [5, 0], [5, 4]], "sensors": sensors})
    )

    def make(load: str, **options: str | bool) -> Rig:
        path = tmp_path / "cabinet.toml"
        path.write_text(config_toml(name, server.url, load, **options))  # type: ignore[arg-type]
        if "ros-tms" in load:
            (tmp_path / "cabinet.calibration.toml").write_text(calibration_toml("shelf"))
        return Rig(town, name, path)

    return make
