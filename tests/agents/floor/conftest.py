"""A floor of its own for each test."""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from server_process import ServerProcess

sys.path.append(str(Path(__file__).parent))  # for floor_rig, floor_prints and floor_robots

from floor_rig import Rig, config_toml

from tms_client import Town

MakeRig = Callable[..., Rig]


@pytest.fixture
def rig(server: ServerProcess, town: Town, tmp_path: Path, make_room: Callable[..., str]) -> MakeRig:
    """Make a floor: its lasers (TOML), and options of ``config_toml``."""
    name = make_room("floor", {})

    def make(lasers: str, **options: str) -> Rig:
        path = tmp_path / "floor.toml"
        path.write_text(config_toml(name, server.url, lasers, **options))
        return Rig(town, name, path)

    return make
