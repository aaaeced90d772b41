"""Bodies: a Kalman filter that moves steadily, carried by two feet that stand, step, and are sometimes not seen."""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

Array = NDArray[np.float64]

#: Acceleration noise (m²/s³) and how fast the memory of a velocity fades while nothing is seen (s).
_ACCELERATION, _COAST_S = 0.8, 2.0
#: A foot stays where it stands within this (m); feet are so far from the body along its way and aside (m).
_STAND_M, _ALONG_M, _ASIDE_M, _REACH_M = 0.045, 0.4, 0.24, 1.0
#: While one foot stands, the body is so near it (m); nobody is faster (m/s).
_TETHER_M, _FAST = 0.17, 2.0
#: Time for which a new print counts as a fresh step (s).
_FRESH_S = 1.0
#: No ankle or shoe is narrower than this (m).
_FOOT_M = 0.05
#: Wider than two feet side by side (m): a robot or furniture.
WIDE_M = 0.4
_BROAD_M = 0.45
#: Of whom two feet were seen at once in this share of so many scans is no robot.
_TWO_FEET, _PERSON_HITS = 0.2, 80
UNLIKELY = 1e6
#: A cluster that is nobody's foot: negative log likelihood of somebody new, and how much less of a thing put down.
_NOBODY, _THING, _CLUTTER, _TENTATIVE = 11.0, 6.0, 4.0, 5.0


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
def narrow(c: Any) -> bool:
    """Whether the cluster, all of it in view, is too narrow for an ankle or a shoe: the leg of a chair, say."""
    if c.n == 1 and c.spacing < 0.035:
        return True
    return bool(c.width + 0.5 * c.spacing < (0.6 if c.cut else 1.0) * _FOOT_M)


@njit(cache=True)
def together(body: Any, c: Any, t: float) -> bool:
    """Whether the cluster is wide enough for both feet of the body, and is where both stood."""
    if c.width < max(0.16, 1.4 * body.width) or body.robot or t - body.a_seen > 1.0 or t - body.b_seen > 1.0:
        return False
    reach = 0.5 * c.width + 0.05
    return bool(np.hypot(c.x - body.ax, c.y - body.ay) < reach and np.hypot(c.x - body.bx, c.y - body.by) < reach)


@njit(cache=True)
def _apart(dx: float, dy: float, body: Any, speed: float, along: float, aside: float) -> float:
    """Negative log likelihood of being (dx, dy) from the body: more along the way it goes than aside."""
    if speed > 0.3:
        ux, uy = body.vx / speed, body.vy / speed
        dx, dy = dx * ux + dy * uy, dy * ux - dx * uy
    else:
        along = aside = 0.5 * (along + aside)
    return float(0.5 * (dx * dx / (along * along + body.pp) + dy * dy / (aside * aside + body.pp)))


@njit(cache=True)
def _landing(dx: float, dy: float, body: Any, speed: float, side: float) -> float:
    """The same of a foot landing (dx, dy) from the other: a stride ahead and on its own side."""
    ux, uy = body.vx / speed, body.vy / speed
    ahead, aside = dx * ux + dy * uy - body.stride, dy * ux - dx * uy - side
    return float(0.5 * (ahead**2 / (0.15**2 + 0.2 * body.pp) + aside**2 / (0.1**2 + 0.2 * body.pp)) + 2.4)


