"""Laws of the simulated floor: geometry of beams, statistics of their errors, gait of feet, truth of the world."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tms_agents.simulation.floor_world import COARSE, FINE, SCENARIOS, FloorWorld, write


def played(name: str, seed: int, **options: Any) -> tuple[FloorWorld, list[Any], dict[str, Any]]:
    world = FloorWorld(name, seed, **options)
    return world, list(world.scans()), world.truth()


@pytest.mark.parametrize("name", SCENARIOS)
def test_every_scenario_plays_and_its_truth_is_json(name: str) -> None:
    world, scans, truth = played(name, 3, duration=20.0)
    assert {scan.sensor for scan in scans} == set(world.sensors)
    assert all(len(scan.ranges) == FINE.beams for scan in scans)
    assert len(truth["t"]) == sum(scan.sensor == "A" for scan in scans) > 180
    json.dumps(truth)


def test_a_seed_gives_the_same_world_again_and_another_seed_another_one() -> None:
    (_, first, truth), (_, again, same), (_, other, _) = (played("three", seed, duration=12.0) for seed in (5, 5, 6))
    assert all(
        np.array_equal(a.ranges, b.ranges, equal_nan=True) and a.t == b.t for a, b in zip(first, again, strict=True)
    )
    assert truth == same
    assert not np.array_equal(first[-1].ranges, other[-1].ranges, equal_nan=True)


def test_an_unknown_scenario_is_refused() -> None:
    with pytest.raises(ValueError, match="no scenario 'nothing'; there are one, three"):
        FloorWorld("nothing", 1)


def test_a_written_world_has_the_structure_of_the_shared_recordings(tmp_path: Path) -> None:
    world = FloorWorld("things", 4, laser=COARSE, duration=30.0)
    files = write(world, tmp_path, "w")
    assert [path.name for path in files] == ["w.json", "w_A.npz"]
    with np.load(tmp_path / "w_A.npz") as scans:
        assert scans["ranges"].shape == (len(scans["t"]), 683)
        assert scans["angles"].shape == (683,)
        assert math.degrees(scans["angles"][-1]) == pytest.approx(120, abs=0.2)
    truth = json.loads((tmp_path / "w.json").read_text())
    assert truth["sensors"][0]["file"] == "w_A.npz"
    assert truth["objects"]
