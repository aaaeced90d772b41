"""Bodies: a Kalman filter that moves steadily, carried by two feet that stand, step, and are sometimes not seen."""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit

from tms_agents.floor.feet.build import knows_feet, size_up, wears_shoes
from tms_agents.floor.feet.gait import foot, middle, swap
from tms_agents.floor.norm import norm
from tms_agents.floor.scan.segmentation import DARK, FADES
from tms_agents.floor.state import NEVER

#: Acceleration noise (m²/s³) and how fast the memory of a velocity fades while nothing is seen (s).
_ACCELERATION, _COAST_S = 1.5, 2.0
#: A foot stays where it stands within this (m); nobody is faster (m/s); no step is longer (m).
STAND_M, _FAST, LONGEST_M = 0.045, 2.0, 1.4
#: No ankle or shoe is narrower than this (m).
_FOOT_M = 0.05
#: Wider than two feet side by side (m): a robot or furniture.
WIDE_M = 0.4
#: A foot counts as seen now if it was within this (s); two feet have just become one thing if they did within this (s).
_SEEN_S, _JUST_S = 0.25, 1.5
#: Of whom two feet were seen at once in this share of so many scans is no robot.
_TWO_FEET, _PERSON_HITS = 0.2, 80
#: Who has taken so many steps, and was wide in a smaller share of late, walks on two feet.
_STEPS, _NARROW = 2, 0.3
#: As furniture looks who was too wide for feet in such a share of late: more than makes a robot (`recognize`), which is
#: looked for first.
_FURNITURE = 0.65


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
    if c.n == 1 and c.spacing < 0.035 and c.cut != FADES:
        return True
    return bool(c.width + 0.5 * c.spacing < (0.6 if c.cut else 1.0) * _FOOT_M)


@njit(cache=True)
def scant(c: Any) -> bool:
    """Whether the cluster is too narrow for a foot, but may be all that comes back of one so far away."""
    return bool(c.open and not c.attached and narrow(c) and c.width + 0.5 * c.spacing > 0.6 * _FOOT_M)


@njit(cache=True)
def together(body: Any, clusters: Any, i: int, t: float) -> bool:
    """Whether cluster i is wide enough for both feet of the body, is where they stood, and none is seen beside it.

    Legs may be one thing to the laser; of shoes one is seen or two.
    """
    c = clusters[i]
    if (
        c.width < max(0.16, 1.4 * body.width)
        or body.robot
        or wears_shoes(body)
        or t - body.a_seen > 1.0
        or t - body.b_seen > 1.0
    ):
        return False
    reach = 0.5 * c.width + 0.05
    if norm(c.x - body.ax, c.y - body.ay) > reach or norm(c.x - body.bx, c.y - body.by) > reach:
        return False
    for o in range(clusters.size):
        p = clusters[o]
        near = min(norm(p.x - body.ax, p.y - body.ay), norm(p.x - body.bx, p.y - body.by))
        if o != i and near < STAND_M:
            return False
    return True


