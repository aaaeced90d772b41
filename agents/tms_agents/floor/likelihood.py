"""How likely a cluster is to be somebody's foot: one that stands, swings, or has landed."""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from tms_agents.floor import fitted
from tms_agents.floor.bodies import LONGEST_M, STAND_M, WIDE_M, narrow, scant, together
from tms_agents.floor.build import (
    LEGS_KNOWN,
    LONGEST_SHOE_M,
    SHOES,
    SHOES_KNOWN,
    WALKS,
    astray,
    from_side,
    sole,
    wears_shoes,
)
from tms_agents.floor.clustered import ClusteredScan
from tms_agents.floor.fitted import Legs, Shoes
from tms_agents.floor.landing import Way, lands, way
from tms_agents.floor.norm import norm
from tms_agents.floor.prints import lay_before
from tms_agents.floor.shine import unlike
from tms_agents.floor.state import SEATED

Array = NDArray[np.float64]

UNLIKELY = 1e6
#: Nobody's foot is farther away from the body than this (m), and no part of a robot.
_REACH_M, _ROBOT_M = 1.3, 1.0
#: Who has sat down gets up with a foot so near (m) one of his.
_RISES_M = 0.9
#: Where hardly anything comes back a beam or two so near (m) one of his feet are it.
_SCANT_M = 0.9
#: Who stands for sure has both feet within this (m), until none was seen for so long (s).
_HELD_M, _LIFTED_S = 0.33, 0.5
#: Time for which a new print counts as a fresh step (s).
FRESH_S = 1.0
#: Two feet side by side are hardly wider (m).
_BROAD_M = 0.45
#: What is seen of a robot is so near its edge (m), if it was seen so long ago (s) at most.
_BESIDE_M, _STAYS_S = 0.2, 2.0
#: From its narrow side it looks at least this share as wide as from corner to corner.
_NARROWEST = 0.4
#: What was his foot so long (s) ago may be again: something flickered beside it.
_LATELY_S = 0.5
#: What still stands after so long (s) while the other foot goes may be no foot.
_LEFT_S = 1.0
#: A leg is so wide at most (m); one sighting errs by so much (m), and counts for so much at most: the next one errs
#: alike.
LEG_M, _GIRTH_M, _OTHER = 0.16, 0.02, 4.0
#: Negative log likelihood of a foot wider than a leg although the other one is elsewhere: up to as wide as two legs
#: side by side (m), and wider; or longer than a shoe.
_PAIR_M, _PAIR, _TOO_WIDE = 0.27, 2.0, 4.0


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
def _strides_on(dx: float, dy: float, body: Any, speed: float, side: float, legs: Legs) -> float:
    """The same of a leg put (dx, dy) from the other: a stride ahead and on its own side."""
    ux, uy = body.vx / speed, body.vy / speed
    ahead, aside = dx * ux + dy * uy - body.stride, dy * ux - dx * uy - side
    along, across = legs.stride_m**2 + 0.2 * body.pp, legs.stride_aside_m**2 + 0.2 * body.pp
    return float(0.5 * (ahead**2 / along + aside**2 / across) + legs.strides)


@njit(cache=True)
def _swinging(dx: float, dy: float, u: float, v: float, body: Any, speed: float, dt: float, legs: Legs) -> float:
    """The same of a foot that has moved by (dx, dy) in dt s: it goes straight on (u, v m/s), or begins to swing."""
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
def _anywhere(c: Any, body: Any, speed: float, age: float, legs: Legs) -> float:
    """The same of a leg put down anywhere near, of what has stood there for so long (``age``, s)."""
    dx, dy = c.x - body.x, c.y - body.y
    ahead_x, ahead_y = legs.ahead_s * body.vx, legs.ahead_s * body.vy
    value = _apart(dx - ahead_x, dy - ahead_y, body, speed, legs.ahead_m, legs.ahead_aside_m) + legs.anywhere
    value = min(value, 0.5 * (dx * dx + dy * dy) / (legs.around_m**2 + body.pp) + legs.around)
    return float(value + (legs.stood if age > 0.5 else 0.0))


@njit(cache=True)
def _stouter(body: Any, c: Any) -> float:
    """Negative log likelihood of a leg being so much wider or narrower than those of the one who has the name."""
    if body.own_girth_n < LEGS_KNOWN or body.shoe >= SHOES or c.cut or c.width > LEG_M:
        return 0.0
    return float(0.5 * min(((c.width - body.own_girth) / _GIRTH_M) ** 2, _OTHER))


