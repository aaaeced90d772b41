"""Drawn buildings have rings all over, and ways that keep to their corridors; a tour may wind round and round."""

from __future__ import annotations

import itertools

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from tms_agents.simulation.building import Drive, drive
from tms_agents.simulation.tours import drawn_plan


@settings(max_examples=60)
@given(seed=st.integers(0, 10_000), length=st.floats(100.0, 3000.0))
def test_the_way_keeps_to_corridors_that_all_lie_on_rings(seed: int, length: float) -> None:
    corners, corridors, way = drawn_plan(np.random.default_rng(seed), length)
    ends = np.bincount(np.array(corridors).ravel(), minlength=len(corners))
    assert ends.min() >= 2
    driven = [tuple(sorted(step)) for step in itertools.pairwise(way)]
    assert set(driven) <= set(corridors)
    assert all(a != c for a, _, c in zip(way, way[1:], way[2:], strict=False))  # it never turns back
    steps = [float(np.hypot(*np.subtract(corners[b], corners[a]))) for a, b in itertools.pairwise(way)]
    assert sum(steps[:-1]) < length <= sum(steps)
    again = drawn_plan(np.random.default_rng(seed), length)
    assert again == (corners, corridors, way)


def test_a_robot_that_winds_round_and_round_still_sees() -> None:
    square = ([(0.0, 0.0), (9.0, 0.0), (9.0, 9.0), (0.0, 9.0)], [(0, 1), (1, 2), (2, 3), (0, 3)], [0, 1, 2, 3] * 4)
    driven = drive(square, Drive(seed=1, lost=0.0, beams=90))
    assert driven.truth[-1, 2] > 6 * np.pi
    assert driven.ranges.shape[1] == 90
    assert (driven.ranges < 50.0).mean(axis=1).min() > 0.95