@njit(cache=True)
def begin(body: Any, c: Any, print_index: int, t: float) -> None:
    """A new tentative body at the cluster c."""
    body.used, body.confirmed, body.label, body.robot, body.stale, body.machine = 1, 0, -1, 0, 0, 0
    body.footprint = 0
    body.x, body.y, body.vx, body.vy = c.x, c.y, 0.0, 0.0
    body.pp, body.pv, body.vv = 0.04, 0.0, 0.8
    body.at, body.first, body.seen = t, t, t
    body.hits, body.looks, body.due, body.both = 1, 1, 0, 0
    body.x0, body.y0 = c.x, c.y
    body.width = c.width
    body.wide = 1.0 if c.width > WIDE_M else 0.0
    body.far = c.width
    body.ax, body.ay, body.a_seen, body.a_since, body.a_print = c.x, c.y, t, t, print_index
    body.bx, body.by, body.b_seen, body.b_since, body.b_print = c.x, c.y, NEVER, t, -1
    # What is wide and begins right before the background is a piece of it that is moved.
    body.from_furniture = 1 if c.width > 0.28 and c.gap < 0.35 else 0
    body.clear = 0.0
    body.score = footlike(c)
    body.quality, body.single = 0.7, 0.0
    body.a_vx, body.a_vy, body.b_vx, body.b_vy, body.a_late, body.b_late = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    body.a_px, body.a_py, body.a_ox, body.a_oy, body.a_land, body.a_stood = c.x, c.y, 1e9, 1e9, t, t
    body.b_px, body.b_py, body.b_ox, body.b_oy, body.b_land, body.b_stood = 1e9, 1e9, 1e9, 1e9, NEVER, NEVER
    body.stride, body.side, body.lone, body.pushed = 0.6, 0.0, 0.0, 0.0
    body.lone_x, body.lone_y = c.x, c.y
    body.walked_x, body.walked_y = c.x, c.y
    body.rest_x, body.rest_y, body.rest_at, body.older = c.x, c.y, t, 0.0
    body.stay_x, body.stay_y, body.stay, body.stay_broad, body.broadest = c.x, c.y, 0.0, 0.0, c.width
    body.stay_thin, body.stay_lands, body.spacing = 0.0, 0.0, c.spacing
    body.shoe, body.leg, body.odd = 0.0, 0.0, 0
    body.shine, body.shine_n, body.own, body.own_n = 0.0, 0, 0.0, 0
    body.stance, body.stance_n, body.own_stance, body.own_stance_n = 0.0, 0, 0.0, 0
    body.leg_width, body.leg_width_n, body.own_leg_width, body.own_leg_width_n = 0.0, 0, 0.0, 0
    body.ex, body.ey, body.e_at = 0.0, 0.0, NEVER
    body.shoe_length, body.shoe_length_n, body.own_shoe_length, body.own_shoe_length_n = 0.0, 0, 0.0, 0
    body.look, body.look_n, body.sure, body.doubted, body.held = 0.0, 0, 1.0, 0, NEVER
    body.suspected = NEVER


@njit(cache=True)
def misled(body: Any) -> bool:
    """Whether what is taken for a person has become as wide as furniture."""
    two_feet = body.both > _TWO_FEET * body.hits
    return bool(not body.robot and body.wide > _FURNITURE and body.hits > _PERSON_HITS and two_feet)


@njit(cache=True)
def footlike(c: Any) -> float:
    """How much the cluster alone speaks for a foot or a robot: up to 1; -0.2: too narrow, or joined to a wall."""
    if narrow(c) or c.attached:
        return -0.2
    if c.n == 1:
        return 0.2 if c.spacing < 0.025 else 0.5
    return float(min(1.0, c.width / 0.08))


@njit(cache=True)
def _tells(c: Any) -> bool:
    """Whether what is seen tells if it is a foot, and is not what is left of one behind somebody else or far away.

    Before dark walls pieces of furniture look as scant.
    """
    return bool(c.cut != 2 and (c.open == DARK or not scant(c)))


