"""What follows when it is decided whose feet the clusters of a scan are: bodies move, and new ones begin."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from tms_agents.floor.association.assignment import assign
from tms_agents.floor.feet.bodies import begin, narrow, together, update
from tms_agents.floor.feet.brightness import learn
from tms_agents.floor.feet.clutter import costs
from tms_agents.floor.feet.likelihood import too_wide
from tms_agents.floor.feet.missed import expect, missed, out_of_reach
from tms_agents.floor.feet.one_foot import UNLIKELY
from tms_agents.floor.feet.person import is_person
from tms_agents.floor.norm import norm
from tms_agents.floor.scan.clustered import ClusteredScan
from tms_agents.floor.scan.freespace import Sight

Array = NDArray[np.float64]

#: A new body begins only at a print younger than this (s): what has stood there for long does not begin to walk.
_FRESH_S = 0.4
#: No foot is wider (m); no leg, of who is known to show legs.
_BROAD_M, _BROAD_LEGS_M = 0.28, 0.2


class Pool(NamedTuple):
    """Bodies that have taken their feet, in one scan: what is the same in several hypotheses is worked out once.

    ``bodies`` (p,) of `state.BODY`; ``taken`` (p, 4): the first hypothesis in which each was the same before, both
    feet, and the one before in the pool that is of the same row; ``misses`` (p,) what `missed` finds of each; ``last``
    (n,) the last one of each row, -1: none.
    """

    bodies: Any
    taken: NDArray[np.int64]
    misses: Array
    last: NDArray[np.int64]


@njit(cache=True)
def adopt(
    bodies: Any,
    rows: NDArray[np.int64],
    columns: NDArray[np.int64],
    scan: ClusteredScan,
    free: NDArray[np.bool_],
    sight: Sight,
) -> None:
    """Let the clusters be the feet that ``columns`` (m,) say of the bodies ``rows`` (k,): 2i and 2i + 1 of row i.

    Of those that are ``free`` (m,); what is somebody's is so no more.
    """
    feet = _feet_of(columns, rows.size, free)
    for column in range(rows.size):
        a, b = feet[2 * column], feet[2 * column + 1]
        _take(bodies[rows[column]], a, b, scan, sight)


@njit(cache=True)
def adopt_from(
    parent: Any,
    first: NDArray[np.int64],
    bodies: Any,
    rows: NDArray[np.int64],
    columns: NDArray[np.int64],
    scan: ClusteredScan,
    free: NDArray[np.bool_],
    sight: Sight,
    seats: Any,
    pool: Pool,
    pooled: int,
) -> tuple[int, float]:
    """As `adopt`, from the bodies of the ``parent`` into ``bodies`` (n,), without doing the same twice in a scan.

    Whoever was the same (``first`` (n,): in that hypothesis) and has taken the same feet before is copied from the
    ``pool``, in which so many are ``pooled``: how many are now, and what `missed`, which takes ``seats``, finds of all.
    """
    there, known, misses, last = pool.bodies, pool.taken, pool.misses, pool.last
    feet, unseen = _feet_of(columns, rows.size, free), 0.0
    for column in range(rows.size):
        row, a, b = rows[column], feet[2 * column], feet[2 * column + 1]
        found = last[row]
        while found >= 0 and not (known[found, 0] == first[row] and known[found, 1] == a and known[found, 2] == b):
            found = known[found, 3]
        if found >= 0:
            bodies[row] = there[found]
            unseen += misses[found]
            continue
        bodies[row] = parent[row]
        _take(bodies[row], a, b, scan, sight)
        miss = missed(bodies[row], scan.t, sight, seats)
        unseen += miss
        if pooled < there.size:
            there[pooled], misses[pooled] = bodies[row], miss
            known[pooled, 0], known[pooled, 1], known[pooled, 2], known[pooled, 3] = first[row], a, b, last[row]
            last[row] = pooled
            pooled += 1
    return pooled, unseen


@njit(cache=True)
def _feet_of(columns: NDArray[np.int64], k: int, free: NDArray[np.bool_]) -> NDArray[np.int64]:
    """The clusters (2k,) that are the feet of k bodies, -1 where none is; what was ``free`` (m,) is so no more."""
    feet = np.full(2 * k, -1)
    for i in range(columns.size):
        if free[i] and 0 <= columns[i] < 2 * k:
            feet[columns[i]] = i
            free[i] = False
    return feet


@njit(cache=True)
def _take(body: Any, a: int, b: int, scan: ClusteredScan, sight: Sight) -> None:
    """The clusters a and b (-1: none) are the feet of the body."""
    clusters, of, marks, t = scan.clusters, scan.of, scan.marks, scan.t
    for i in (a, b):
        if i >= 0 and not clusters[i].cut:
            learn(body, marks[i, 0])
    one = clusters[a] if a >= 0 else scan.blank[0]
    two = clusters[b] if b >= 0 else scan.blank[0]
    leaves = (a < 0) != (b < 0) and out_of_reach(body, clusters[max(a, b)], t, sight)
    x, y, vx, vy, pp, pv, vv = body.x, body.y, body.vx, body.vy, body.pp, body.pv, body.vv
    update(
        body,
        one,
        a >= 0,
        of[a] if a >= 0 else -1,
        marks[a, 2] if a >= 0 else 0.0,
        two,
        b >= 0,
        of[b] if b >= 0 else -1,
        marks[b, 2] if b >= 0 else 0.0,
        (a < 0) != (b < 0) and together(body, clusters, max(a, b), t),
        scan.prints,
        t,
    )
    if leaves:
        body.x, body.y, body.vx, body.vy, body.pp, body.pv, body.vv = x, y, vx, vy, pp, pv, vv


@njit(cache=True)
def complete(bodies: Any, scan: ClusteredScan, free: NDArray[np.bool_], sight: Sight) -> None:
    """What the movers that are believed have left goes to those who are not yet, and then begins new ones."""
    clusters, of, prints, t, m = scan.clusters, scan.of, scan.prints, scan.t, scan.clusters.size
    scratch = np.empty(bodies.size, np.int64)
    k = chosen(bodies, 0, scratch)
    rows = scratch[:k]
    if k:
        columns = np.full(m, -1)
        if m:
            cost = np.empty((m, 2 * k + m))
            costs(scan, free, bodies, rows, cost)
            assign(cost, 2 * k, UNLIKELY, columns)
        adopt(bodies, rows, columns, scan, free, sight)
    for i in range(m):
        c = clusters[i]
        if (
            not free[i]
            or narrow(c)
            or c.attached
            or (of[i] >= 0 and t - prints[of[i]].first > _FRESH_S)
            or _crowded(c, bodies)
        ):
            continue
        for b in range(bodies.size):
            if not bodies[b].used:
                begin(bodies[b], c, of[i], t)
                if _pushed(c, bodies, t):
                    bodies[b].from_furniture = 1
                break
    expect(bodies, t, sight)


@njit(cache=True)
def chosen(bodies: Any, confirmed: int, rows: NDArray[np.int64]) -> int:
    """Fill ``rows`` (n,) with the bodies that are ``confirmed`` (1) or not yet (0): how many there are."""
    count = 0
    for b in range(bodies.size):
        if bodies[b].used and bodies[b].confirmed == confirmed:
            rows[count] = b
            count += 1
    return count


@njit(cache=True)
def _crowded(c: Any, bodies: Any) -> bool:
    """Whether somebody's foot is so near that this is hardly another body."""
    for b in range(bodies.size):
        body = bodies[b]
        if body.used and min(norm(body.ax - c.x, body.ay - c.y), norm(body.bx - c.x, body.by - c.y)) < 0.22:
            return True
        # Legs that are one thing to the laser fall apart now and then.
        if body.used and body.confirmed and norm(body.x - c.x, body.y - c.y) < 0.12 + 0.5 * body.width:
            return True
    return False


@njit(cache=True)
def _pushed(c: Any, bodies: Any, t: float) -> bool:
    """Whether what begins is too wide for a foot and a person stands beside it."""
    for b in range(bodies.size):
        body = bodies[b]
        person = is_person(body) and t - body.seen < 0.5
        near = person and norm(body.x - c.x, body.y - c.y) < 0.7 + 0.5 * c.width
        if near and (c.width > _BROAD_M or (c.width > _BROAD_LEGS_M and too_wide(body, c) > 0.0)):
            return True
    return False
