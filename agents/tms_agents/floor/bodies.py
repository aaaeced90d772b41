"""Bodies: a Kalman filter that moves steadily, carried by two feet that stand, step, and are sometimes not seen."""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

Array = NDArray[np.float64]

#: Acceleration noise (m²/s³) and how fast the memory of a velocity fades while nothing is seen (s).
_ACCELERATION, _COAST_S = 1.2, 0.8
#: A foot stays where it stands within this (m), a step lands near the body within that (m).
_STAND_M, _STEP_M, _BODY_M, _REACH_M = 0.06, 0.26, 0.42, 0.8
#: Time for which a new print counts as a fresh step (s).
_FRESH_S = 1.0
#: Wider than two feet side by side (m): a robot or furniture.
WIDE_M = 0.33
UNLIKELY = 1e6


@njit(cache=True)
def predict(bodies: Any, t: float) -> None:
    """Move all bodies to the time t."""
    for b in range(bodies.size):
        body = bodies[b]
        if not body.used:
            continue
        dt = t - body.at
        if dt <= 0.0:
            continue
        body.at = t
        if body.stale:
            continue
        if t - body.seen > 0.35:
            fade = np.exp(-dt / _COAST_S)
            body.vx *= fade
            body.vy *= fade
        body.x += dt * body.vx
        body.y += dt * body.vy
        body.pp += 2.0 * dt * body.pv + dt * dt * body.vv + _ACCELERATION * dt**3 / 3.0
        body.pv += dt * body.vv + _ACCELERATION * dt * dt / 2.0
        body.vv += _ACCELERATION * dt
        body.pp = min(body.pp, 0.25)
        body.vv = min(body.vv, 2.0)
        body.pv = min(body.pv, 0.5)


@njit(cache=True)
def costs(
    clusters: Any,
    of: NDArray[np.int64],
    free: NDArray[np.bool_],
    prints: Any,
    bodies: Any,
    rows: NDArray[np.int64],
    t: float,
    cost: Array,
) -> None:
    """Negative log likelihoods (m, 2k) of each cluster (m,) being each of the two feet of the bodies ``rows`` (k,).

    A foot goes on standing where it stood, or it has stepped: then it lands near the body. Only a fresh print can be
    a step: what has stood there for long is no foot.
    """
    for k in range(clusters.size):
        c = clusters[k]
        for column in range(rows.size):
            body = bodies[rows[column]]
            cost[k, 2 * column] = UNLIKELY
            cost[k, 2 * column + 1] = UNLIKELY
            if not free[k]:
                continue
            away = np.hypot(c.x - body.x, c.y - body.y)
            reach = _REACH_M + 1.5 * np.sqrt(body.pp)
            if away > reach:
                continue
            if body.robot or body.wide > 0.6:
                narrow = 2.0 if c.width < 0.5 * body.far else 0.0
                cost[k, 2 * column] = 0.5 * (away / 0.3) ** 2 + narrow
                continue
            q = prints[of[k]] if of[k] >= 0 else prints[0]
            fresh = of[k] < 0 or t - q.first < _FRESH_S
            spread = body.pp
            base = 0.5 * away * away / (_BODY_M * _BODY_M + spread)
            if c.width > WIDE_M:
                base += 2.0
            step_x = c.x - body.x - 0.12 * body.vx
            step_y = c.y - body.y - 0.12 * body.vy
            step = 0.5 * (step_x**2 + step_y**2) / (_STEP_M**2 + spread) + 2.2
            if t - q.first > 0.5:
                step += 1.0
            for foot in range(2):
                fx, fy = (body.ax, body.ay) if foot == 0 else (body.bx, body.by)
                standing = body.a_print if foot == 0 else body.b_print
                seen = body.a_seen if foot == 0 else body.b_seen
                value = UNLIKELY
                if standing >= 0 and standing == of[k]:
                    # Movers take what is fresh before what has lain there for long.
                    value = 2.0 * min(max(t - q.first - 1.0, 0.0), 1.0)
                elif t - seen < 1.0:
                    value = 0.5 * ((c.x - fx) ** 2 + (c.y - fy) ** 2) / _STAND_M**2
                if fresh or q.owner == rows[column]:
                    value = min(value, step)
                if value + base < 9.0:
                    cost[k, 2 * column + foot] = value + base


