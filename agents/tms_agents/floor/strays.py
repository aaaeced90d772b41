"""A thing put down beside somebody who stands may be taken for his other foot while one leg hides the other: until it
turns out to be as wide as no foot of his, or too far off to stand on."""

from __future__ import annotations

from typing import Any

from numba import njit

from tms_agents.floor.build import SHOES
from tms_agents.floor.gait import swap
from tms_agents.floor.norm import norm
from tms_agents.floor.prints import unlike_foot

#: Nobody stands with the shoes or the legs so far apart (m) for so long (s).
_SHOES_M, _LEGS_M, _ASTRIDE_S = 0.48, 0.4, 5.5
#: So far (m) from the other a foot is seen whole; it has stood for so long (s).
_APART_M, _STOOD_S = 0.33, 2.0
#: What has been nobody's for so long (s) is no foot rather than what came last.
_IDLE_S = 1.0
#: Two legs side by side, one thing to the laser, look wider (m) than one, and at most so wide.
_PAIR_M = (0.16, 0.3)


@njit(cache=True)
def _stray(body: Any, prints: Any, t: float) -> int:
    """Which foot is none: 1 the first, 2 the second, 0: both may be feet."""
    a, b = body.a_print, body.b_print
    if a < 0 or b < 0 or a == b or max(t - body.a_seen, t - body.b_seen) > 0.5:
        return 0
    p, q = prints[a], prints[b]
    stood = t - max(p.first, q.first)
    shod, apart = body.shoe >= SHOES, norm(body.ax - body.bx, body.ay - body.by)
    if stood > _STOOD_S and apart > _APART_M:
        first, second = unlike_foot(body, p), unlike_foot(body, q)
        if first != second:
            odd, other = (p, q) if first else (q, p)
            # Both legs stood there before the other came.
            both = not shod and _PAIR_M[0] < odd.width < _PAIR_M[1] and other.first - odd.first > _STOOD_S
            return 1 if first != both else 2
    if stood < _ASTRIDE_S or apart < (_SHOES_M if shod else _LEGS_M):
        return 0
    if max(p.idle, q.idle) > _IDLE_S:
        return 1 if p.idle > q.idle else 2
    return 1 if body.a_land > body.b_land else 2


@njit(cache=True)
def nobodys(q: Any, landed: float) -> int:
    """1 unless the print had been somebody else's foot all the time before a foot ``landed`` there."""
    return 0 if landed - q.first > _IDLE_S and q.idle < _IDLE_S else 1


@njit(cache=True)
def take(body: Any, q: Any) -> None:
    """The print is not the second foot of the body, which stands on the first alone."""
    q.given = nobodys(q, body.b_land)
    body.b_print, body.b_seen = -1, body.a_land
    body.bx, body.by = body.ax, body.ay
    body.x, body.y = body.ax, body.ay


@njit(cache=True)
def release(bodies: Any, prints: Any, t: float) -> int:
    """Take from those of ``bodies`` (n,) that stand on a thing, one of ``prints``, this foot; how many there are."""
    count = 0
    for b in range(bodies.size):
        body = bodies[b]
        if not body.used or not body.confirmed or body.robot or body.stale or body.wide > 0.6:
            continue
        stray = _stray(body, prints, t)
        if stray == 0:
            continue
        count += 1
        if stray == 1:
            swap(body)
        take(body, prints[body.b_print])
        if stray == 1:
            swap(body)
    return count
