"""The same room told otherwise: in another frame, at another time, upside down; what is told must be the same."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import replace

import numpy as np
import pytest
from floor_rooms import Room, sweep, thing, together, walker
from numpy.typing import NDArray

from tms_agents.floor import FloorEstimator, FloorEvent, Scene, Sensor

Scan = tuple[str, float, NDArray[np.float64]]
#: Who puts something down, passes behind another one who crosses, and stands.
FIRST = [(3.0, 4.8, 2.0), (6.0, 2.2, 2.0), (8.0, 2.2, 2.0), (11.0, 3.6, 1.0), (14.0, 3.6, 1.0)]
SECOND = [(7.0, 4.8, 1.0), (11.0, 1.0, 3.0), (14.0, 1.2, 3.0)]
REGION = [(0.0, 0.0), (5.0, 0.0), (5.0, 4.0), (0.0, 4.0)]
DOOR = [(4.5, 0.5), (5.5, 0.5), (5.5, 2.5), (4.5, 2.5)]
BED = [(0.2, 2.6), (0.8, 2.6), (0.8, 3.8), (0.2, 3.8)]
POSE, UNTIL_S = (0.05, 0.05, math.pi / 4), 14.0
#: It is known how the laser measures: what walls tell is rounded.
LASER = Sensor(sweep(), POSE, 1.0)
Transform = Callable[[float, float], tuple[float, float]]


def scans() -> list[Scan]:
    put = together(walker(FIRST), walker(SECOND), thing(1.85, 1.9, 0.05, 7.0))
    # No scan is just so many tenths of a second after another, which rounding would decide.
    late = np.random.default_rng(1)
    seen = Room(put, sensors={"A": LASER}).scans(UNTIL_S)
    return [(name, t + late.uniform(0.0, 0.01), ranges) for name, t, ranges in seen]


SCANS = scans()


def scene(at: Transform = lambda x, y: (x, y), turn: Callable[[list], list] = lambda corners: corners) -> Scene:
    region, door, bed = ([at(*corner) for corner in turn(polygon)] for polygon in (REGION, DOOR, BED))
    return Scene(region=region, gates=[door], seats=[bed])


def play(
    laser: Sensor = LASER, room: Scene | None = None, seen: Iterable[Scan] = SCANS
) -> tuple[list[tuple], list[FloorEvent]]:
    """All labels after each scan, and all events."""
    estimator, labels, events = FloorEstimator({"A": laser}, scene=room or scene()), [], []
    for name, t, ranges in seen:
        events += estimator.scan(name, t, ranges)
        labels.append(tuple(estimator.labels()))
    return labels, events


@pytest.fixture(scope="module")
def told() -> tuple[list[tuple], list[FloorEvent]]:
    labels, events = play()
    assert {one.kind for one in labels[-1]} == {"mover", "object"} and len(labels[-1]) == 3
    return labels, events


def same(one: tuple[list[tuple], list[FloorEvent]], other: tuple[list[tuple], list[FloorEvent]], at: Transform) -> None:
    """The same is told, at places that are ``at`` those of the other."""
    assert [(type(event), event.label) for event in one[1]] == [(type(event), event.label) for event in other[1]]
    for here, there in zip(one[0], other[0], strict=True):
        assert [(label.id, label.kind, label.stale) for label in here] == [(a.id, a.kind, a.stale) for a in there]
        for label, seen in zip(here, there, strict=True):
            assert seen.xy == pytest.approx(at(*label.xy), abs=1e-5)


@pytest.mark.parametrize("turn", [0.0, 0.5 * math.pi, math.pi, math.radians(37)])
def test_in_a_frame_that_is_elsewhere(told, turn: float) -> None:
    c, s = math.cos(turn), math.sin(turn)

    def at(x: float, y: float) -> tuple[float, float]:
        return c * x - s * y + 312.0, s * x + c * y - 207.0

    same(told, play(Sensor(LASER.sweep, (*at(*POSE[:2]), POSE[2] + turn), 1.0), scene(at)), at)


def test_in_a_mirror() -> None:
    def at(x: float, y: float) -> tuple[float, float]:
        return x, -y

    upside_down = Sensor(replace(LASER.sweep, angles=-LASER.sweep.angles), (*at(*POSE[:2]), -POSE[2]), 1.0)
    same(play(), play(upside_down, scene(at)), at)


@pytest.mark.parametrize("ahead", [2.0, -2.0 * math.pi])
def test_by_a_laser_that_is_mounted_otherwise(told, ahead: float) -> None:
    turned = replace(LASER.sweep, angles=LASER.sweep.angles + ahead)
    same(told, play(Sensor(turned, (*POSE[:2], POSE[2] - ahead), 1.0)), lambda x, y: (x, y))


@pytest.mark.parametrize("later", [1.7e9, -1e6, 0.05])
def test_by_another_clock(told, later: float) -> None:
    same(told, play(seen=[(name, t + later, ranges) for name, t, ranges in SCANS]), lambda x, y: (x, y))


@pytest.mark.parametrize(
    "turn",
    [
        lambda corners: corners[::-1],
        lambda corners: corners[2:] + corners[:2],
        lambda corners: [*corners, corners[0]],
        lambda corners: [corners[0], *corners],
    ],
    ids=["backwards", "from elsewhere", "closed", "a corner twice"],
)
def test_with_polygons_that_are_listed_otherwise(turn: Callable[[list], list]) -> None:
    laser = replace(LASER, range_scale=None)  # so that the walls of the region count
    same(play(laser), play(laser, scene(turn=turn)), lambda x, y: (x, y))


def test_with_numbers_of_other_types_and_codes(told) -> None:
    far = [(name, t, np.where(np.isinf(ranges), 8.0, ranges)) for name, t, ranges in SCANS]
    single = [(name, t, ranges.astype(np.float32)) for name, t, ranges in SCANS]
    for seen in (far, single):
        same(told, play(seen=seen), lambda x, y: (x, y))


@pytest.mark.parametrize("light", [0.0, 300.0, np.nan])
def test_with_brightness_that_is_none(light: float) -> None:
    """What every echo has tells nobody apart: it is not even remembered."""
    plain, lit = FloorEstimator({"A": LASER}, scene=scene()), FloorEstimator({"A": LASER}, scene=scene())
    for name, t, ranges in SCANS:
        events = lit.scan(name, t, ranges, np.where(np.isfinite(ranges), light, 0.0))
        assert events == plain.scan(name, t, ranges)
    assert lit.to_dict() == plain.to_dict()


@pytest.mark.parametrize("second", [False, True], ids=["the first", "the second"])
def test_beside_a_laser_that_never_sees_anything(told, second: bool) -> None:
    both = {"A": LASER, "B": LASER} if second else {"B": LASER, "A": LASER}
    estimator, labels, events = FloorEstimator(both, scene=scene()), [], []
    for name, t, ranges in SCANS:
        events += estimator.scan(name, t, ranges)
        labels.append(tuple(estimator.labels()))
    same(told, (labels, events), lambda x, y: (x, y))


def test_beside_a_laser_that_begins_late() -> None:
    """It takes who stands there for a part of the room; that has gone then, but is not what somebody put down."""
    stands = [(7.0, 4.8, 2.0), (9.5, 2.2, 2.0), (13.0, 2.2, 2.0), (14.5, 2.2, 0.8), (19.0, 2.2, 0.8)]
    seen = list(Room(together(walker(stands), thing(1.9, 1.9, 0.05, 13.5))).scans(19.0))
    for begins in (9.6, 30.0):
        estimator = FloorEstimator({"A": LASER, "B": LASER}, scene=scene())
        for _, t, ranges in seen:
            estimator.scan("A", t, ranges)
            if t > begins:
                estimator.scan("B", t, ranges)
            if t < 15.5:
                told = [label.xy for label in estimator.labels() if label.kind == "object"]
        assert told == [pytest.approx((1.9, 1.9), abs=0.03)], begins
