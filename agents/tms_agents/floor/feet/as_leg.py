"""How likely a cluster is to be somebody's leg: one that stands, swings, or is put down a stride ahead."""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit

from tms_agents.floor.feet.bodies import STAND_M
from tms_agents.floor.feet.fitted import Legs
from tms_agents.floor.feet.one_foot import Candidate, OneFoot, alone, apart, beside, stands
from tms_agents.floor.norm import norm


@njit(cache=True, inline="always")
def as_leg(legs: Legs, body: Any, speed: float, c: Any, foot: OneFoot, one: Candidate, t: float) -> float:
    """Negative log likelihood of the cluster c being this leg of a body that goes so fast (m/s)."""
    gap = t - foot.seen
    off = (c.x - foot.x) ** 2 + (c.y - foot.y) ** 2
    lost = not (gap < 1.0 or body.stale)
    value = stands(foot, one, off, STAND_M, legs.moved, legs.left, lost)
    if gap < 0.35:
        swing = one.base + _swinging(c.x - foot.x, c.y - foot.y, foot.u, foot.v, body, speed, gap, legs)
        if foot.other_swings > 0.5 and t - foot.other_seen < 0.22:
            swing += legs.both
        value = min(value, swing)
    value += alone(foot, one, c, t)
    step = one.anywhere
    if gap < 0.22 and not foot.left:
        # Seen just now, it cannot be far, unless it was something that was left behind.
        step += legs.seen + 0.5 * (max(0.0, np.sqrt(off) - 0.15 - 3.0 * gap) / legs.seen_m) ** 2
    elif gap > 1.0 and not foot.left:
        # It must be somewhere.
        step -= legs.lost
    if foot.left:
        step = min(step, beside(foot, c, legs.beside_m, legs.beside))
    if one.age > gap + 0.15 and not one.lately:
        # Whatever stands here came while this foot was somewhere else.
        step += legs.stolen
    if one.strange:
        # What has stood there for long is hardly a foot, except that of somebody who stands.
        return min(value, step + legs.rested)
    value = min(value, step)
    if speed > 0.35 and gap < 1.3 and t - foot.other_seen < 0.4:
        stride = _strides_on(c.x - foot.other_x, c.y - foot.other_y, body, speed, foot.side, legs)
        value = min(value, stride + step - one.anywhere)
    return value


@njit(cache=True)
def _strides_on(dx: float, dy: float, body: Any, speed: float, side: float, legs: Legs) -> float:
    """Negative log likelihood of a leg put (dx, dy) from the other: a stride ahead and on its own side."""
    ux, uy = body.vx / speed, body.vy / speed
    ahead, aside = dx * ux + dy * uy - body.stride, dy * ux - dx * uy - side
    along, across = legs.stride_m**2 + 0.2 * body.pp, legs.stride_aside_m**2 + 0.2 * body.pp
    return float(0.5 * (ahead**2 / along + aside**2 / across) + legs.strides)


@njit(cache=True)
def _swinging(dx: float, dy: float, u: float, v: float, body: Any, speed: float, dt: float, legs: Legs) -> float:
    """The same of one that has moved by (dx, dy) in dt s: it goes straight on (u, v m/s), or begins to swing."""
    pace = norm(u, v)
    if pace > 0.4:
        along, aside = (dx * u + dy * v) / pace, (dy * u - dx * v) / pace
        over = max(-along, along - pace * dt - 2.5 * dt, 0.0)
        wide = legs.swings_aside_m + legs.swings_aside_mps * dt
        return float(0.5 * (aside / wide) ** 2 + 0.5 * (over / legs.beyond_m) ** 2 + legs.goes_on)
    reach = 3.0 * max(speed, 0.4) * dt
    if speed > 0.3:
        ux, uy = body.vx / speed, body.vy / speed
        along = min(max(dx * ux + dy * uy, 0.0), reach)
        dx, dy = dx - along * ux, dy - along * uy
    else:
        away = norm(dx, dy)
        share = max(away - reach, 0.0) / max(away, 1e-6)
        dx, dy = dx * share, dy * share
    return float(0.5 * (dx * dx + dy * dy) / legs.begins_m**2 + legs.begins)


@njit(cache=True)
def anywhere(c: Any, body: Any, speed: float, age: float, legs: Legs) -> float:
    """The same of a leg put down anywhere near, of what has stood there for so long (``age``, s)."""
    dx, dy = c.x - body.x, c.y - body.y
    ahead_x, ahead_y = legs.ahead_s * body.vx, legs.ahead_s * body.vy
    value = apart(dx - ahead_x, dy - ahead_y, body, speed, legs.ahead_m, legs.ahead_aside_m) + legs.anywhere
    value = min(value, 0.5 * (dx * dx + dy * dy) / (legs.around_m**2 + body.pp) + legs.around)
    return float(value + (legs.stood if age > 0.5 else 0.0))
