"""How hypotheses may go on in a scan: the best assignment of its clusters to feet, and the next best."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from tms_agents.floor.association.adopting import chosen
from tms_agents.floor.association.assignment import Work, at_least, one_of, reassign, solve, work
from tms_agents.floor.association.hypotheses import Hypotheses
from tms_agents.floor.feet.clutter import goes_on, known, nobodys, spanned
from tms_agents.floor.feet.likelihood import feet
from tms_agents.floor.feet.one_foot import UNLIKELY
from tms_agents.floor.scan.clustered import ClusteredScan

Array = NDArray[np.float64]
Integers = NDArray[np.int64]

#: How much worse (negative log likelihood) a hypothesis may be than the best, and than its parent.
WORSE, BRANCH = 18.0, 10.0


class Ways(NamedTuple):
    """Ways to go on, c at most, of as many hypotheses as h: `no_ways` makes it.

    The ``score`` (c,) of each, its ``parent`` (c,), and the ``columns`` (c, m) of the clusters. A way is finished where
    ``moved`` (c,) is -1. Else it is the cluster that must not be who it is in the parent's best way, which is in
    ``columns`` as yet: ``score`` is a lower bound, and `next_best` solves it when its turn has come.

    Of the hypotheses: their ``scores`` (h,); in ``costs`` (h, ..) a table (m, 2k + m) each of what a cluster costs as
    whose foot, of so many ``people`` (h,); what the ``best`` (h,) way costs, and how that was ``solved``.
    """

    score: Array
    parent: Integers
    columns: Integers
    moved: Integers
    scores: Array
    costs: Array
    people: Integers
    best: Array
    solved: Work


@njit(cache=False)
def no_ways(scores: Array, m: int, top: int) -> Ways:
    """None yet, for hypotheses with such ``scores`` (h,), m clusters, and ``top`` people at most."""
    # Not cached, as `work`.
    count, n = scores.size, 2 * top + m
    most = count * (m + 1)
    score, parent, moved = np.empty(most), np.empty(most, np.int64), np.empty(most, np.int64)
    people, best = np.empty(count, np.int64), np.empty(count)
    columns, costs = np.full((most, m), -1), np.empty((count, m * n))
    # `advance` fills the scores of the next hypotheses while these are needed.
    return Ways(score, parent, columns, moved, scores.copy(), costs, people, best, work(count, m, n))


@njit(cache=True)
def propose(now: Hypotheses, alike: Integers, top: int, scan: ClusteredScan, ways: Ways) -> int:
    """Fill ``ways`` with how each hypothesis may go on, but for what `next_best` finds out: how many there are.

    The best assignment, and the best in which one cluster is not who it is there. ``alike`` (count, n) is in which
    hypothesis each body was the same first, for `feet`: most people are the same in all. All who are believed are among
    the first ``top``.
    """
    score, parent, moved, scores = ways.score, ways.parent, ways.moved, ways.scores
    count, n, m = alike.shape[0], now.bodies.shape[1], scan.clusters.size
    rows = np.empty(n, np.int64)
    everything, columns = np.ones(m, np.bool_), np.empty(m, np.int64)
    told = np.empty((count, top, m, 2))
    spans = np.empty(m)
    spanned(scan.clusters, spans)
    many = 0
    for h in range(count):
        bodies = now.bodies[h]
        k = chosen(bodies, 1, rows)
        moved[many], parent[many] = -1, h
        if m == 0 or k == 0:
            score[many] = scores[h]
            many += 1
            continue
        cost = ways.costs[h, : m * (2 * k + m)].reshape(m, 2 * k + m)
        for column in range(k):
            row = rows[column]
            like = alike[h, row]
            if like == h:
                feet(scan, everything, bodies, row, told[h, row])
            for i in range(m):
                cost[i, 2 * column], cost[i, 2 * column + 1] = told[like, row, i, 0], told[like, row, i, 1]
        nobodys(scan, bodies, rows[:k], spans, cost[:, 2 * k :])
        known(scan, bodies, cost[:, 2 * k :])
        goes_on(scan, bodies, now.nobodys_at[h], cost[:, 2 * k :])
        solved = one_of(ways.solved, h)
        best = solve(cost, 2 * k, UNLIKELY, columns, solved)
        ways.people[h], ways.best[h] = k, best
        score[many], ways.columns[many] = scores[h] + best, columns
        many += 1
        for i in range(m):
            if columns[i] >= 2 * k:
                continue
            more = at_least(cost, i, columns[i] // 2 * 2, solved)
            if more < BRANCH:
                score[many], parent[many], moved[many] = scores[h] + best + more, h, i
                ways.columns[many] = columns
                many += 1
    return many


@njit(cache=True)
def next_best(ways: Ways, many: int, least: float) -> tuple[int, float]:
    """The best of so many ways that was not taken yet, and how much worse than ``least``, the best of all, it is.

    It is taken now; inf: there is none that counts. Of those that are too bad hardly any is worked out.
    """
    score, m = ways.score, ways.columns.shape[1]
    other = np.empty(m, np.int64)
    while True:
        o = int(np.argmin(score[:many]))
        i, h, worse = ways.moved[o], ways.parent[o], score[o] - least
        if i < 0 or worse > WORSE:
            score[o] = np.inf
            return o, worse if worse <= WORSE else np.inf
        columns, k, best = ways.columns[o], ways.people[h], ways.best[h]
        cost = ways.costs[h, : m * (2 * k + m)].reshape(m, 2 * k + m)
        most = min(BRANCH, least + WORSE - ways.scores[h] - best)
        total = reassign(cost, columns, i, columns[i] // 2 * 2, 1.01 * most, other, one_of(ways.solved, h))
        columns[:] = other
        score[o], ways.moved[o] = ways.scores[h] + total if total - best < most else np.inf, -1
