"""Where one can go out of sight: behind what is nearer, where the reach ends, at the sides of the sweep."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from tms_agents.floor.scan.edges import edges_of_sight, from_edge, looks_past

Array = NDArray[np.float64]
HALF = np.radians(np.linspace(-90.0, 90.0, 361))
ROUND = np.radians(np.linspace(-179.5, 180.0, 720))
MIDDLE, WEST = np.array([2.5, 2.0, 0.3]), np.array([0.01, 2.0, 0.0])


def room(pose: Array, angles: Array, box: tuple[float, float, float] | None = None) -> Array:
    """Ranges in a room of 5 by 4 m in which there may be a disc (x, y, radius)."""
    turned = angles + pose[2]
    dx, dy = np.cos(turned), np.sin(turned)
    with np.errstate(divide="ignore"):
        across = np.where(dx > 0, (5.0 - pose[0]) / dx, -pose[0] / dx)
        along = np.where(dy > 0, (4.0 - pose[1]) / dy, -pose[1] / dy)
    ranges = np.minimum(np.where(dx == 0, np.inf, across), np.where(dy == 0, np.inf, along))
    if box is not None:
        u, v = box[0] - pose[0], box[1] - pose[1]
        ahead, aside = u * dx + v * dy, np.abs(u * dy - v * dx)
        hit = (aside < box[2]) & (ahead > 0)
        ranges[hit] = ahead[hit] - np.sqrt(box[2] ** 2 - aside[hit] ** 2)
    return np.asarray(ranges)


def test_in_a_bare_room_seen_all_round_there_is_nowhere_to_go() -> None:
    edges = edges_of_sight(room(MIDDLE, ROUND), 30.0, ROUND, MIDDLE)
    assert len(edges) == 0
    assert from_edge(edges, 1.0, 1.0) == math.inf


def test_behind_a_pillar_somebody_is_out_of_sight() -> None:
    edges = edges_of_sight(room(MIDDLE, ROUND, (4.0, 2.0, 0.2)), 30.0, ROUND, MIDDLE)
    assert from_edge(edges, 4.4, 2.3) < 0.15
    assert from_edge(edges, 3.2, 2.0) > 0.5
    assert from_edge(edges, 1.0, 3.0) > 2.0


def test_where_nothing_echoes_feet_are_hardly_seen_before_the_end_of_the_reach() -> None:
    ranges = room(MIDDLE, ROUND)
    ranges[np.abs(ROUND) < 0.3] = np.inf
    edges = edges_of_sight(ranges, 4.0, ROUND, MIDDLE)
    x, y = MIDDLE[0] + 3.7 * math.cos(MIDDLE[2]), MIDDLE[1] + 3.7 * math.sin(MIDDLE[2])
    assert from_edge(edges, x, y) < 0.03


def test_a_laser_that_looks_to_one_side_does_not_see_who_goes_past_its_sweep() -> None:
    edges = edges_of_sight(room(WEST, HALF), 30.0, HALF, WEST)
    assert from_edge(edges, 0.2, 1.0) < 0.25
    assert from_edge(edges, 3.0, 2.0) > 2.5


def test_what_another_laser_looks_past_is_no_edge() -> None:
    pillar = (2.5, 2.0, 0.3)
    east = np.array([4.99, 2.0, math.pi])
    mine = edges_of_sight(room(WEST, HALF, pillar), 30.0, HALF, WEST)
    past = looks_past(mine, room(east, HALF, pillar), 30.0, HALF, east)
    behind = np.hypot(mine[:, 0] - 3.5, mine[:, 1] - 2.0) < 1.0
    assert behind.any() and past[behind].all()
    assert not looks_past(mine, np.full(HALF.size, 0.5), 30.0, HALF, east).any()
    away = np.array([4.99, 2.0, 0.0])
    assert not looks_past(mine, np.full(HALF.size, 20.0), 30.0, HALF, away).any()


@pytest.mark.parametrize("turn", [0.0, 2.0, math.pi, -3.0])
def test_it_does_not_matter_which_way_the_laser_looks(turn: float) -> None:
    pose, angles = np.array([2.5, 2.0, 0.3 - turn]), ROUND + turn
    one = edges_of_sight(room(MIDDLE, ROUND, (4.0, 2.0, 0.2)), 30.0, ROUND, MIDDLE)
    two = edges_of_sight(room(pose, angles, (4.0, 2.0, 0.2)), 30.0, angles, pose)
    np.testing.assert_allclose(one, two, atol=1e-9)


@given(st.integers(0, 2**32 - 1))
def test_whatever_is_seen_edges_are_short_and_in_reach(seed: int) -> None:
    rng = np.random.default_rng(seed)
    ranges = rng.choice([0.5, 2.0, 3.0, np.inf], size=HALF.size)
    edges = edges_of_sight(ranges, 5.0, HALF, MIDDLE)
    assert np.isfinite(edges).all()
    assert (np.hypot(edges[:, 2] - edges[:, 0], edges[:, 3] - edges[:, 1]) < 0.8).all()
    assert (np.hypot(edges[:, 0] - MIDDLE[0], edges[:, 1] - MIDDLE[1]) < 5.0).all()