@njit(cache=True)
def too_wide(body: Any, c: Any) -> float:
    """Negative log likelihood of one foot looking so wide: of a shoe, or of a leg, where two may be side by side."""
    if body.shoe >= SHOES:
        return _TOO_WIDE if wears_shoes(body) and c.width > LONGEST_SHOE_M else 0.0
    if body.own_girth_n < LEGS_KNOWN or c.width <= LEG_M:
        return 0.0
    return _PAIR if c.width < _PAIR_M else _TOO_WIDE


@njit(cache=True)
def _another_shoe(body: Any, c: Any, shoes: Shoes) -> float:
    """Negative log likelihood of a shoe that is longer or shorter than his, or does not point where he goes."""
    if body.shoe < SHOES or not from_side(c):
        return 0.0
    value = 0.0
    if body.own_sole_n >= SHOES_KNOWN:
        value += min(0.5 * ((sole(c) - body.own_sole) / shoes.sole_m) ** 2, shoes.another)
    if norm(body.vx, body.vy) > WALKS:
        value += min(0.5 * (astray(body, c) / shoes.turned) ** 2, shoes.astray)
    return value


@njit(cache=True)
def waits(body: Any, c: Any) -> bool:
    """Whether the cluster is where a foot of the body stood when it was lost sight of."""
    if not body.stale or body.robot or max(body.a_seen, body.b_seen) < 0.0:
        return False
    a = body.a_seen >= 0.0 and norm(c.x - body.ax, c.y - body.ay) < STAND_M
    return bool(a or (body.b_seen >= 0.0 and norm(c.x - body.bx, c.y - body.by) < STAND_M))


@njit(cache=True)
def _strides(body: Any, c: Any) -> float:
    """How far (m) the nearer foot of the body would have to step to the cluster."""
    return float(min(norm(c.x - body.ax, c.y - body.ay), norm(c.x - body.bx, c.y - body.by)))


@njit(cache=True)
def feet(scan: ClusteredScan, free: NDArray[np.bool_], bodies: Any, row: int, cost: Array) -> None:
    """Fill ``cost`` (m, 2): what it costs that the clusters that are ``free`` (m,) are the feet of the body ``row``."""
    feet_by(fitted.LEGS, fitted.SHOES, scan, free, bodies, row, cost)


# In `feet` the numbers are known when it is compiled; to hand all of them over takes longer.
@njit(cache=True, inline="always")
def feet_by(
    legs: Legs, shoes: Shoes, scan: ClusteredScan, free: NDArray[np.bool_], bodies: Any, row: int, cost: Array
) -> None:
    """As `feet`, by other numbers than those in use."""
    body, clusters, of, marks, prints, t = bodies[row], scan.clusters, scan.of, scan.marks, scan.prints, scan.t
    reach = _REACH_M + 1.5 * np.sqrt(body.pp)
    goes = way(body)
    for i in range(clusters.size):
        c = clusters[i]
        cost[i, 0] = cost[i, 1] = UNLIKELY
        # What is its own of one that has a footprint is known (`footprints`).
        if free[i] and not body.footprint and norm(c.x - body.x, c.y - body.y) <= reach:
            _foot(legs, shoes, goes, c, of[i], marks[i], prints, body, row, t, cost[i])
    for i in range(clusters.size):
        if free[i] and together(body, clusters, i, t):
            # Both feet in one cluster: whatever else is near is not a foot of this body.
            for o in range(clusters.size):
                if o != i:
                    cost[o, 0] += 4.0
                    cost[o, 1] += 4.0
            break


