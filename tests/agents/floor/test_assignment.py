"""The compiled assignment against scipy's."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import linear_sum_assignment

from tms_agents.floor.assignment import assign


@settings(max_examples=100)
@given(rows=st.integers(1, 9), extra=st.integers(0, 9), seed=st.integers(0, 10**6), coarse=st.booleans())
def test_the_sum_is_the_least(rows: int, extra: int, seed: int, coarse: bool) -> None:
    cost = np.random.default_rng(seed).uniform(0.0, 10.0, (rows, rows + extra))
    if coarse:
        cost = np.round(cost)
    cost[np.random.default_rng(seed + 1).uniform(size=cost.shape) < 0.2] = 1e6
    columns = np.full(rows, -1)
    total = assign(cost, columns)
    best = cost[linear_sum_assignment(cost)].sum()
    assert len(set(columns.tolist())) == rows
    assert np.isclose(cost[np.arange(rows), columns].sum(), total)
    assert np.isclose(total, best)