@njit(cache=True)
def _swinging(dx: float, dy: float, u: float, v: float, body: Any, speed: float, dt: float) -> float:
    """The same of a foot that has moved by (dx, dy) in dt s: it goes on as it went (u, v m/s), or begins to swing."""
    going = 0.5 * ((dx - u * dt) ** 2 + (dy - v * dt) ** 2) / (0.05 + 0.5 * dt) ** 2 + 1.9
    reach = 3.0 * max(speed, 0.4) * dt
    if speed > 0.3:
        ux, uy = body.vx / speed, body.vy / speed
        along = min(max(dx * ux + dy * uy, 0.0), reach)
        dx, dy = dx - along * ux, dy - along * uy
    else:
        away = np.hypot(dx, dy)
        share = max(away - reach, 0.0) / max(away, 1e-6)
        dx, dy = dx * share, dy * share
    return min(going, 0.5 * (dx * dx + dy * dy) / 0.07**2 + 2.5)


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
    """Fill ``cost`` (m, 2k + m): negative log likelihoods of the clusters (m,) being feet of the bodies ``rows`` (k,).

    A foot goes on standing where it stood, or it has stepped: then it lands near the body. Only a fresh print can be
    a step: what has stood there for long is no foot. The last m columns are for clusters that are nobody's: a fresh
    one is somebody new, which is rare; an old one may well be something that was put down.
    """
    m, k = clusters.size, rows.size
    for i in range(m):
        c = clusters[i]
        cost[i, :] = UNLIKELY
        q = prints[of[i]] if of[i] >= 0 else prints[0]
        age = t - q.first if of[i] >= 0 else 0.0
        cost[i, 2 * k + i] = _CLUTTER if narrow(c) or c.attached else _NOBODY - _THING * min(max(age - 0.3, 0.0), 1.0)
        if not free[i]:
            continue
        for column in range(k):
            body = bodies[rows[column]]
            away = np.hypot(c.x - body.x, c.y - body.y)
            if body.stale and age > _FRESH_S:
                continue
            if not body.confirmed and age > t - body.first + 0.25:
                continue
            if away > _REACH_M + 1.5 * np.sqrt(body.pp):
                continue
            if body.robot or body.wide > 0.6:
                # Part of it may be hidden, but what is narrow and all in view is somebody's foot.
                cost[i, 2 * column] = 0.5 * (away / 0.3) ** 2 + (0.0 if c.cut or c.width > 0.6 * body.width else 6.0)
                continue
            speed = np.hypot(body.vx, body.vy)
            base = _apart(c.x - body.x, c.y - body.y, body, speed, _ALONG_M, _ASIDE_M)
            shape = 0.0
            if c.width > WIDE_M:
                shape = 3.0
                if c.width > _BROAD_M and body.hits > 15:
                    shape += 5.0 * max(0.0, 1.0 - 3.0 * body.wide)
            elif narrow(c):
                shape = 2.0 if c.n == 1 else 6.0
            if c.attached:
                shape += 4.0
            step = _apart(c.x - body.x - 0.12 * body.vx, c.y - body.y - 0.12 * body.vy, body, speed, 0.26, 0.17) + 3.7
            step = min(step, 0.5 * away * away / (0.45**2 + body.pp) + 5.2)
            if age > 0.5:
                step += 1.0
            for foot in range(2):
                if foot == 0:
                    x, y, u, v, seen, standing = body.ax, body.ay, body.a_vx, body.a_vy, body.a_seen, body.a_print
                    ox, oy, other = body.bx, body.by, body.b_seen
                else:
                    x, y, u, v, seen, standing = body.bx, body.by, body.b_vx, body.b_vy, body.b_seen, body.b_print
                    ox, oy, other = body.ax, body.ay, body.a_seen
                gap = t - seen
                off = (c.x - x) ** 2 + (c.y - y) ** 2
                value = UNLIKELY
                if standing >= 0 and standing == of[i]:
                    value = base + min(0.5 * off / _STAND_M**2, 2.0)
                elif gap < 1.0:
                    value = base + 0.5 * off / _STAND_M**2
                if gap < 0.35:
                    value = min(value, base + _swinging(c.x - x, c.y - y, u, v, body, speed, gap))
                if age >= _FRESH_S and q.owner != rows[column]:
                    # What has stood there for long is hardly a foot, except that of somebody who stands.
                    value = min(value, step + 2.5)
                else:
                    value = min(value, step)
                    if speed > 0.35 and gap < 1.3 and t - other < 0.4:
                        side = body.side if foot == 0 else -body.side
                        value = min(value, _landing(c.x - ox, c.y - oy, body, speed, side))
                cost[i, 2 * column + foot] = shape + value
    # Both feet in one cluster: whatever else is near is not a foot of this body.
    for column in range(k):
        body = bodies[rows[column]]
        for i in range(m):
            if free[i] and together(body, clusters[i], t):
                for o in range(m):
                    if o != i:
                        cost[o, 2 * column] += 4.0
                        cost[o, 2 * column + 1] += 4.0
                break


