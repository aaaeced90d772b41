"""Nobody has three feet: what appears or lies beside somebody both of whose feet are seen is a thing.

Nor is it a foot what flickers at the edge of a thing, now here, now there, as if it were put down anew.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from tms_agents.floor.feet.bodies import narrow
from tms_agents.floor.feet.build import any_shoe
from tms_agents.floor.norm import norm
from tms_agents.floor.scan.segmentation import CLUSTER

#: Feet stand when their prints are so old (s); a print is new for so long (s).
_STANDS_S, _NEW_S = 0.4, 0.15
#: A hand puts things between these distances from the middle between the feet (m): nearer is a step; and so far off
#: either foot.
_STEP_M, _REACH_M, _BESIDE_M = 0.3, 0.85, 0.16
#: What is nearer may be a part of the foot, of which other parts are dark: time counts less, down to this (m).
_CLOSE_M, _SLOWER = 0.08, 0.25
#: Somebody else so near (m) may have stepped there.
_OTHER_M = 1.0
#: So far (m) from a robot nothing is a part of it.
_ROBOT_M = 0.2
#: What lay there for so long (s) before somebody was hidden, who had shown both feet so shortly (s) before, is not his.
_LAY_S, _LAST_S = 1.0, 0.45
#: Two feet are between these distances from each other (m).
_FEET_M = (0.06, 0.7)
#: A print so near (m) may be the other foot of somebody who is not known yet.
_PAIR_M = 0.45
#: The next step comes so soon (s) after the one before, and so far (m) from it; what is slimmer (m), all of it in view,
#: is no foot.
_NEXT_S, _NEXT_M, _SLIM_M = 1.5, (0.2, 1.2), 0.07
#: What has been nobody's for so long (s), and for such a share of the time, is a thing if it is so wide (m) at most.
_IDLE_S, _IDLE, _THING_M = 3.0, 0.7, 0.25
#: What flickers at its edge is so wide (m) at most, and so near it (m).
_SPECK_M, _EDGE_M = 0.09, 0.03


@njit(cache=True)
def _put(c: Any, j: int, prints: Any, bodies: Any, t: float) -> bool:
    """Whether the cluster with the new print j lies there because one of the bodies (n,) has put it there."""
    giver = -1
    for b in range(bodies.size):
        body = bodies[b]
        if not body.used or (body.stale and t - body.seen > 10.0) or _is_he(body, j):
            continue
        away = norm(c.x - body.x, c.y - body.y)
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
        if stands:
            near = min(norm(c.x - body.ax, c.y - body.ay), norm(c.x - body.bx, c.y - body.by))
            if away < _STEP_M or near < _BESIDE_M + 0.5 * prints[j].width:
                return False
            # Who stands farther off has not put it there, but not stepped there either.
            if away < _REACH_M:
                giver = b
        elif away < _OTHER_M:
            return False
    return giver >= 0


@njit(cache=True)
def _walks(c: Any, j: int, prints: Any, t: float) -> bool:
    """Whether the cluster with the new print j is the next step of somebody unknown, after one that is nobody's.

    No hand puts two things down so fast and so far apart. What was taken for a thing may be a foot again. It is so of
    shoes: a leg is seen all the way from one step to the next.
    """
    if narrow(c):
        return False
    walks = False
    for i in range(prints.size):
        q = prints[i]
        new = i != j and q.used and q.whose < 0 and t - q.rested < _NEXT_S
        slim = q.whole == q.hits and q.width < _SLIM_M
        if new and not slim and _NEXT_M[0] < norm(c.x - q.x, c.y - q.y) < _NEXT_M[1]:
            q.given, walks = 0, True
    return walks


@njit(cache=True)
def _is_he(body: Any, j: int) -> bool:
    """Whether the body is somebody new who began with the print j and is nothing else: he tells nothing of it."""
    return bool(not body.confirmed and body.a_print == j and body.b_print < 0)


@njit(cache=True)
def count_feet(prints: Any, bodies: Any, t: float, dt: float) -> None:
    """Count in ``spare`` for how long (s) nobody's prints were seen while all near them showed both feet elsewhere."""
    for j in range(prints.size):
        q = prints[j]
        if not q.used:
            continue
        if q.first == q.last or q.owner >= 0:
            q.spare = 0.0
            continue
        if q.last != t:
            continue
        shown, close = False, False
        for b in range(bodies.size):
            body = bodies[b]
            away = norm(body.x - q.x, body.y - q.y)
            if not body.used or away > _OTHER_M or (body.stale and t - body.seen > 10.0) or _is_he(body, j):
                continue
            if body.robot and not body.stale and away > 0.5 * (body.far + q.width) + _ROBOT_M:
                continue
            near = min(norm(body.ax - q.x, body.ay - q.y), norm(body.bx - q.x, body.by - q.y))
            shown = _shows_both(body, q, t) and near > _CLOSE_M + 0.5 * q.width
            close = close or near < _BESIDE_M + 0.5 * q.width
            if not shown:
                break
        if shown:
            for o in range(prints.size):
                p = prints[o]
                pair = o != j and p.used and p.owner < 0 and not p.revealed and t - p.last < 0.3
                if pair and norm(p.x - q.x, p.y - q.y) < _PAIR_M:
                    shown = False
                    break
        if shown:
            q.spare += _SLOWER * dt if close else dt


@njit(cache=True)
def _shows_both(body: Any, q: Any, t: float) -> bool:
    """Whether somebody shows both feet now, or did when he was seen last and the print already lay there."""
    at, new = t, _NEW_S
    if body.stale:
        if q.first > body.seen - _LAY_S:
            return False
        at, new = body.seen, _LAST_S
    apart = norm(body.ax - body.bx, body.ay - body.by)
    person = body.confirmed and not body.robot and body.a_print != body.b_print
    return bool(person and at - min(body.a_seen, body.b_seen) < new and _FEET_M[0] < apart < _FEET_M[1])


@njit(cache=True)
def _is_edge(c: Any, print_: int, prints: Any, t: float) -> bool:
    """Whether the cluster is what flickers at the edge of something that has been nobody's foot for long."""
    for j in range(prints.size):
        q = prints[j]
        if j == print_ or not q.used or t - q.last > _NEW_S or q.width > _THING_M:
            continue
        beside = norm(c.x - q.x, c.y - q.y) < 0.5 * (q.width + c.width) + _EDGE_M
        if beside and q.idle > max(_IDLE_S, _IDLE * (t - q.rested)):
            return True
    return False


@njit(cache=True)
def _set_aside(
    clusters: Any, of: NDArray[np.int64], prints: Any, bodies: Any, width_m: float, t: float, scratch: Any
) -> int:
    feet: int = clusters.size
    k = 0
    while k < feet:
        thing = clusters[k].width < _SPECK_M and _is_edge(clusters[k], of[k], prints, t)
        if of[k] >= 0 and not thing:
            q = prints[of[k]]
            if q.hits == 1:
                q.given = 0
            new = t - q.first <= _NEW_S and q.owner < 0 and q.hits < 3 and clusters[k].width < width_m
            if new and not q.given and _put(clusters[k], of[k], prints, bodies, t):
                q.given = not (any_shoe(bodies) and _walks(clusters[k], of[k], prints, t))
            thing = q.given == 1
        if not thing:
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
