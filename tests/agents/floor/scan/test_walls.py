"""A laser whose ruler errs is held against the walls of the room, where they are known."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import pytest
from floor_rooms import Room, cast, sweep, thing, walker
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from tms_agents.floor import FloorEstimator, Scene, Sensor
from tms_agents.floor.scan.walls import held_against

OUTLINE = ((0.0, 0.0), (5.0, 0.0), (5.0, 4.0), (0.0, 4.0))
WIDE = sweep(541, 1.5 * math.pi)
WAY = [(9.0, 4.8, 1.0), (11.0, 3.2, 1.8), (13.0, 3.2, 1.8), (16.0, 4.9, 1.0)]


def points(
    pose: tuple[float, float, float], longer: float, circles: Sequence[tuple[float, float, float]] = ()
) -> NDArray[np.float64]:
    """What a laser at ``pose`` takes the room for (n, 2) that measures everything ``longer``."""
    sensor = Sensor(WIDE, pose)
    ranges = cast(sensor, circles, Room().segments(0.0)) * longer
    ranges += np.random.default_rng(1).normal(0.0, 0.002, ranges.size)
    angles = np.asarray(sensor.sweep.angles)
    seen = np.isfinite(ranges)
    return np.stack([ranges[seen] * np.cos(angles[seen]), ranges[seen] * np.sin(angles[seen])], axis=1)


@settings(max_examples=30)
@given(
    longer=st.floats(0.985, 1.015),
    off=st.tuples(st.floats(-0.03, 0.03), st.floats(-0.03, 0.03), st.floats(-0.01, 0.01)),
)
def test_the_walls_tell_how_a_ruler_errs_and_where_the_laser_is(longer: float, off: tuple[float, float, float]) -> None:
    pose = (0.05, 0.05, math.pi / 4)
    seen = points(pose, longer, [(2.0, 3.6, 0.3), (4.0, 1.0, 0.2)])
    believed = (pose[0] + off[0], pose[1] + off[1], pose[2] + off[2])
    fit = held_against(seen, OUTLINE, believed)
    assert fit is not None
    assert fit.range_scale == pytest.approx(1.0 / longer, abs=0.001)
    assert fit.pose == pytest.approx(pose, abs=0.004)


@pytest.mark.parametrize(
    "outline",
    [(*OUTLINE, OUTLINE[0]), (OUTLINE[0], *OUTLINE), OUTLINE[::-1]],
    ids=["closed", "a corner twice", "turned"],
)
def test_how_the_outline_is_listed_does_not_count(outline: Sequence[tuple[float, float]]) -> None:
    pose = (0.05, 0.05, math.pi / 4)
    seen = points(pose, 1.008)
    one, other = held_against(seen, OUTLINE, pose), held_against(seen, outline, pose)
    assert one is not None
    assert other is not None
    assert other.pose == pytest.approx(one.pose, abs=1e-9)
    assert other.range_scale == pytest.approx(one.range_scale, abs=1e-9)


@pytest.mark.parametrize(
    "outline",
    [
        ((0.0, 0.0), (6.0, 0.0), (6.0, 5.0), (0.0, 5.0)),
        ((0.05, 0.05), (4.95, 0.05), (4.95, 3.95), (0.05, 3.95)),
        ((-0.08, -0.08), (5.08, -0.08), (5.08, 4.08), (-0.08, 4.08)),
        ((-9.0, 0.0), (9.0, 0.0), (9.0, 4.0)),
        ((1.0, 1.0), (1.0, 1.0), (1.0, 1.0)),
    ],
    ids=["another room", "5 cm inside", "8 cm outside", "hardly a wall", "no room"],
)
def test_walls_that_are_not_there_tell_nothing(outline: Sequence[tuple[float, float]]) -> None:
    for pose in ((0.05, 0.05, math.pi / 4), (2.5, 0.05, math.pi / 2)):
        assert held_against(points(pose, 1.0), outline, pose) is None


def test_who_sees_walls_on_one_side_of_it_may_stand_elsewhere_instead() -> None:
    seen = points((2.5, 2.0, 0.0), 1.01)
    ahead = seen[(seen[:, 0] > 0.0) & (seen[:, 1] > 0.0)]
    assert held_against(ahead, OUTLINE, (2.5, 2.0, 0.0)) is None


def test_a_scale_that_is_told_counts_whatever_the_walls_are_and_nothing_learned_with_another_one() -> None:
    room, told = Room(), {"A": Sensor(WIDE, (0.05, 0.05, math.pi / 4), 1.01)}
    estimator, _ = Room(sensors=told).play(8.0, FloorEstimator(told, scene=Scene(region=OUTLINE)))
    walls = estimator.to_dict()
    assert walls["sensors"]["A"]["range_scale"] == 1.01
    other = {"A": Sensor(WIDE, (0.05, 0.05, math.pi / 4), 0.99)}
    with pytest.raises(ValueError, match="measured otherwise"):
        FloorEstimator.from_dict(walls, other)
    with pytest.raises(ValueError, match="a tenth"):
        Sensor(WIDE, room.sensors["A"].pose, 1.2)


@pytest.mark.parametrize(("region", "near_m", "far_m"), [(OUTLINE, 0.0, 0.012), (None, 0.03, 0.05)])
def test_a_thing_is_where_it_is_though_the_laser_measures_everything_too_long(
    region: Sequence[tuple[float, float]] | None, near_m: float, far_m: float
) -> None:
    rest = thing(3.0, 2.6, 0.05, 12.0)
    sensors = {"A": Sensor(WIDE, (0.05, 0.05, math.pi / 4))}
    room, longer = Room(lambda t: [*walker(WAY)(t), *rest(t)], sensors=sensors), 1.01
    estimator = FloorEstimator(room.sensors, scene=Scene(region=region))
    for name, t, ranges in room.scans(20.0):
        estimator.scan(name, t, longer * ranges)
    (told,) = [label for label in estimator.labels() if label.kind == "object"]
    assert near_m <= math.dist(told.xy, (3.0, 2.6)) < far_m
    again = FloorEstimator.from_dict(estimator.to_dict(), room.sensors, scene=Scene(region=region))
    name, t, ranges = list(room.scans(20.1))[-1]
    estimator.scan(name, t, longer * ranges)
    again.scan(name, t, longer * ranges)
    assert again.labels() == estimator.labels()
