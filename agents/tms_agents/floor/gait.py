"""Where the body is over its feet: between two that stand, ahead of one that lags, behind one that has just landed.

The numbers are regressions of the middle of the body on its feet over people who walk, stop and turn at will
(simulated, with the residuals given as noise); that the body is half a step behind a foot that lands, and that a foot
swings 2.6 times as fast as the body goes, is the arithmetic of a gait with 60 % stance.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

#: A foot that moved by so much (m) since the last scan swings; a stance elsewhere than the last (m) is another one.
_SWING_M, _STANCE_M = 0.05, 0.12
#: A shoe seems to move so far (m) when it rolls off. Of such a share of wide feet somebody's shoes are seen, not legs.
_ROLL_M, SHOES, _SHOE_M = 0.17, 0.3, (0.16, 0.34)
#: Legs are measured while somebody walks faster than this (m/s): nothing else does.
_WALKS = 0.4
#: Legs are expected as if so many had been seen; so many feet are remembered.
_EXPECTED, _LONG = 20.0, 1000.0
#: A foot stands and swings for so long (s) while somebody walks.
_STANCE_S, _SWING_S = (0.3, 1.1), (0.25, 0.75)
#: So many stances tell somebody's beat of late, and his own.
_PACE_MEMORY, _PACE_LIFE = 12, 80
#: So many sightings of legs tell how wide they are of late, and of the one who has the name.
_GIRTH_MEMORY, _GIRTH_LIFE = 300, 1000
#: Whose name is less sure does not change what is known of the name.
SURE = 0.6
#: Where shoes are seen, at least this share of all feet that walk is as wide as one (of legs it is 0.03 at most). Of
#: somebody alone (`shoe`) it is unlearned while he seems to stand on a narrow thing.
SHOD = 0.2
NOTHING = (0.0, 0.0, np.inf, 0.0, 0.0, np.inf)


def legs() -> NDArray[np.float64]:
    """What is known of feet before anybody was seen, as `count_shoes` learns it."""
    return np.array([0.0, _EXPECTED])


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
        moved = np.hypot(c.x - body.ax, c.y - body.ay)
        if moved > _SWING_M:
            took = max(dt + late - body.a_late, 0.5 * dt)
            body.a_vx, body.a_vy = (c.x - body.ax) / took, (c.y - body.ay) / took
            # Of a shoe only what is on the floor is seen: it rolls off from the heel to the toes.
            swings = c_print != body.a_print and t - since < 0.05 and body.shoe < SHOES
    body.ax, body.ay, body.a_seen, body.a_print, body.a_since = c.x, c.y, t, c_print, since
    body.a_late = late
    if swings:
        return
    elsewhere = _ROLL_M if body.shoe >= SHOES else _STANCE_M
    anew = np.hypot(c.x - body.a_px, c.y - body.a_py) > elsewhere or t - body.a_stood > 2.0
    if anew and not stays:
        beat(body, body.a_stood - body.a_land, since - body.a_stood)
        body.a_ox, body.a_oy = body.a_px, body.a_py
        body.a_px, body.a_py = c.x, c.y
        body.a_land = since if t - since < 0.5 or body.a_stood < 0.0 else t
    else:
        body.a_px += 0.4 * (c.x - body.a_px)
        body.a_py += 0.4 * (c.y - body.a_py)
    body.a_stood = t


@njit(cache=True)
def _mean(mean: float, count: int, value: float, most: int) -> tuple[float, int]:
    """The mean of so many values, and how many, with one more; it forgets after ``most``."""
    count = min(count + 1, most)
    return mean + (value - mean) / count, count


@njit(cache=True)
def beat(body: Any, stood: float, swung: float) -> None:
    """Learn from a stance of ``stood`` s, before a swing of ``swung`` s, at what beat the body walks."""
    if _STANCE_S[0] < stood < _STANCE_S[1] and _SWING_S[0] < swung < _SWING_S[1]:
        body.pace, body.pace_n = _mean(body.pace, body.pace_n, stood, _PACE_MEMORY)
        if body.sure < SURE:
            return
        body.own_pace, body.own_pace_n = _mean(body.own_pace, body.own_pace_n, stood, _PACE_LIFE)


@njit(cache=True)
def shod(body: Any, c: Any) -> None:
    """Learn from a foot whether shoes are seen, flat on the floor, or legs, and how wide these are."""
    if c.cut == 0:
        body.shoe += 0.04 * ((1.0 if _SHOE_M[0] < c.width < _SHOE_M[1] else 0.0) - body.shoe)
        if np.hypot(body.vx, body.vy) > _WALKS:
            if c.width < _SHOE_M[0]:
                _girth(body, c.width)
            body.leg += (0.05 if body.leg > 0.0 else 1.0) * (c.width - body.leg)


@njit(cache=True)
def _girth(body: Any, width: float) -> None:
    """Learn from a leg ``width`` m wide how wide the legs of the body are."""
    body.girth, body.girth_n = _mean(body.girth, body.girth_n, width, _GIRTH_MEMORY)
    if body.sure < SURE:
        return
    body.own_girth, body.own_girth_n = _mean(body.own_girth, body.own_girth_n, width, _GIRTH_LIFE)


@njit(cache=True)
def count_shoes(bodies: Any, clusters: Any, of: NDArray[np.int64], t: float, shoes: NDArray[np.float64]) -> None:
    """Learn from everybody who walks whether this laser sees shoes or legs: ``of`` (m,), the prints of the clusters.

    ``shoes`` (2,): of the feet, the share as wide as a shoe from its side, and how many were seen.
    """
    for b in range(bodies.size):
        body = bodies[b]
        if not body.used or not body.confirmed or body.robot or body.seen < t or np.hypot(body.vx, body.vy) < _WALKS:
            continue
        for i in range(clusters.size):
            c = clusters[i]
            if of[i] >= 0 and not c.cut and (body.a_print == of[i] or body.b_print == of[i]):
                shoes[1] = min(shoes[1] + 1.0, _LONG)
                shoes[0] += ((1.0 if _SHOE_M[0] < c.width < _SHOE_M[1] else 0.0) - shoes[0]) / shoes[1]


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
    if age < 0.3:
        share = -0.4 + 0.8 * age
        noise = 0.08 + 0.2 * age
        vx, vy, slow = _going(dx, dy, qx - ox, qy - oy)
        return qx + share * dx, qy + share * dy, noise * noise, vx, vy, slow
    noise = max(0.05, 0.17 - 0.1 * (age - 0.3))
    return qx - 0.5 * dx, qy - 0.5 * dy, noise * noise, 0.0, 0.0, 0.4**2


@njit(cache=True)
def _going(dx: float, dy: float, ox: float, oy: float) -> tuple[float, float, float]:
    """Velocity (m/s) and its variance by the step (dx, dy) to the other foot and the stride (ox, oy) of this one."""
    if np.hypot(ox, oy) > 1.8:
        return 1.4 * dx, 1.4 * dy, 0.5**2
    return 0.83 * dx + 0.3 * ox, 0.83 * dy + 0.3 * oy, 0.35**2


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
    if gone > 1.5 or np.hypot(dx, dy) > 1.2:
        # Both legs may be one thing to the laser: it goes as the body goes.
        return body.ax, body.ay, 0.1**2, 0.0, 0.0, np.inf
    if body.a_land < body.b_land:
        # The other had landed later and is up again: this one may be a foot that waits.
        return body.a_px - 0.3 * dx, body.a_py - 0.3 * dy, 0.18**2, 0.0, 0.0, np.inf
    share = min(-0.36 + 1.05 * age, 0.15)
    noise = 0.08 + 0.3 * age
    vx, vy, slow = 0.0, 0.0, np.inf
    if age < 0.4:
        vx, vy, slow = _going(dx, dy, body.a_px - body.a_ox, body.a_py - body.a_oy)
        slow *= 1.0 + 4.0 * age
    return body.a_px + share * dx, body.a_py + share * dy, noise * noise, vx, vy, slow
