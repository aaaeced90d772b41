"""One scan for all hypotheses: each goes on in its best ways, the worst are given up, and equal ones are united."""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from tms_agents.floor.adopting import Pool, adopt_from, chosen, complete
from tms_agents.floor.bodies import predict
from tms_agents.floor.clustered import ClusteredScan
from tms_agents.floor.hypotheses import ALL, FEET, Hypotheses, copy, exchange, first_like, same_places
from tms_agents.floor.identity import unite
from tms_agents.floor.proposing import WORSE, Children, propose

Array = NDArray[np.float64]


@njit(cache=True)
def advance(
    now: Hypotheses,
    after: Hypotheses,
    scores: Array,
    count: int,
    scan: ClusteredScan,
    scattered: Array,
    sight: Any,
    seats: Any,
    pool: Pool,
    taken: NDArray[np.bool_],
) -> int:
    """One scan for the first ``count`` hypotheses of ``now`` with ``scores`` (kept,): how many there are ``after`` it.

    The best is the first. ``scattered`` (3,) is what `shine.scatter` has learned; ``sight`` and ``seats`` as `missed`
    takes them. ``taken`` (m,) becomes which clusters are somebody's in the best. What was in ``now`` is overwritten.
    """
    # Here as in all kernels: to take a field of a tuple costs as much as to read ten numbers.
    before, raw, of, t = now.bodies, now.raw, scan.of, scan.t
    kept_most, n, m = before.shape[0], before.shape[1], scan.clusters.size
    most = count * (m + 1)
    child_score, child_parent, child_columns = np.empty(most), np.empty(most, np.int64), np.full((most, m), -1)
    children = Children(child_score, child_parent, child_columns)
    first, alike, top = np.empty((count, n), np.int64), np.empty((count, n), np.int64), 0
    for h in range(count):
        predict(before[h], t)
        for b in range(n):
            if before[h, b].used:
                top = max(top, b + 1 if before[h, b].confirmed else 0)
                g = first_like(raw, ALL, h, b)
                first[h, b] = g
                alike[h, b] = alike[g, b] if g < h else first_like(raw, FEET, h, b)
    many = propose(now, alike, top, scores, scan, children)
    rows, other_of, scratch = np.empty(n, np.int64), np.empty(n, np.int64), np.empty((2, n))
    owned, free = np.zeros((kept_most, max(m, 1)), np.bool_), np.ones(m, np.bool_)
    order = np.argsort(child_score[:many])
    pool.last[:] = -1
    kept, pooled = 0, 0
    least = child_score[order[0]]
    for o in order:
        if kept == kept_most or child_score[o] > least + WORSE:
            break
        parent, bodies, beliefs = child_parent[o], after.bodies[kept], after.beliefs[kept]
        copy(before[parent], now.beliefs[parent], bodies, beliefs, False)
        k = chosen(before[parent], 1, rows)
        free[:] = True
        pooled, unseen = adopt_from(
            before[parent],
            first[parent],
            bodies,
            rows[:k],
            child_columns[o],
            scan,
            free,
            sight,
            seats,
            pool,
            pooled,
        )
        nobodys_at = after.nobodys_at[kept]
        nobodys_at[:] = now.nobodys_at[parent]
        for i in range(m):
            if free[i] and of[i] >= 0:
                nobodys_at[of[i]] = t
        complete(bodies, scan, free, sight)
        score = child_score[o] - least + unseen
        known_already = False
        for j in range(kept):
            if same_places(after.bodies[j], bodies, top, other_of):
                worse = score - scores[j]
                unite(after.bodies[j], after.beliefs[j], bodies, beliefs, other_of, worse, scattered, scratch)
                known_already = True
                break
        if known_already:
            continue
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
