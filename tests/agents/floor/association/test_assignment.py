"""The compiled assignment against scipy's."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import linear_sum_assignment

from tms_agents.floor.association.assignment import assign, at_least, one_of, reassign, solve, work


@settings(max_examples=100)
@given(rows=st.integers(1, 9), extra=st.integers(0, 9), seed=st.integers(0, 10**6), coarse=st.booleans())
def test_the_sum_is_the_least(rows: int, extra: int, seed: int, coarse: bool) -> None:
    cost = np.random.default_rng(seed).uniform(0.0, 10.0, (rows, rows + extra))
    if coarse:
        cost = np.round(cost)
    cost[np.random.default_rng(seed + 1).uniform(size=cost.shape) < 0.2] = 1e6
    columns = np.full(rows, -1)
    total = assign(cost, rows + extra, np.inf, columns)
    best = cost[linear_sum_assignment(cost)].sum()
    assert len(set(columns.tolist())) == rows
    assert np.isclose(cost[np.arange(rows), columns].sum(), total)
    assert np.isclose(total, best)


@settings(max_examples=200)
@given(
    rows=st.integers(1, 9),
    people=st.integers(1, 9),
    seed=st.integers(0, 10**6),
    share=st.floats(0.1, 1.0),
    most=st.sampled_from([2.0, 7.0, 1e9]),
)
def test_the_next_best_is_that_of_a_table_without_what_is_barred(
    rows: int, people: int, seed: int, share: float, most: float
) -> None:
    """As in a scan: two columns for each person, of whom a row knows some, and one of its own for each row."""
    rng = np.random.default_rng(seed)
    cost = np.full((rows, 2 * people + rows), 1e6)
    cost[:, : 2 * people] = np.where(
        rng.uniform(size=(rows, 2 * people)) < share, rng.uniform(-3.0, 20.0, (rows, 2 * people)), 1e6
    )
    cost[np.arange(rows), 2 * people + np.arange(rows)] = rng.uniform(2.0, 12.0, rows)
    columns, solved = np.empty(rows, np.int64), one_of(work(3, rows + 2, cost.shape[1] + 5), 1)
    best = solve(cost, 2 * people, 1e6, columns, solved)
    assert np.isclose(best, cost[linear_sum_assignment(cost)].sum())
    for row in np.flatnonzero(columns < 2 * people).tolist():
        barred = int(columns[row]) // 2 * 2
        without = cost.copy()
        without[row, barred : barred + 2] = 1e6
        expected = without[linear_sum_assignment(without)].sum()
        other = np.full(rows, -1)
        assert at_least(cost, row, barred, solved) <= expected - best + 1e-9
        total = reassign(cost, columns, row, barred, most, other, solved)
        if expected - best < 0.99 * most:
            assert np.isclose(total, expected)
            assert len(set(other.tolist())) == rows
            assert other[row] not in (barred, barred + 1)
            assert np.isclose(cost[np.arange(rows), other].sum(), total)
        elif expected - best > 1.01 * most:
            assert total == np.inf
    # What a search leaves behind is nothing to the next.
    assert solve(cost, 2 * people, 1e6, columns, solved) == best
