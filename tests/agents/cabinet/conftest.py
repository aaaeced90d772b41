"""A cabinet of its own for each test."""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from server_process import ServerProcess

sys.path.append(str(Path(__file__).parent))  # for cabinet_rig and cabinet_bench

from cabinet_rig import Rig, calibration_toml, config_toml

from tms_client import Town

MakeRig = Callable[..., Rig]


@pytest.fixture
def rig(server: ServerProcess, town: Town, tmp_path: Path, make_room: Callable[..., str]) -> MakeRig:
    """Make a cabinet: what weighs it (TOML), and options of ``config_toml``."""
    name = make_room("cabinet", {"shelf": [[1, 1], [3, 1], [3, 3], [1, 3]]})

    def make(load: str, **options: str | bool) -> Rig:
        path = tmp_path / "cabinet.toml"
        path.write_text(config_toml(name, server.url, load, **options))  # type: ignore[arg-type]
        if "ros-tms" in load:
            (tmp_path / "cabinet.calibration.toml").write_text(calibration_toml("shelf"))
        return Rig(town, name, path)

    return make