@njit(cache=True)
def _beside(body: Any, bodies: Any) -> bool:
    """Whether a mover that is believed is so near that its feet may be taken for another body."""
    for b in range(bodies.size):
        other = bodies[b]
        if other.used and other.confirmed and np.hypot(other.x - body.x, other.y - body.y) < 0.6:
            return True
    return False


@njit(cache=True)
def known(clusters: Any, bodies: Any, t: float, cost: Array) -> None:
    """Lower the ``cost`` (m, m) of being nobody's of clusters that go on with somebody new who is not believed yet."""
    for i in range(clusters.size):
        c = clusters[i]
        for b in range(bodies.size):
            body = bodies[b]
            if body.used and not body.confirmed and t - body.seen < 0.5 and not _beside(body, bodies):
                near = min(np.hypot(c.x - body.ax, c.y - body.ay), np.hypot(c.x - body.bx, c.y - body.by))
                near = max(min(near, np.hypot(c.x - body.x, c.y - body.y)) - 0.1, 0.0)
                cost[i, i] = min(cost[i, i], _TENTATIVE + 0.5 * (near / 0.2) ** 2)


@njit(cache=True)
def begin(body: Any, c: Any, print_index: int, t: float) -> None:
    """A new tentative body at the cluster c."""
    body.used, body.confirmed, body.label, body.robot, body.stale, body.machine = 1, 0, -1, 0, 0, 0
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
    # What is wide and begins right before the background is a piece of it that is moved.
    body.from_furniture = 1 if c.width > 0.28 and c.gap < 0.35 else 0
    body.clear = 0.0
    body.score = footlike(c)
    body.quality, body.single = 0.7, 0.0
    body.a_vx, body.a_vy, body.b_vx, body.b_vy = 0.0, 0.0, 0.0, 0.0
    body.stride, body.side, body.lone, body.pushed = 0.6, 0.0, 0.0, 0.0


@njit(cache=True)
def misled(body: Any) -> bool:
    """Whether what is taken for a person has become as wide as furniture."""
    two_feet = body.both > _TWO_FEET * body.hits
    return bool(not body.robot and body.wide > 0.5 and body.hits > _PERSON_HITS and two_feet)


@njit(cache=True)
def footlike(c: Any) -> float:
    """How much the cluster alone speaks for a foot or a robot, 0 to 1."""
    if narrow(c) or c.attached:
        return -0.2
    if c.n == 1:
        return 0.2 if c.spacing < 0.025 else 0.5
    return float(min(1.0, c.width / 0.08))