@njit(cache=True)
def update(
    body: Any,
    c: Any,
    has_c: bool,
    c_print: int,
    c_late: float,
    d: Any,
    has_d: bool,
    d_print: int,
    d_late: float,
    one: bool,
    prints: Any,
    t: float,
) -> None:
    """The body was seen: its first foot is the cluster c, its second d, each where there is one; or ``one`` is both."""
    if has_c and has_d and norm(c.x - d.x, c.y - d.y) > LONGEST_M:
        # No step is so long: the foot that stood for longer is something else.
        if prints[c_print].first < prints[d_print].first:
            has_c = False
        else:
            has_d = False
    speed = norm(body.vx, body.vy)
    if has_c:
        if c_print != body.a_print and speed > 0.35 and t - body.b_seen < 0.4:
            _stride(body, c.x - body.bx, c.y - body.by, speed, 1.0)
        size_up(body, c)
        foot(body, c, c_late, c_print, prints, t)
        body.score += footlike(c)
    if has_d:
        if d_print != body.b_print and speed > 0.35 and t - body.a_seen < 0.4:
            _stride(body, d.x - body.ax, d.y - body.ay, speed, -1.0)
        size_up(body, d)
        swap(body)
        foot(body, d, d_late, d_print, prints, t)
        swap(body)
        body.score += footlike(d)
    body.looks += 1
    if not has_c and not has_d:
        return
    body.hits += 1
    body.seen = t
    body.clear = 0.0
    best = max(footlike(c) if has_c else 0.0, footlike(d) if has_d else 0.0)
    if (has_c and _tells(c)) or (has_d and _tells(d)):
        body.quality += 0.05 * (best - body.quality)
    both = has_c and has_d
    vx, vy, slow = 0.0, 0.0, np.inf
    if one and has_c and not has_d:
        body.b_seen = t
        x, y, noise = c.x, c.y, 0.02
    elif one and has_d and not has_c:
        body.a_seen = t
        x, y, noise = d.x, d.y, 0.02
    elif body.robot:
        x, y, noise = (c.x, c.y, 0.02) if has_c else (d.x, d.y, 0.02)
    else:
        x, y, noise, vx, vy, slow = middle(body, t)
    if both:
        body.both += 1
    width = max(c.width if has_c else 0.0, d.width if has_d else 0.0)
    # Both feet in one are as broad as they like, and what is partly hidden behind something as thin.
    broader = c if has_c and (not has_d or c.width >= d.width) else d
    hidden = 0 < broader.cut < FADES and width < _FOOT_M
    body.broadest = 0.0 if hidden or (one and knows_feet(body)) else width
    body.spacing = c.spacing if has_c else d.spacing
    body.wide += 0.05 * ((1.0 if width > WIDE_M else 0.0) - body.wide)
    if body.hits > 20:
        if body.wide > 0.5 and body.both < _TWO_FEET * body.hits:
            body.robot = 1
        elif body.wide < 0.15:
            body.robot = 0
    if not one:
        body.width += 0.1 * (width - body.width)
    body.far = max(body.far, width) if body.hits > 3 else width
    if body.wide < _NARROW and body.own_stance_n >= _STEPS:
        body.walked_x, body.walked_y = body.x, body.y
    _measure(body, x - body.x, y - body.y, 1.0, 0.0, noise)
    if slow < np.inf:
        _measure(body, vx - body.vx, vy - body.vy, 0.0, 1.0, slow)
    # Nobody runs here: a jump is a wrong foot, not a speed.
    speed = norm(body.vx, body.vy)
    if speed > _FAST:
        body.vx *= _FAST / speed
        body.vy *= _FAST / speed


@njit(cache=True)
def _measure(body: Any, ex: float, ey: float, p: float, v: float, noise: float) -> None:
    """Kalman update by the innovation (ex, ey) of p times the place plus v times the velocity."""
    hp, hv = p * body.pp + v * body.pv, p * body.pv + v * body.vv
    s = p * hp + v * hv + noise
    kp, kv = hp / s, hv / s
    body.x += kp * ex
    body.y += kp * ey
    body.vx += kv * ex
    body.vy += kv * ey
    body.pp -= kp * hp
    body.pv -= kp * hv
    body.vv -= kv * hv


@njit(cache=True)
def _stride(body: Any, dx: float, dy: float, speed: float, sign: float) -> None:
    """Learn from a foot put (dx, dy) from the other how long the strides are and which foot is on the left."""
    ahead = (dx * body.vx + dy * body.vy) / speed
    aside = (dy * body.vx - dx * body.vy) / speed
    if 0.2 < ahead < 1.0 and abs(aside) < 0.4:
        body.stride += 0.25 * (ahead - body.stride)
        body.side += 0.25 * (sign * aside - body.side)


def stuck(body: Any, t: float) -> tuple[float, float, float] | None:
    """If all that is seen of a person is one thing that stands: (x m, y m, t s) of the last sighting of the other foot.

    The thing may have been put down there, and the person gone on from where the other foot was. Else None.
    """
    a, b = t - body["a_seen"] < _SEEN_S, t - body["b_seen"] < _SEEN_S
    if body["robot"] or body["stale"]:
        return None
    if a and b and body["a_print"] == body["b_print"] and t - body["a_since"] < _JUST_S and body["own_leg_width_n"] > 0:
        # Both feet have just become one: it may be what stood between them.
        return float(body["x"]), float(body["y"]), float(body["a_since"])
    if a == b:
        return None
    if t - (body["a_since"] if a else body["b_since"]) < 0.8:
        return None
    foot = "b" if a else "a"
    return float(body[f"{foot}x"]), float(body[f"{foot}y"]), float(body[f"{foot}_seen"])
