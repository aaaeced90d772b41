"""How hypotheses may go on in a scan: the best assignment of its clusters to feet, and the next best."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from tms_agents.floor.association.adopting import chosen
from tms_agents.floor.association.assignment import reassign, solve, work
from tms_agents.floor.association.hypotheses import Hypotheses
from tms_agents.floor.feet.likelihood import feet
from tms_agents.floor.feet.nobodys import goes_on, known, nobodys, spanned
from tms_agents.floor.feet.one_foot import UNLIKELY
from tms_agents.floor.scan.clustered import ClusteredScan

Array = NDArray[np.float64]
Integers = NDArray[np.int64]

#: How much worse (negative log likelihood) a hypothesis may be than the best, and than its parent.
WORSE, _BRANCH = 18.0, 10.0


class Children(NamedTuple):
    """Ways to go on: the ``score`` (c,) of each, its ``parent`` (c,), and the ``columns`` (c, m) of the clusters."""

    score: Array
    parent: Integers
    columns: Integers


@njit(cache=True)
def propose(now: Hypotheses, alike: Integers, top: int, scores: Array, scan: ClusteredScan, children: Children) -> int:
    """Fill ``children`` with how each hypothesis may go on, its ``scores`` (kept,) being what they are; how many.

    The best assignment, and the best in which one cluster is not who it is there. ``alike`` (count, n) is in which
    hypothesis each body was the same first, for `feet`: most people are the same in all. All who are believed are among
    the first ``top``.
    """
    score, parent, ways = children.score, children.parent, children.columns
    count, n, m = alike.shape[0], now.bodies.shape[1], scan.clusters.size
    rows = np.empty(n, np.int64)
    everything, columns, other = np.ones(m, np.bool_), np.empty(m, np.int64), np.empty(m, np.int64)
    told = np.empty((count, top, m, 2))
    table, solved = np.empty(m * (2 * top + m)), work(m, 2 * top + m)
    spans = np.empty(m)
    spanned(scan.clusters, spans)
    many, least = 0, np.inf
    for h in range(count):
        bodies = now.bodies[h]
        k = chosen(bodies, 1, rows)
        if m == 0 or k == 0:
            score[many], parent[many] = scores[h], h
            many += 1
            continue
        cost = table[: m * (2 * k + m)].reshape(m, 2 * k + m)
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
        best = solve(cost, 2 * k, UNLIKELY, columns, solved)
        score[many], parent[many] = scores[h] + best, h
        least = min(least, scores[h] + best)
        # What is worse is given up anyway.
        most = min(_BRANCH, least + WORSE - scores[h] - best)
        ways[many] = columns
        many += 1
        for i in range(m):
            if columns[i] >= 2 * k:
                continue
            total = reassign(cost, columns, i, columns[i] // 2 * 2, 1.01 * most, other, solved)
            if total - best < most:
                score[many], parent[many] = scores[h] + total, h
                ways[many] = other
                many += 1
    return many
