"""Where people are told to be."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from tms_agents.floor import FloorEstimator, Sensor
from tms_agents.floor.feet.build import SHOES
from tms_agents.floor.feet.place import place
from tms_agents.simulation.floor_world import FloorWorld


@pytest.fixture(scope="module")
def walks() -> list[tuple[np.ndarray, np.ndarray, float]]:
    """Of three worlds with one who walks in shoes: how far off (m) is the filter, the place told, and its variance."""
    return [row for seed in (1501, 1502, 1503) for row in _followed(seed)]


def _followed(seed: int) -> list[tuple[np.ndarray, np.ndarray, float]]:
    world = FloorWorld("one", seed, feet="prints", duration=40.0)
    sensors = {name: Sensor(mount.laser.sweep(), mount.reported) for name, mount in world.sensors.items()}
    estimator = FloorEstimator(sensors)
    found = []
    for k, frame in enumerate(world.scans()):
        estimator.scan(frame.sensor, frame.t, frame.ranges, frame.intensities)
        found.append((k, frame.t, estimator._tracks.bodies.copy(), estimator.labels()))
    person = world.truth()["movers"][0]
    rows = []
    for k, t, bodies, labels in found:
        i = k - person["frames"][0]
        shod = [b for b in np.flatnonzero(bodies["used"] * bodies["confirmed"]) if bodies["shoe"][b] >= SHOES]
        if 0 <= i < len(person["x"]) and len(shod) == 1 and not bodies["stale"][shod[0]]:
            body, xy = bodies[shod[0]], np.array([person["x"][i], person["y"][i]])
            x, y, variance = place(body, t)
            told = next(one for one in labels if one.id == body["label"])
            assert told.xy == (x, y) and told.cov == (variance, 0.0, variance)
            rows.append((np.array([body["x"], body["y"]]) - xy, np.array([x, y]) - xy, variance))
    return rows


def test_who_walks_in_shoes_is_told_nearer_to_where_he_is(walks: Any) -> None:
    filtered, told, _ = (np.array(column) for column in zip(*walks, strict=True))
    assert len(told) > 300
    assert np.mean(told**2) < 0.85 * np.mean(filtered**2)


def test_the_variance_is_that_of_the_place(walks: Any) -> None:
    _, told, variances = (np.array(column) for column in zip(*walks, strict=True))
    assert 0.5 < np.mean((told**2).sum(axis=1) / 2 / variances) < 2.0


def test_who_shows_legs_is_where_the_filter_is() -> None:
    world = FloorWorld("one", 1501, feet="legs", duration=20.0)
    sensors = {name: Sensor(mount.laser.sweep(), mount.reported) for name, mount in world.sensors.items()}
    estimator = FloorEstimator(sensors)
    for frame in world.scans():
        estimator.scan(frame.sensor, frame.t, frame.ranges, frame.intensities)
        for body in estimator._tracks.bodies:
            if body["used"] and body["confirmed"]:
                assert place(body, frame.t)[:2] == (body["x"], body["y"])
    assert estimator.labels()
