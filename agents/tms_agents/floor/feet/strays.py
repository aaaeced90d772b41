"""A thing put down beside somebody who stands may be taken for his other foot while one leg hides the other: until it
turns out to be as wide as no foot of his, or too far off to stand on.

Who stands for a while draws in the foot he has put far from the other, or steps on. What stays there, and came long
after the other foot, was put down before him, if nothing shows that his foot has gone there.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from tms_agents.floor.feet.build import SHOD, SHOES
from tms_agents.floor.feet.gait import swap
from tms_agents.floor.feet.person import is_person
from tms_agents.floor.feet.prints import unlike_foot
from tms_agents.floor.norm import norm
from tms_agents.floor.scan.freespace import FREE, Sight, clear

Array = NDArray[np.float64]

#: Nobody stands with the shoes or the legs so far apart (m) for so long (s).
_SHOES_M, _LEGS_M, _ASTRIDE_S = 0.48, 0.4, 5.5
#: So far (m) from the other a foot is seen whole; it has stood for so long (s).
_APART_M, _STOOD_S = 0.33, 2.0
#: Nor so far apart for so long (s) if one came so much later (s) than the other. Feet are no nearer (m); who steps to a
#: print lands when it comes to rest (s).
_PUT_S, _LATER_S, _BESIDE_M, _LANDS_S = 10.0, 5.0, 0.06, 1.0
#: What has been nobody's for so long (s), and half of the time, is no foot rather than what came last.
_IDLE_S, _IDLE = 1.0, 0.5
#: A shoe from its side is wider (m) than a thing; what is so often (share) behind something new is his shoe: the thing
#: was put before it.
_SIDE_M, _BEHIND = 0.17, 0.8
#: Two legs side by side, one thing to the laser, look wider (m) than one, and at most so wide.
_PAIR_M = (0.16, 0.3)


@njit(cache=True)
def _stray(body: Any, prints: Any, t: float, shod: bool, sight: Sight) -> int:
    """Which foot is none: 1 the first, 2 the second, 0: both may be feet."""
    a, b = body.a_print, body.b_print
    if a < 0 or b < 0 or a == b or max(t - body.a_seen, t - body.b_seen) > 0.5:
        return 0
    p, q = prints[a], prints[b]
    stood = t - max(p.first, q.first)
    shoes, apart = body.shoe >= SHOES, norm(body.ax - body.bx, body.ay - body.by)
    if stood > _STOOD_S and apart > _APART_M:
        first, second = unlike_foot(body, p), unlike_foot(body, q)
        if first != second:
            odd, other = (p, q) if first else (q, p)
            # Both legs stood there before the other came.
            both = not shoes and _PAIR_M[0] < odd.width < _PAIR_M[1] and other.first - odd.first > _STOOD_S
            return 1 if first != both else 2
    # A foot that is lost sight of seems to land anew where it has stood all the time.
    a_came, b_came = min(body.a_land, p.rested), min(body.b_land, q.rested)
    put = stood > _PUT_S and apart > _APART_M and abs(a_came - b_came) > _LATER_S
    astride = stood > _ASTRIDE_S and apart > (_SHOES_M if shoes else _LEGS_M)
    if not put and not astride:
        return 0
    if _rather(p, q, a_came > b_came, t, shod):
        return 0 if not astride and _has_stepped(p, body.a_ox, body.a_oy, body.a_land, sight) else 1
    return 0 if not astride and _has_stepped(q, body.b_ox, body.b_oy, body.b_land, sight) else 2


@njit(cache=True)
def _has_stepped(q: Any, x: float, y: float, landed: float, sight: Sight) -> bool:
    """Whether the foot that ``landed`` on the print has gone from where it stood, (x, y) m, or has come back there."""
    back = norm(x - q.x, y - q.y) < _BESIDE_M and landed - q.rested < _LANDS_S
    return bool(back or clear(x, y, _BESIDE_M, sight) == FREE)


@njit(cache=True)
def _rather(p: Any, q: Any, later: bool, t: float, shod: bool) -> bool:
    """Whether the first print is none of his feet rather than the second, ``later``: it came later."""
    first, second = _lay_there(p, t), _lay_there(q, t)
    if first != second:
        return bool(first)
    behind, before = p.covered > _BEHIND * p.hits, q.covered > _BEHIND * q.hits
    if shod and behind != before and (p.width if before else q.width) < _SIDE_M:
        return bool(before)
    return later


@njit(cache=True)
def _lay_there(q: Any, t: float) -> bool:
    """Whether the print has been nobody's most of the time."""
    return bool(q.idle > max(_IDLE_S, _IDLE * (t - q.rested)))


@njit(cache=True)
def nobodys(q: Any, landed: float) -> int:
    """1: the print is a thing that was put down. 0: before this foot ``landed`` there it was somebody else's foot."""
    return 0 if landed - q.first > _IDLE_S and q.idle < _IDLE_S else 1


@njit(cache=True)
def take(body: Any, q: Any) -> None:
    """The print is not the second foot of the body: that is where it was before, or hidden behind the first."""
    q.given = nobodys(q, body.b_land)
    body.b_print, body.b_seen = -1, body.a_land
    if _BESIDE_M < norm(body.b_ox - body.ax, body.b_oy - body.ay) < _APART_M:
        body.bx, body.by = body.b_ox, body.b_oy
    else:
        body.bx, body.by = body.ax, body.ay
    body.x, body.y = 0.5 * (body.ax + body.bx), 0.5 * (body.ay + body.by)


@njit(cache=True)
def release(bodies: Any, prints: Any, t: float, shoes: Array, sight: Sight) -> int:
    """Take from those of ``bodies`` (n,) that stand on a thing, one of ``prints``, this foot; how many there are.

    ``shoes`` (2,) is what `build.count_shoes` has learned.
    """
    shod = shoes[0] > SHOD
    count = 0
    for b in range(bodies.size):
        body = bodies[b]
        if not is_person(body) or body.stale or body.wide > 0.6:
            continue
        stray = _stray(body, prints, t, shod, sight)
        if stray == 0:
            continue
        count += 1
        if stray == 1:
            swap(body)
        take(body, prints[body.b_print])
        if stray == 1:
            swap(body)
    return count