@njit(cache=True, inline="always")
def _foot(
    legs: Legs,
    shoes: Shoes,
    goes: Way,
    c: Any,
    print_: int,
    marks: Array,
    prints: Any,
    body: Any,
    row: int,
    t: float,
    cost: Array,
) -> None:
    """Lower ``cost`` (2,) to that of the cluster c, on ``print_`` (-1: none), being the first and the second foot."""
    # Not the whole scan: to hand it over for each cluster takes longer than all the rest.
    away = norm(c.x - body.x, c.y - body.y)
    q = prints[print_] if print_ >= 0 else prints[0]
    age = t - q.first if print_ >= 0 else 0.0
    if body.stale and age > FRESH_S and not waits(body, c):
        return
    if print_ >= 0 and lay_before(q, body):
        return
    if body.stale == SEATED and _strides(body, c) > _RISES_M:
        return
    if not body.confirmed and print_ >= 0 and q.rested < body.first - 0.25:
        return
    if not body.confirmed and _strides(body, c) > LONGEST_M:
        return
    if t < body.held and t - max(body.a_seen, body.b_seen) < _LIFTED_S and _strides(body, c) > _HELD_M:
        return
    if body.robot or body.wide > 0.6:
        # One that is seen does not jump to another that stands beside it.
        jumps = body.machine and t - body.seen < _STAYS_S
        if away > (0.5 * body.far + _BESIDE_M if jumps else _ROBOT_M):
            return
        # Part of it may be hidden, but what is narrow and all in view is somebody's foot.
        # What is left of it at the edge of a door is no measure.
        least = max(0.6 * body.width, _NARROWEST * body.far if body.machine else 0.0)
        cost[0] = 0.5 * (away / 0.3) ** 2 + (0.0 if c.cut or c.width > least else 6.0)
        return
    lately = print_ >= 0 and q.whose == body.label and t - q.owned < _LATELY_S
    speed = goes.speed
    shod = body.shoe >= SHOES
    along, aside = (shoes.along_m, shoes.aside_m) if shod else (legs.along_m, legs.aside_m)
    base = _apart(c.x - body.x, c.y - body.y, body, speed, along, aside)
    shape = unlike(body, marks)
    if c.width > WIDE_M:
        shape += 3.0
        if c.width > _BROAD_M and body.hits > 15:
            shape += 5.0 * max(0.0, 1.0 - 3.0 * body.wide)
    elif narrow(c) and not (body.confirmed and scant(c) and _strides(body, c) < _SCANT_M):
        shape += 2.0 if c.n == 1 else 6.0
    if c.attached:
        shape += 4.0
    shape += _stouter(body, c) + _another_shoe(body, c, shoes)
    broad = too_wide(body, c)
    anywhere = 0.0 if shod else _anywhere(c, body, speed, age, legs)
    for which in range(2):
        if which == 0:
            x, y, u, v, seen, standing = body.ax, body.ay, body.a_vx, body.a_vy, body.a_seen, body.a_print
            ox, oy, other, swings = body.bx, body.by, body.b_seen, norm(body.b_vx, body.b_vy)
            landed, beside = body.b_land, body.b_print
            left = t - body.a_since > _LEFT_S and t - body.b_since < FRESH_S
        else:
            x, y, u, v, seen, standing = body.bx, body.by, body.b_vx, body.b_vy, body.b_seen, body.b_print
            ox, oy, other, swings = body.ax, body.ay, body.a_seen, norm(body.a_vx, body.a_vy)
            landed, beside = body.a_land, body.a_print
            left = t - body.b_since > _LEFT_S and t - body.a_since < FRESH_S
        gap = t - seen
        off = (c.x - x) ** 2 + (c.y - y) ** 2
        stands = 0.5 * off / (shoes.stand_m if shod else STAND_M) ** 2
        value = UNLIKELY
        if standing >= 0 and standing == print_:
            value = base + min(stands, shoes.moved if shod else legs.moved)
            if left:
                value += shoes.left if shod else legs.left
        elif gap < 1.0 or body.stale:
            value = base + stands
        if shod:
            if gap < 0.35:
                rolls = base + 0.5 * off / shoes.rolls_m**2 + shoes.rolls
                value = min(value, rolls if off < shoes.farthest_m**2 else UNLIKELY)
        elif gap < 0.35:
            swing = base + _swinging(c.x - x, c.y - y, u, v, body, speed, gap, legs)
            if swings > 0.5 and t - other < 0.22:
                swing += legs.both
            value = min(value, swing)
        if broad > 0.0 and t - other < 0.2 and norm(c.x - ox, c.y - oy) > 0.5 * c.width + _GIRTH_M:
            value += broad
        step = anywhere
        if shod:
            step = lands(body, goes, c, ox, oy, seen, landed, t - age)
        elif gap < 0.22 and not left:
            # Seen just now, it cannot be far, unless it was something that was left behind.
            step += legs.seen + 0.5 * (max(0.0, np.sqrt(off) - 0.15 - 3.0 * gap) / legs.seen_m) ** 2
        elif gap > 1.0 and not left:
            # It must be somewhere.
            step -= legs.lost
        if left:
            near, beside_it = (shoes.beside_m, shoes.beside) if shod else (legs.beside_m, legs.beside)
            step = min(step, 0.5 * ((c.x - ox) ** 2 + (c.y - oy) ** 2) / near**2 + beside_it)
        if age > gap + 0.15 and (not lately or (shod and beside == print_)):
            # Whatever stands here came while this foot was somewhere else.
            step += shoes.stolen if shod else legs.stolen
        if age >= FRESH_S and q.owner != row and not lately:
            # What has stood there for long is hardly a foot, except that of somebody who stands.
            value = min(value, step + (shoes.rested if shod else legs.rested))
        else:
            value = min(value, step)
            if not shod and speed > 0.35 and gap < 1.3 and t - other < 0.4:
                side = body.side if which == 0 else -body.side
                value = min(value, _strides_on(c.x - ox, c.y - oy, body, speed, side, legs) + step - anywhere)
        cost[which] = shape + value
