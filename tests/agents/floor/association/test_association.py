"""What hypotheses have in common is worked out once, and comes out as if it had been worked out for each."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from tms_agents.floor import FloorEstimator, Sensor
from tms_agents.floor.association import association
from tms_agents.floor.association.association import Association
from tms_agents.floor.feet import likelihood
from tms_agents.floor.feet.one_foot import UNLIKELY
from tms_agents.floor.scan.clustered import ClusteredScan
from tms_agents.floor.state import BODY, FEET
from tms_agents.simulation.floor_world import FloorWorld


@pytest.mark.parametrize(("scene", "feet"), [("three close", "prints"), ("three close", "legs"), ("eight", "prints")])
def test_the_same_comes_out_if_nothing_is_shared(scene: str, feet: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    shared = _told(scene, feet)
    with monkeypatch.context() as patched:
        patched.setattr(association, "_POOL", 0)
        assert _told(scene, feet) == shared
    assert sum(len(one) for one in shared) > 50


def _told(scene: str, feet: Any) -> list[Any]:
    world = FloorWorld(scene, 1408, feet=feet, duration=20.0)
    sensors = {name: Sensor(mount.laser.sweep(), mount.reported) for name, mount in world.sensors.items()}
    estimator = FloorEstimator(sensors)
    return [repr(estimator.scan(f.sensor, f.t, f.ranges, f.intensities)) for f in world.scans()]


@pytest.mark.parametrize("feet", ["prints", "legs"])
def test_no_hypothesis_has_anybody_stand_on_a_print_that_is_no_more(feet: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    """Another one would begin in its place, maybe metres away, and count as the foot that has stayed."""
    looked, plain = [0], Association.step

    def step(self: Association, scan: ClusteredScan, sight: Any) -> Any:
        taken = plain(self, scan, sight)
        for one in self.hypotheses:
            for foot in ("a", "b"):
                stands = one[(one["used"] == 1) & (one[f"{foot}_print"] >= 0)]
                prints = scan.prints[stands[f"{foot}_print"]]
                assert prints["used"].all()
                away = np.hypot(stands[f"{foot}x"] - prints["x"], stands[f"{foot}y"] - prints["y"])
                assert (away < 0.5).all()
                looked[0] += len(stands)
        return taken

    monkeypatch.setattr(Association, "step", step)
    _told("eight", feet)
    assert looked[0] > 500


@pytest.mark.parametrize("feet", ["prints", "legs"])
def test_whose_foot_it_is_has_nothing_to_do_with_the_rest(feet: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    """Bodies that differ in these fields alone are the same to `likelihood.feet`."""
    rng = np.random.default_rng(0)
    compared, plain = [0], Association.step

    def step(self: Association, scan: ClusteredScan, sight: Any) -> Any:
        bodies = self.bodies.copy()
        other = bodies.copy()
        for field in (BODY.names or ())[FEET:]:
            other[field] = rng.integers(0, 100, other.size)
        free = np.ones(scan.clusters.size, np.bool_)
        for row in np.flatnonzero(bodies["used"]).tolist():
            one, two = np.empty((free.size, 2)), np.empty((free.size, 2))
            likelihood.feet(scan, free, bodies, row, one)
            likelihood.feet(scan, free, other, row, two)
            np.testing.assert_array_equal(one, two)
            compared[0] += int((one < UNLIKELY).sum())
        return plain(self, scan, sight)

    monkeypatch.setattr(Association, "step", step)
    _told("three close", feet)
    assert compared[0] > 500
