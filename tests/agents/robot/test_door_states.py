"""Open or closed, out of the wall beside a door: any hinge, any direction, walls before and behind its plane."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tms_agents.robot.door_states import DoorAngle, closed_direction, door_angle
from tms_agents.slam.geometry import Floats, transform, wrapped

WIDTH = 0.9


def wall(recess: float, random: np.random.Generator, behind: float = 1.0, past: float = 1.0) -> Floats:
    """Beams that ended on a wall along x on both sides of a door from 0 to ``WIDTH``, 12 mm off now and then."""
    x = np.concatenate([np.arange(-behind, -0.01, 0.02), WIDTH + 0.02 + np.arange(0.0, past, 0.02)])
    jambs = np.array([(side, y) for side in (-0.01, WIDTH + 0.02) for y in np.linspace(0, recess, 5)])
    points = np.concatenate([np.column_stack([x, np.full(len(x), recess)]), jambs])
    return points + random.normal(0, 0.012, points.shape)


@given(
    st.floats(-np.pi, np.pi),
    st.floats(-20, 20),
    st.floats(-0.11, 0.11),
    st.sampled_from([-1, 1]),
    st.floats(-2.0, 2.0),
    st.integers(0, 2**32 - 1),
)
def test_it_is_closed_where_it_is_in_line_with_the_wall(
    theta: float, x: float, recess: float, mirrored: int, opened: float, seed: int
) -> None:
    frame = np.array([x, -x / 2, theta])
    points = wall(recess, np.random.default_rng(seed)) * [1, mirrored]
    hinge = transform(frame, np.zeros((1, 2)))[0]
    found = door_angle(np.array([*hinge, theta + opened]), WIDTH, transform(frame, points))
    assert found is not None
    assert abs(wrapped(found.angle - opened)) < np.radians(9)


def test_without_a_wall_on_both_sides_nobody_can_tell() -> None:
    random = np.random.default_rng(1)
    assert door_angle(np.zeros(3), WIDTH, np.zeros((0, 2))) is None
    assert closed_direction(np.zeros(2), WIDTH, wall(0.0, random, past=0.05)) is None
    assert closed_direction(np.zeros(2), WIDTH, wall(0.0, random) + np.array([0.0, 5.0])) is None


@pytest.mark.parametrize(("degrees", "state"), [(0, "closed"), (-14, "closed"), (16, "open"), (-90, "open")])
def test_a_door_is_open_from_fifteen_degrees_on(degrees: float, state: str) -> None:
    assert DoorAngle(float(np.radians(degrees))).state == state
