"""What it costs an explanation of a scan that somebody who is there was not seen, or one of his legs."""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit

from tms_agents.floor.norm import norm
from tms_agents.floor.scan.freespace import FREE, HIDDEN, UNSEEN, WALLED, Sight, beam_of, clear
from tms_agents.floor.scan.masks import distance

#: Negative log likelihood of missing somebody in clear view in one scan.
_MISS = 2.0
#: The same of who is so near (m) a seat that he may just have sat down and lifted his feet.
_SITS, _NEAR_M = 0.3, 0.5
#: And of missing one leg of somebody who walks (m/s) for so long (s), seen so often, in this share on both legs.
_LIMP, _WALKS, _UP_S, _SEEN, _MOSTLY = 0.8, 0.4, 0.6, 20, 0.6

#: The foot that swings is so far (m) ahead of who goes so fast (m/s), and was seen so long (s) ago.
_AHEAD_M, _LEAVES, _SWINGS_S = 0.3, 0.5, 0.6


@njit(cache=True)
def missed(body: Any, t: float, sight: Sight, seats: Any) -> float:
    """Negative log likelihood of not having seen a mover, or a leg of it, that was in view.

    Less near ``seats``, as `masks.joined` gives them.
    """
    if body.seen < t and not body.stale and t - body.seen < 1.0:
        if clear(body.x, body.y, 0.12, sight) == FREE:
            return _SITS if _may_sit(body, seats) else _MISS
    elif body.seen == t and _limps(body, t):
        x, y = (body.ax, body.ay) if body.a_seen == t else (body.bx, body.by)
        x, y = 2.0 * body.x - x, 2.0 * body.y - y
        if clear(x, y, 0.1, sight) != HIDDEN:
            return _LIMP
    return 0.0


@njit(cache=True)
def _may_sit(body: Any, seats: Any) -> bool:
    """Whether the body, or the foot seen last, was so near a seat that the feet may have been lifted."""
    corners, sizes = seats
    x, y = (body.ax, body.ay) if body.a_seen > body.b_seen else (body.bx, body.by)
    start = 0
    for m in range(sizes.size):
        seat = corners[start : start + sizes[m]]
        if min(distance(seat, body.x, body.y), distance(seat, x, y)) < _NEAR_M:
            return True
        start += sizes[m]
    return False


@njit(cache=True)
def expect(bodies: Any, t: float, sight: Sight) -> None:
    """Count for all who are not believed yet in how many scans they were seen or should have been (due)."""
    ranges, _, _, pose, first, step = sight
    for b in range(bodies.size):
        body = bodies[b]
        if not body.used or body.confirmed:
            continue
        if body.seen < t:
            view = clear(body.x, body.y, 0.12, sight)
            turned = np.arctan2(body.y - pose[1], body.x - pose[0]) - pose[2]
            if view in (HIDDEN, WALLED) or np.isnan(beam_of(turned, first, step, ranges.size)):
                continue
        body.due += 1


@njit(cache=True)
def out_of_reach(body: Any, c: Any, t: float, sight: Sight) -> bool:
    """Whether the cluster is the rear foot of somebody who walks to where the laser does not reach.

    Then the filter must not be drawn back to it.
    """
    speed = norm(body.vx, body.vy)
    if body.robot or speed < _LEAVES or t - min(body.a_seen, body.b_seen) > _SWINGS_S:
        return False
    if (c.x - body.x) * body.vx + (c.y - body.y) * body.vy > 0.0:
        return False
    ahead = _AHEAD_M / speed
    x, y = body.x + ahead * body.vx, body.y + ahead * body.vy
    return clear(x, y, 0.05, sight) == UNSEEN


@njit(cache=True)
def _limps(body: Any, t: float) -> bool:
    """Whether somebody walks of whom both legs are seen mostly (a shoe is up half of the time), and now one is not."""
    if body.robot or body.wide > 0.3 or norm(body.vx, body.vy) < _WALKS:
        return False
    return bool(body.hits > _SEEN and body.both > _MOSTLY * body.hits and t - min(body.a_seen, body.b_seen) > _UP_S)
