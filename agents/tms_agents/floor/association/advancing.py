"""One scan for all hypotheses: each goes on in its best ways, the worst are given up, and equal ones are united."""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from tms_agents.floor.association.adopting import Pool, adopt_from, chosen, complete
from tms_agents.floor.association.hypotheses import Hypotheses, copy, exchange, first_like, same_places
from tms_agents.floor.association.identity import unite
from tms_agents.floor.association.proposing import next_best, no_ways, propose
from tms_agents.floor.feet.bodies import predict
from tms_agents.floor.feet.prints import lift
from tms_agents.floor.scan.clustered import ClusteredScan
from tms_agents.floor.scan.freespace import Sight
from tms_agents.floor.state import FEET

Array = NDArray[np.float64]
Integers = NDArray[np.int64]


@njit(cache=True)
def advance(
    now: Hypotheses,
    after: Hypotheses,
    scores: Array,
    count: int,
    scan: ClusteredScan,
    scattered: Array,
    sight: Sight,
    seats: Any,
    pool: Pool,
    taken: NDArray[np.bool_],
) -> int:
    """One scan for the first ``count`` hypotheses of ``now`` with ``scores`` (kept,): how many there are ``after`` it.

    The best is the first. ``scattered`` (3,) is what `brightness.scatter` has learned; ``seats`` as `missed` takes.
    ``taken`` (m,) becomes which clusters are somebody's in the best. What was in ``now`` is overwritten.
    """
    # Out of the loops: whenever a field of a tuple is taken, its users are counted.
    before, of, t = now.bodies, scan.of, scan.t
    kept_most, n, m = before.shape[0], before.shape[1], scan.clusters.size
    first, alike = np.empty((count, n), np.int64), np.empty((count, n), np.int64)
    top = _compare(now, scan.prints, t, first, alike)
    ways = no_ways(scores[:count], m, top)
    parents, columns = ways.parent, ways.columns
    many = propose(now, alike, top, scan, ways)
    rows, scratch = np.empty(n, np.int64), np.empty((2, n))
    owned, free = np.zeros((kept_most, max(m, 1)), np.bool_), np.ones(m, np.bool_)
    pool.last[:] = -1
    kept, pooled = 0, 0
    least = ways.score[:many].min()
    while kept < kept_most:
        o, worse = next_best(ways, many, least)
        if worse == np.inf:
            break
        parent, bodies, beliefs = parents[o], after.bodies[kept], after.beliefs[kept]
        copy(before[parent], now.beliefs[parent], bodies, beliefs, False)
        k = chosen(before[parent], 1, rows)
        free[:] = True
        pooled, unseen = adopt_from(
            before[parent],
            first[parent],
            bodies,
            rows[:k],
            columns[o],
            scan,
            free,
            sight,
            seats,
            pool,
            pooled,
        )
        score = worse + unseen
        if _united(after, kept, top, score, scores, scattered, scratch):
            continue
        nobodys_at = after.nobodys_at[kept]
        nobodys_at[:] = now.nobodys_at[parent]
        for i in range(m):
            if free[i] and of[i] >= 0:
                nobodys_at[of[i]] = t
        complete(bodies, scan, free, sight)
        for i in range(m):
            owned[kept, i] = not free[i]
        scores[kept] = score
        kept += 1
    best = int(np.argmin(scores[:kept]))
    if best:
        exchange(after, 0, best, now)
        scores[0], scores[best] = scores[best], scores[0]
    scores[:kept] -= scores[0]
    for i in range(m):
        taken[i] = owned[best, i]
    return kept


@njit(cache=True)
def _compare(now: Hypotheses, prints: Any, t: float, first: Integers, alike: Integers) -> int:
    """Move everybody to the time t; how many of the bodies may be believed: those that are, are the first.

    Nobody stands on what is no more in ``prints`` (p,).

    Fills in which hypothesis each body was exactly the same ``first`` (count, n), and in which ``alike`` (count, n): in
    all that has to do with whose foot a cluster is.
    """
    bodies, raw = now.bodies, now.raw
    top = 0
    for h in range(first.shape[0]):
        lift(bodies[h], prints)
        predict(bodies[h], t)
        for b in range(bodies.shape[1]):
            if bodies[h, b].used:
                top = max(top, b + 1 if bodies[h, b].confirmed else 0)
                g = first_like(raw, raw.shape[2], h, b)
                first[h, b] = g
                alike[h, b] = alike[g, b] if g < h else first_like(raw, FEET, h, b)
    return top


@njit(cache=True)
def _united(
    after: Hypotheses, last: int, top: int, score: float, scores: Array, scattered: Array, scratch: Array
) -> bool:
    """Whether the ``last`` hypothesis is one that was kept before, but for who is who: then that one doubts it now."""
    bodies, beliefs = after.bodies, after.beliefs
    of = np.empty(bodies.shape[1], np.int64)
    for j in range(last):
        if same_places(bodies[j], bodies[last], top, of):
            worse = score - scores[j]
            unite(bodies[j], beliefs[j], bodies[last], beliefs[last], of, worse, scattered, scratch)
            return True
    return False