@njit(cache=True)
def update(
    body: Any,
    c: Any,
    has_c: bool,
    c_print: int,
    d: Any,
    has_d: bool,
    d_print: int,
    prints: Any,
    t: float,
) -> None:
    """The body was seen: its first foot is the cluster c, its second d, each where there is one."""
    if has_c and has_d and np.hypot(c.x - d.x, c.y - d.y) > 1.1:
        # No step is so long: the foot that stood for longer is something else.
        if prints[c_print].first < prints[d_print].first:
            has_c = False
        else:
            has_d = False
    speed = np.hypot(body.vx, body.vy)
    if has_c:
        since = prints[c_print].first if c_print >= 0 else t
        dt = t - body.a_seen
        if 0.0 < dt < 0.3:
            moved = np.hypot(c.x - body.ax, c.y - body.ay)
            body.a_vx, body.a_vy = ((c.x - body.ax) / dt, (c.y - body.ay) / dt) if moved > 0.05 else (0.0, 0.0)
        elif dt > 0.0:
            body.a_vx, body.a_vy = 0.0, 0.0
        if c_print != body.a_print and speed > 0.35 and t - body.b_seen < 0.4:
            _stride(body, c.x - body.bx, c.y - body.by, speed, 1.0)
        body.ax, body.ay, body.a_seen, body.a_print, body.a_since = c.x, c.y, t, c_print, since
        body.score += footlike(c)
    if has_d:
        since = prints[d_print].first if d_print >= 0 else t
        dt = t - body.b_seen
        if 0.0 < dt < 0.3:
            moved = np.hypot(d.x - body.bx, d.y - body.by)
            body.b_vx, body.b_vy = ((d.x - body.bx) / dt, (d.y - body.by) / dt) if moved > 0.05 else (0.0, 0.0)
        elif dt > 0.0:
            body.b_vx, body.b_vy = 0.0, 0.0
        if d_print != body.b_print and speed > 0.35 and t - body.a_seen < 0.4:
            _stride(body, d.x - body.ax, d.y - body.ay, speed, -1.0)
        body.bx, body.by, body.b_seen, body.b_print, body.b_since = d.x, d.y, t, d_print, since
        body.score += footlike(d)
    body.looks += 1
    if not has_c and not has_d:
        return
    body.hits += 1
    body.seen = t
    body.clear = 0.0
    best = max(footlike(c) if has_c else 0.0, footlike(d) if has_d else 0.0)
    body.quality += 0.05 * (best - body.quality)
    both = has_c and has_d
    if has_c and not has_d and together(body, c, t):
        body.b_seen = t
        x, y, noise = c.x, c.y, 0.02
    elif has_d and not has_c and together(body, d, t):
        body.a_seen = t
        x, y, noise = d.x, d.y, 0.02
    elif both:
        # What has stood for long while the other moves tells less: it may be no foot.
        age_a, age_b = t - body.a_since, t - body.b_since
        wa = 1.0 / (1.0 + (age_a / 0.7) ** 2) + 0.1
        wb = 1.0 / (1.0 + (age_b / 0.7) ** 2) + 0.1
        x, y = (wa * c.x + wb * d.x) / (wa + wb), (wa * c.y + wb * d.y) / (wa + wb)
        # When a foot lands, the body is in the middle; while both stand, it goes on.
        age = min(age_a, age_b)
        noise = 0.03 if 0.25 < age < 0.8 else 0.015
    else:
        x, y = (c.x, c.y) if has_c else (d.x, d.y)
        age = t - (body.a_since if has_c else body.b_since)
        noise = 0.03
        if body.robot:
            noise = 0.02
        elif age < 0.9 and body.hits > 5:
            # The body passes over the foot that stands: all it tells is that the body is not far.
            far = np.hypot(body.x - x, body.y - y)
            if far <= _TETHER_M:
                noise = np.inf
            else:
                x += _TETHER_M * (body.x - x) / far
                y += _TETHER_M * (body.y - y) / far
    if both:
        body.both += 1
    width = max(c.width if has_c else 0.0, d.width if has_d else 0.0)
    body.wide += 0.05 * ((1.0 if width > WIDE_M else 0.0) - body.wide)
    if body.hits > 20:
        if body.wide > 0.5 and body.both < _TWO_FEET * body.hits:
            body.robot = 1
        elif body.wide < 0.15:
            body.robot = 0
    body.width += 0.1 * (width - body.width)
    body.far = max(body.far, width) if body.hits > 3 else width
    if np.isinf(noise):
        return
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
    if speed > _FAST:
        body.vx *= _FAST / speed
        body.vy *= _FAST / speed


@njit(cache=True)
def _stride(body: Any, dx: float, dy: float, speed: float, sign: float) -> None:
    """Learn from a foot put (dx, dy) from the other how long the strides are and which foot is on the left."""
    ahead = (dx * body.vx + dy * body.vy) / speed
    aside = (dy * body.vx - dx * body.vy) / speed
    if 0.2 < ahead < 1.0 and abs(aside) < 0.4:
        body.stride += 0.25 * (ahead - body.stride)
        body.side += 0.25 * (sign * aside - body.side)
