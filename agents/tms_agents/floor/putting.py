"""What appears beside somebody who stands on both feet was put there by hand: it is nobody's foot."""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from tms_agents.floor.segmentation import CLUSTER

#: Feet stand when their prints are so old (s); a print is new for so long (s).
_STANDS_S, _NEW_S = 0.4, 0.15
#: A hand puts things between these distances from the middle between the feet (m): nearer is a step; and so far off
#: either foot.
_STEP_M, _REACH_M, _BESIDE_M = 0.3, 0.85, 0.16
#: Somebody else so near (m) may have stepped there.
_OTHER_M = 1.0


@njit(cache=True)
def _put(c: Any, print_: Any, prints: Any, bodies: Any, t: float) -> bool:
    """Whether the cluster with the new print lies there because one of the bodies (n,) has put it there."""
    giver = -1
    for b in range(bodies.size):
        body = bodies[b]
        if not body.used or (body.stale and t - body.seen > 10.0):
            continue
        away = np.hypot(c.x - body.x, c.y - body.y)
        stands = (
            body.confirmed
            and not body.robot
            and body.a_print >= 0
            and body.b_print >= 0
            and body.a_print != body.b_print
            and prints[body.a_print].last == t
            and prints[body.b_print].last == t
            and t - max(prints[body.a_print].first, prints[body.b_print].first) > _STANDS_S
        )
        if stands and away < _REACH_M:
            near = min(np.hypot(c.x - body.ax, c.y - body.ay), np.hypot(c.x - body.bx, c.y - body.by))
            if away < _STEP_M or near < _BESIDE_M + 0.5 * print_.width:
                return False
            giver = b
        elif away < _OTHER_M:
            return False
    return giver >= 0


@njit(cache=True)
def _set_aside(
    clusters: Any, of: NDArray[np.int64], prints: Any, bodies: Any, width_m: float, t: float, scratch: Any
) -> int:
    feet: int = clusters.size
    k = 0
    while k < feet:
        given = False
        if of[k] >= 0:
            q = prints[of[k]]
            if q.hits == 1:
                q.given = 0
            new = t - q.first <= _NEW_S and q.owner < 0 and q.hits < 3 and clusters[k].width < width_m
            if new and not q.given and _put(clusters[k], q, prints, bodies, t):
                q.given = 1
            given = q.given == 1
        if not given:
            k += 1
            continue
        feet -= 1
        scratch[0] = clusters[k]
        clusters[k] = clusters[feet]
        clusters[feet] = scratch[0]
        of[k], of[feet] = of[feet], of[k]
    return feet


_SCRATCH = np.zeros(1, CLUSTER)


def set_aside(clusters: Any, of: NDArray[np.int64], prints: Any, bodies: Any, width_m: float, t: float) -> int:
    """Move what may be feet to the front of ``clusters`` (m,) and ``of`` (m,), their prints; how many these are."""
    count: int = _set_aside(clusters, of, prints, bodies, width_m, t, _SCRATCH)
    return count