@njit(cache=True)
def begin(body: Any, c: Any, print_index: int, t: float) -> None:
    """A new tentative body at the cluster c."""
    body.used, body.confirmed, body.label, body.robot, body.stale = 1, 0, -1, 0, 0
    body.x, body.y, body.vx, body.vy = c.x, c.y, 0.0, 0.0
    body.pp, body.pv, body.vv = 0.04, 0.0, 0.8
    body.at, body.first, body.seen = t, t, t
    body.hits, body.looks, body.both = 1, 1, 0
    body.x0, body.y0 = c.x, c.y
    body.width = c.width
    body.wide = 1.0 if c.width > WIDE_M else 0.0
    body.far = c.width
    body.ax, body.ay, body.a_seen, body.a_since, body.a_print = c.x, c.y, t, t, print_index
    body.bx, body.by, body.b_seen, body.b_since, body.b_print = c.x, c.y, -1e9, t, -1
    body.told_at = -1e9
    body.from_furniture = 0
    body.clear = 0.0


@njit(cache=True)
def update(
    body: Any, c: Any, has_c: bool, c_print: int, d: Any, has_d: bool, d_print: int, prints: Any, t: float
) -> None:
    """The body was seen: its first foot is the cluster c, its second d, each where there is one."""
    if has_c and has_d and np.hypot(c.x - d.x, c.y - d.y) > 1.1:
        # No step is so long: the foot that stood for longer is something else.
        if prints[c_print].first < prints[d_print].first:
            has_c = False
        else:
            has_d = False
    weight, x, y = 0.0, 0.0, 0.0
    if has_c:
        since = prints[c_print].first if c_print >= 0 else t
        w = 1.0 / (1.0 + ((t - since) / 0.5) ** 2) + 0.05
        weight += w
        x += w * c.x
        y += w * c.y
        body.ax, body.ay, body.a_seen, body.a_print, body.a_since = c.x, c.y, t, c_print, since
    elif body.a_print >= 0 and not prints[body.a_print].used:
        body.a_print = -1
    if has_d:
        since = prints[d_print].first if d_print >= 0 else t
        w = 1.0 / (1.0 + ((t - since) / 0.5) ** 2) + 0.05
        weight += w
        x += w * d.x
        y += w * d.y
        body.bx, body.by, body.b_seen, body.b_print, body.b_since = d.x, d.y, t, d_print, since
    elif body.b_print >= 0 and not prints[body.b_print].used:
        body.b_print = -1
    body.looks += 1
    if weight == 0.0:
        return
    body.hits += 1
    body.seen = t
    body.clear = 0.0
    both = has_c and has_d
    if both:
        body.both += 1
    x, y = x / weight, y / weight
    width = max(c.width if has_c else 0.0, d.width if has_d else 0.0)
    body.wide += 0.05 * ((1.0 if width > WIDE_M else 0.0) - body.wide)
    body.width += 0.1 * (width - body.width)
    body.far = max(body.far, width) if body.hits > 3 else width
    noise = 0.05 if body.robot else (0.03 if both else 0.09)
    s = body.pp + noise
    kp, kv = body.pp / s, body.pv / s
    ex, ey = x - body.x, y - body.y
    body.x += kp * ex
    body.y += kp * ey
    body.vx += kv * ex
    body.vy += kv * ey
    body.vv -= kv * body.pv
    body.pv -= kp * body.pv
    body.pp -= kp * body.pp
    # Nobody runs here: a jump is a wrong foot, not a speed.
    speed = np.hypot(body.vx, body.vy)
    if speed > 2.2:
        body.vx *= 2.2 / speed
        body.vy *= 2.2 / speed
