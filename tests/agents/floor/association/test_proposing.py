"""The ways to go on come one by one, the best first, though most are never worked out."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from tms_agents.floor.association.assignment import at_least, one_of, reassign, solve, work
from tms_agents.floor.association.proposing import BRANCH, WORSE, Ways, next_best, no_ways


@settings(max_examples=60, deadline=None)
@given(hypotheses=st.integers(1, 4), clusters=st.integers(1, 6), people=st.integers(1, 4), seed=st.integers(0, 10**6))
def test_best_first_and_each_once(hypotheses: int, clusters: int, people: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    scores = np.sort(rng.uniform(0.0, 12.0, hypotheses))
    ways = no_ways(scores, clusters, people)
    many, expected = 0, []
    for h in range(hypotheses):
        cost = np.full((clusters, 2 * people + clusters), 1e6)
        cost[:, : 2 * people] = rng.uniform(-3.0, 12.0, (clusters, 2 * people))
        cost[np.arange(clusters), 2 * people + np.arange(clusters)] = rng.uniform(2.0, 12.0, clusters)
        ways.costs[h] = cost.ravel()
        columns, solved = np.empty(clusters, np.int64), one_of(ways.solved, h)
        best = solve(cost, 2 * people, 1e6, columns, solved)
        ways.people[h], ways.best[h] = people, best
        ways.score[many], ways.parent[many], ways.moved[many], ways.columns[many] = scores[h] + best, h, -1, columns
        expected.append((scores[h] + best, h))
        many += 1
        again, other = one_of(work(1, *cost.shape), 0), np.empty(clusters, np.int64)
        solve(cost, 2 * people, 1e6, columns, again)
        for i in np.flatnonzero(columns < 2 * people).tolist():
            barred = int(columns[i]) // 2 * 2
            ways.score[many] = scores[h] + best + at_least(cost, i, barred, solved)
            ways.parent[many], ways.moved[many], ways.columns[many] = h, i, columns
            many += 1
            total = reassign(cost, columns, i, barred, 1e6, other, again)
            if total - best < BRANCH:
                expected.append((scores[h] + total, h))
    least = float(ways.score[:many].min())
    told = []
    while (one := next_best(ways, many, least))[1] < np.inf:
        told.append((least + one[1], int(ways.parent[one[0]])))
        assert np.isclose(_total(ways, one[0], clusters, people) + scores[told[-1][1]], told[-1][0])
    wanted = sorted(way for way in expected if way[0] - least <= WORSE)
    assert np.allclose([way[0] for way in told], [way[0] for way in wanted])
    assert sorted(h for _, h in told) == sorted(h for _, h in wanted)


def _total(ways: Ways, o: int, clusters: int, people: int) -> float:
    """What the way costs by the table of its parent."""
    cost = ways.costs[ways.parent[o]].reshape(clusters, 2 * people + clusters)
    return float(cost[np.arange(clusters), ways.columns[o]].sum())
