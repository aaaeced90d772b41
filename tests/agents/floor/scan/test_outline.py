"""Where a rectangle of known size stands, told from one scan."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from floor_rooms import Circle, Segment, cast, sweep
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from tms_agents.floor import Sensor
from tms_agents.floor.scan.background import FOREGROUND
from tms_agents.floor.scan.outline import fit, quality, search
from tms_agents.floor.scan.rays import rays

Array = NDArray[np.float64]

A, B = 0.275, 0.21
SENSOR = Sensor(sweep(), (0.0, 0.0, 0.0))


def rectangle(x: float, y: float, yaw: float) -> list[Segment]:
    c, s = math.cos(yaw), math.sin(yaw)
    corners = [(x + c * u - s * v, y + s * u + c * v) for u, v in ((A, B), (-A, B), (-A, -B), (A, -B))]
    return [(*one, *two) for one, two in zip(corners, corners[1:] + corners[:1], strict=True)]


def scan(at: tuple[float, float, float], circles: list[Circle] | None = None, seed: int = 0) -> Any:
    """What the sensor sees of a rectangle and round things, as `fit` takes it."""
    ranges = cast(SENSOR, circles or [], [(6.0, -6.0, 6.0, 6.0), *rectangle(*at)])
    ranges = ranges + np.random.default_rng(seed).normal(0.0, 0.004, ranges.size)
    states = np.where(ranges < 5.9, FOREGROUND, 0).astype(np.int8)
    pose = np.zeros(3)
    step = float(SENSOR.sweep.angles[1] - SENSOR.sweep.angles[0])
    return ranges, states, rays(SENSOR, SENSOR.pose, ()), pose, float(SENSOR.sweep.angles[0]), step


def turned(one: float, two: float) -> float:
    """Between two directions of a rectangle, which looks the same from behind."""
    return abs(math.remainder(one - two, math.pi))


PLACES = st.tuples(st.floats(1.0, 3.5), st.floats(-0.5, 0.5), st.floats(-math.pi, math.pi))


@given(PLACES, st.floats(-0.04, 0.04), st.floats(-0.04, 0.04), st.floats(-0.12, 0.12), st.integers(0, 99))
@settings(max_examples=60, deadline=None)
def test_it_is_fitted_from_beside_it(
    place: tuple[float, float, float], dx: float, dy: float, turn: float, seed: int
) -> None:
    at, how = np.array([place[0] + dx, place[1] + dy, place[2] + turn]), np.zeros(6)
    # As often as a robot that stands is looked at.
    for k in range(6):
        fit(at, A, B, 0.02, 0.12, 6, how, *scan(place, seed=seed + k))
    assert math.dist(at[:2], place[:2]) < 0.03
    assert turned(at[2], place[2]) < 0.06
    assert quality(how, 0.0) > 0.9


@given(PLACES, st.integers(0, 99))
@settings(max_examples=60, deadline=None)
def test_it_is_found_without_knowing_its_yaw(place: tuple[float, float, float], seed: int) -> None:
    x, y, _ = place
    away = math.hypot(x, y)
    # The middle of what is seen of it, roughly.
    at, how = np.array([x - 0.15 * x / away, y - 0.15 * y / away, 0.0]), np.zeros(6)
    assert search(at, A, B, 12, how, *scan(place, seed=seed)) > 0.85
    # Of one face alone nobody knows on which side of it more is hidden than the size tells.
    assert math.dist(at[:2], (x, y)) < 0.1


def test_what_hides_a_part_of_it_does_not_move_it() -> None:
    place = (2.0, 0.1, 0.4)
    for y in np.linspace(-0.4, 0.6, 11):
        at, how = np.array(place), np.zeros(6)
        for k in range(5):
            fit(at, A, B, 0.02, 0.12, 6, how, *scan(place, [(1.6, float(y), 0.05)], seed=k))
        assert math.dist(at[:2], place[:2]) < 0.03
        assert quality(how, 0.0) > 0.8


def test_legs_and_a_big_round_thing_are_none() -> None:
    for circles in ([(2.0, 0.0, 0.6)], [(2.0, 0.14, 0.06), (2.0, -0.14, 0.06)], [(2.0, 0.0, 0.08)]):
        at, how = np.array([1.9, 0.0, 0.0]), np.zeros(6)
        assert search(at, A, B, 12, how, *scan((5.0, 3.0, 0.0), circles)) < 0.85


def test_what_has_gone_is_not_seen() -> None:
    at, how = np.array([2.0, 0.0, 0.0]), np.zeros(6)
    fit(at, A, B, 0.02, 0.12, 6, how, *scan((4.0, 3.0, 0.0)))
    assert quality(how, 0.0) == 0.0
    assert math.dist(at[:2], (2.0, 0.0)) < 0.3
