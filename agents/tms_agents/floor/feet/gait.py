"""Where the body is over its feet: between two that stand, ahead of one that lags, behind one that has just landed.

The numbers are regressions of the middle of the body on its feet over people who walk, stop and turn at will
(simulated, with the residuals given as noise); that the body is half a step behind a foot that lands, and that a foot
swings 2.6 times as fast as the body goes, is the arithmetic of a gait with 60 % stance.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit

from tms_agents.floor.feet.build import SHOES, beat, from_side
from tms_agents.floor.norm import norm
from tms_agents.floor.state import NEVER

#: A foot that moved by so much (m) since the last scan swings; a stance elsewhere than the last (m) is another one.
_SWING_M, _STANCE_M = 0.05, 0.12
#: A shoe seems to move so far (m) when it rolls off, at most; what was on the floor so lately (s) has not landed anew.
_ROLL_M, _ROLLS_M, _UP_S = 0.17, 0.3, 0.25
#: Who walks has put down the other shoe after this (s); who has not, stops.
_STEP_S, _STOPS_S = 0.5, 0.55
#: Nobody stands with his shoes farther apart (m): the older one is a thing he has left.
_ASTRIDE_M = 0.8
#: Nor does he lift the one that is so far ahead (m) while the other has stood for so long (s).
_BEHIND_M, _LONG_S = 0.6, 1.0
NOTHING = (0.0, 0.0, np.inf, 0.0, 0.0, np.inf)


@njit(cache=True)
def swap(body: Any) -> None:
    """Exchange the feet."""
    body.ax, body.bx = body.bx, body.ax
    body.ay, body.by = body.by, body.ay
    body.a_seen, body.b_seen = body.b_seen, body.a_seen
    body.a_since, body.b_since = body.b_since, body.a_since
    body.a_print, body.b_print = body.b_print, body.a_print
    body.a_vx, body.b_vx = body.b_vx, body.a_vx
    body.a_vy, body.b_vy = body.b_vy, body.a_vy
    body.a_px, body.b_px = body.b_px, body.a_px
    body.a_py, body.b_py = body.b_py, body.a_py
    body.a_ox, body.b_ox = body.b_ox, body.a_ox
    body.a_oy, body.b_oy = body.b_oy, body.a_oy
    body.a_land, body.b_land = body.b_land, body.a_land
    body.a_stood, body.b_stood = body.b_stood, body.a_stood
    body.a_late, body.b_late = body.b_late, body.a_late
    body.side = -body.side


@njit(cache=True)
def foot(body: Any, c: Any, late: float, c_print: int, prints: Any, t: float) -> None:
    """The first foot was seen ``late`` s into the sweep that began at t: it stands, has landed, or swings."""
    since = prints[c_print].first if c_print >= 0 else t
    stays = c_print >= 0 and c_print == body.a_print and prints[c_print].rested <= body.a_stood
    dt = t - body.a_seen
    body.a_vx, body.a_vy = 0.0, 0.0
    swings = False
    if 0.0 < dt < 0.3:
        moved = norm(c.x - body.ax, c.y - body.ay)
        if moved > _SWING_M:
            took = max(dt + late - body.a_late, 0.5 * dt)
            body.a_vx, body.a_vy = (c.x - body.ax) / took, (c.y - body.ay) / took
            # Of a shoe only what is on the floor is seen: it rolls off from the heel to the toes.
            swings = c_print != body.a_print and t - since < 0.05 and body.shoe < SHOES
    body.ax, body.ay, body.a_seen, body.a_print, body.a_since = c.x, c.y, t, c_print, since
    body.a_late = late
    if body.shoe >= SHOES and from_side(c):
        body.ex, body.ey, body.e_at = c.ex, c.ey, t
    if swings:
        return
    elsewhere = _STANCE_M
    if body.shoe >= SHOES:
        elsewhere = _ROLL_M if t - body.a_stood > _UP_S else _ROLLS_M
    anew = norm(c.x - body.a_px, c.y - body.a_py) > elsewhere or t - body.a_stood > 2.0
    if anew and not stays:
        beat(body, body.a_stood - body.a_land, since - body.a_stood)
        body.a_ox, body.a_oy = body.a_px, body.a_py
        body.a_px, body.a_py = c.x, c.y
        body.a_land = since if t - since < 0.5 or body.a_stood <= NEVER else t
    else:
        body.a_px += 0.4 * (c.x - body.a_px)
        body.a_py += 0.4 * (c.y - body.a_py)
    body.a_stood = t


@njit(cache=True)
def middle(body: Any, t: float) -> tuple[float, float, float, float, float, float]:
    """What the feet tell of the body at t: (x, y, variance) m and (vx, vy, variance) m/s; infinite: nothing."""
    a, b = body.a_seen == t, body.b_seen == t
    if not a and not b:
        return NOTHING
    a_stands, b_stands = a and body.a_stood == t, b and body.b_stood == t
    if a_stands and b_stands:
        return _astride(body, t)
    if a_stands:
        if b:
            up = t - body.b_stood
            sx, sy = body.bx - body.b_late * body.b_vx, body.by - body.b_late * body.b_vy
            return _passing(body.a_px, body.a_py, sx, sy, body.b_vx, body.b_vy, up, 0.1)
        return _alone(body, t)
    if b_stands:
        swap(body)
        found = middle(body, t)
        swap(body)
        return found
    if a and b:
        return 0.5 * (body.ax + body.bx), 0.5 * (body.ay + body.by), 0.2**2, 0.0, 0.0, np.inf
    if b:
        swap(body)
        found = middle(body, t)
        swap(body)
        return found
    if t - body.b_stood < 0.7:
        up = t - body.a_stood
        sx, sy = body.ax - body.a_late * body.a_vx, body.ay - body.a_late * body.a_vy
        return _passing(body.b_px, body.b_py, sx, sy, body.a_vx, body.a_vy, up, 0.16)
    return body.ax, body.ay, 0.25**2, 0.0, 0.0, np.inf


@njit(cache=True)
def _astride(body: Any, t: float) -> tuple[float, float, float, float, float, float]:
    """Both feet stand."""
    later = body.a_land >= body.b_land
    if later:
        qx, qy, px, py, ox, oy, age = body.a_px, body.a_py, body.b_px, body.b_py, body.a_ox, body.a_oy, t - body.a_land
    else:
        qx, qy, px, py, ox, oy, age = body.b_px, body.b_py, body.a_px, body.a_py, body.b_ox, body.b_oy, t - body.b_land
    dx, dy = qx - px, qy - py
    shoes = body.shoe >= SHOES
    if age < (0.25 if shoes else 0.3):
        share = -0.32 + 1.1 * age if shoes else -0.4 + 0.8 * age
        noise = 0.08 + 0.2 * age
        vx, vy, slow = _going(body, dx, dy, qx - ox, qy - oy, t)
        return qx + share * dx, qy + share * dy, noise * noise, vx, vy, slow
    if shoes and norm(dx, dy) > _ASTRIDE_M:
        return qx, qy, 0.15**2, 0.0, 0.0, np.inf
    noise = max(0.05, 0.17 - 0.1 * (age - 0.3))
    share = -0.3 if shoes and age < 0.45 else -0.5
    return qx + share * dx, qy + share * dy, noise * noise, 0.0, 0.0, 0.4**2


@njit(cache=True)
def _going(body: Any, dx: float, dy: float, ox: float, oy: float, t: float) -> tuple[float, float, float]:
    """Velocity (m/s) and its variance by the step (dx, dy) to the other foot and the stride (ox, oy) of this one."""
    if norm(ox, oy) > 1.8:
        return 1.4 * dx, 1.4 * dy, 0.5**2
    vx, vy = 0.83 * dx + 0.3 * ox, 0.83 * dy + 0.3 * oy
    if body.e_at == t:
        # A shoe points where he goes, or back: the line on which it lies tells no more.
        ahead = 0.42 if vx * body.ex + vy * body.ey > 0.0 else -0.42
        return 0.32 * dx + 0.3 * ox + ahead * body.ex, 0.32 * dy + 0.3 * oy + ahead * body.ey, 0.25**2
    return vx, vy, 0.35**2


@njit(cache=True)
def _passing(
    qx: float, qy: float, sx: float, sy: float, u: float, v: float, up: float, noise: float
) -> tuple[float, float, float, float, float, float]:
    """One foot stands at (qx, qy), the other swings for ``up`` s, now at (sx, sy) with (u, v)."""
    share = 0.16 + 1.5 * max(up, 0.1) if up < 0.3 else min(0.61 + 0.6 * (up - 0.3), 0.75)
    lead = max(0.0, 0.13 - 0.45 * up)
    dx, dy = sx - qx, sy - qy
    x, y = qx + share * dx + lead * u, qy + share * dy + lead * v
    if up < 0.15 or up > 0.7:
        return x, y, noise * noise, 0.0, 0.0, np.inf
    fast, far = max(0.3 - (up - 0.2), 0.18), min(0.13 + 3.5 * (up - 0.2), 0.67)
    slow = 0.25 + max(0.0, 0.6 * (0.3 - up)) + max(0.0, up - 0.4)
    return x, y, noise * noise, fast * u + far * dx, fast * v + far * dy, slow * slow


@njit(cache=True)
def _alone(body: Any, t: float) -> tuple[float, float, float, float, float, float]:
    """The first foot stands, the other is not seen: lifted (above the plane) or hidden."""
    age, gone = t - body.a_land, t - body.b_stood
    dx, dy = body.a_px - body.b_px, body.a_py - body.b_py
    if gone > 1.5 or norm(dx, dy) > 1.2:
        # Both legs may be one thing to the laser: it goes as the body goes.
        return body.ax, body.ay, 0.1**2, 0.0, 0.0, np.inf
    if body.a_land < body.b_land:
        if body.shoe >= SHOES and norm(dx, dy) > _BEHIND_M and age > _LONG_S:
            return body.x, body.y, np.inf, 0.0, 0.0, np.inf
        # The other had landed later and is up again: this one may be a foot that waits.
        back = 0.12 if body.shoe >= SHOES else 0.3
        return body.a_px - back * dx, body.a_py - back * dy, 0.18**2, 0.0, 0.0, np.inf
    share, noise = min(-0.36 + 1.05 * age, 0.15), 0.08 + 0.3 * age
    vx, vy, slow = 0.0, 0.0, np.inf
    if body.shoe >= SHOES:
        share = min(-0.33 + age, 0.02) if age < _STEP_S else -0.1
        if age > _STOPS_S:
            noise, slow = 0.2, 0.5**2
    if age < 0.4:
        vx, vy, slow = _going(body, dx, dy, body.a_px - body.a_ox, body.a_py - body.a_oy, t)
        slow *= 1.0 + 4.0 * age
    return body.a_px + share * dx, body.a_py + share * dy, noise * noise, vx, vy, slow
