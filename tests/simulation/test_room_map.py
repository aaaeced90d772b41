"""The demo's map is made by the mapper from what the robot's laser saw, and lies where the room is."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from server_process import ServerProcess

from tms_agents.simulation import room_map
from tms_agents.simulation.demo import Plan, register
from tms_agents.simulation.room import CABINETS, SIZE, SPOTS
from tms_agents.simulation.survey import START, poses, recording
from tms_agents.slam.geometry import transform
from tms_client import Town

ROOT = Path(__file__).resolve().parents[2]


@pytest.mark.timeout(300)  # the mapper compiles where it never ran before
def test_the_map_on_the_server_is_that_of_the_room(tmp_path: Path) -> None:
    said: list[str] = []
    with ServerProcess(tmp_path) as server, Town(server.url) as town:
        register(town, Plan())
        for version in (1, 2):  # the next demo, with other noise, goes on with the map of the first
            folder = tmp_path / str(version)
            folder.mkdir()
            with room_map.mapping(town, "demo", folder, version, said.append) as drawn:
                assert drawn is not None
                drawn.poll(said.append, 200.0)
                drawn.poll(said.append)
        assert [line.split(" (")[1].split(";")[0] for line in said] == ["version 1", "version 2"]
        found = town.map("demo")
        example = [sys.executable, "examples/localise_in_map.py", "--url", server.url, "--seed", "8"]
        done = subprocess.run(example, cwd=ROOT, capture_output=True, text=True, timeout=200, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "localised at x" in done.stdout
    where = re.search(r"in room 'demo' at x (.*) m, y (.*) m, (.*) deg", done.stdout)
    assert where is not None
    x, y, theta = list(poses())[-1]
    assert np.hypot(float(where[1]) - x, float(where[2]) - y) < 0.1
    assert float(where[3]) == pytest.approx(np.degrees(theta), abs=12)
    assert found.map_to_room == pytest.approx(START)
    rows, columns = np.nonzero(found.occupancy > 0.65)
    cells = np.column_stack([columns, rows]) + 0.5
    walls = transform(np.array(START), cells * found.resolution + np.array(found.origin))
    assert (walls > -0.15).all() and (walls < np.array(SIZE) + 0.15).all()
    for place in ((0.0, 4.0), (6.0, 3.5), (3.0, 5.0), (1.4, 0.0), CABINETS[0].in_room((0.7, 0.0))):
        assert np.hypot(*(walls - place).T).min() < 0.12, place
    for xy in SPOTS.values():  # nothing is where people and robot go
        assert np.hypot(*(walls - xy).T).min() > 0.25


def test_the_drive_is_noisy_and_decided_by_its_seed() -> None:
    one, same, other = (list(recording(np.random.default_rng(seed))) for seed in (1, 1, 2))
    assert one == same != other
    assert len(one) == 2 * len(list(poses()))


def test_without_its_packages_there_is_no_map_and_that_is_said(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    said: list[str] = []
    monkeypatch.setattr(room_map, "find_spec", lambda name: None)
    with Town("http://127.0.0.1:1") as town, room_map.mapping(town, "demo", tmp_path, 0, said.append) as drawn:
        assert drawn is None
    assert "needs numba" in said[0]
