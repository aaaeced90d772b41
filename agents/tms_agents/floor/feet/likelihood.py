"""How likely a cluster is to be somebody's foot, or a part of a robot."""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from tms_agents.floor.feet import fitted
from tms_agents.floor.feet.as_leg import anywhere, as_leg
from tms_agents.floor.feet.as_shoe import another_shoe, as_shoe
from tms_agents.floor.feet.bodies import LONGEST_M, STAND_M, WIDE_M, narrow, scant, together
from tms_agents.floor.feet.brightness import unlike
from tms_agents.floor.feet.build import LEGS_KNOWN, LONGEST_SHOE_M, SHOES, wears_shoes
from tms_agents.floor.feet.fitted import Legs, Shoes
from tms_agents.floor.feet.landing import Way, way
from tms_agents.floor.feet.one_foot import FRESH_S, UNLIKELY, Candidate, OneFoot, apart, one_foot
from tms_agents.floor.feet.prints import lay_before
from tms_agents.floor.norm import norm
from tms_agents.floor.scan.clustered import ClusteredScan
from tms_agents.floor.state import NEVER, SEATED

Array = NDArray[np.float64]

#: Nobody's foot is farther away from the body than this (m), and no part of a robot.
_REACH_M, _ROBOT_M = 1.3, 1.0
#: Who goes slower than this (m/s), one foot in view until so long (s) ago, puts the other one no farther (m) from it.
_STANDS_MPS, _IN_VIEW_S, _STEP_M = 0.3, 0.15, 1.0
#: Who has sat down gets up with a foot so near (m) one of his.
_RISES_M = 0.9
#: Where hardly anything comes back a beam or two so near (m) one of his feet are it.
_SCANT_M = 0.9
#: Who stands for sure has both feet within this (m), until none was seen for so long (s).
_HELD_M, _LIFTED_S = 0.33, 0.5
#: Two feet side by side are hardly wider (m).
_BROAD_M = 0.45
#: What is seen of a robot is so near its edge (m), if it was seen so long ago (s) at most.
_BESIDE_M, _STAYS_S = 0.2, 2.0
#: From its narrow side it looks at least this share as wide as from corner to corner.
_NARROWEST = 0.4
#: What was his foot so long (s) ago may be again: something flickered beside it.
_LATELY_S = 0.5
#: No leg is wider (m). How wide one looks errs by so much (m), and alike from scan to scan: the square of a deviation,
#: in units of that, counts for so much at most.
LEG_M, _GIRTH_M, _OTHER = 0.16, 0.02, 4.0
#: Negative log likelihood of a foot wider than a leg although the other one is elsewhere: up to as wide as two legs
#: side by side (m), and wider; or longer than a shoe.
_PAIR_M, _PAIR, _TOO_WIDE = 0.27, 2.0, 4.0


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
    # Not the whole scan: it would be handed over anew for each cluster.
    q = prints[print_] if print_ >= 0 else prints[0]
    age = t - q.first if print_ >= 0 else 0.0
    if not _possible(c, q, print_ >= 0, age, body, t):
        return
    if body.robot or body.wide > 0.6:
        cost[0] = _as_robot(c, body, t)
        return
    shod, speed = body.shoe >= SHOES, goes.speed
    along, aside = (shoes.along_m, shoes.aside_m) if shod else (legs.along_m, legs.aside_m)
    base = apart(c.x - body.x, c.y - body.y, body, speed, along, aside)
    shape = _shape(c, body, unlike(body, marks)) + (_stouter(body, c) + another_shoe(body, c, shoes))
    lately = print_ >= 0 and q.whose == body.label and t - q.owned < _LATELY_S
    strange = age >= FRESH_S and q.owner != row and not lately
    there = 0.0 if shod else anywhere(c, body, speed, age, legs)
    one = Candidate(print_, age, lately, strange, base, too_wide(body, c), there)
    for which in range(2):
        foot = one_foot(body, which, t)
        stays = print_ >= 0 and print_ == foot.print_
        if not stays and speed < _STANDS_MPS and _out_of_step(c, foot, t):
            continue
        if shod:
            cost[which] = shape + as_shoe(shoes, body, goes, c, foot, one, t)
        else:
            cost[which] = shape + as_leg(legs, body, speed, c, foot, one, t)


@njit(cache=True, inline="always")
def _out_of_step(c: Any, foot: OneFoot, t: float) -> bool:
    """Whether the cluster is farther from where the other foot stands, in view, than who stands can step."""
    return t - foot.other_seen < _IN_VIEW_S and norm(c.x - foot.other_x, c.y - foot.other_y) > _STEP_M


@njit(cache=True)
def _possible(c: Any, q: Any, rests: bool, age: float, body: Any, t: float) -> bool:
    """Whether the cluster c may be a foot of the body at all; it ``rests`` on the print q, there for so long (s)."""
    if body.stale and age > FRESH_S and not waits(body, c):
        return False
    if rests and lay_before(q, body):
        return False
    if body.stale == SEATED and _strides(body, c) > _RISES_M:
        return False
    if not body.confirmed and ((rests and q.rested < body.first - 0.25) or _strides(body, c) > LONGEST_M):
        return False
    held = t < body.held and t - max(body.a_seen, body.b_seen) < _LIFTED_S
    return not (held and _strides(body, c) > _HELD_M)


@njit(cache=True)
def _as_robot(c: Any, body: Any, t: float) -> float:
    """Negative log likelihood of the cluster being a part of a robot, or of what is as wide."""
    away = norm(c.x - body.x, c.y - body.y)
    # One that is seen does not jump to another that stands beside it.
    jumps = body.machine and t - body.seen < _STAYS_S
    if away > (0.5 * body.far + _BESIDE_M if jumps else _ROBOT_M):
        return UNLIKELY
    # Part of it may be hidden, but what is narrow and all in view is somebody's foot.
    # What is left of it at the edge of a door is no measure.
    least = max(0.6 * body.width, _NARROWEST * body.far if body.machine else 0.0)
    return float(0.5 * (away / 0.3) ** 2 + (0.0 if c.cut or c.width > least else 6.0))


@njit(cache=True)
def _shape(c: Any, body: Any, shape: float) -> float:
    """``shape`` and the negative log likelihood of a foot looking so wide or narrow, or joined to the background."""
    if c.width > WIDE_M:
        shape += 3.0
        if c.width > _BROAD_M and body.hits > 15:
            shape += 5.0 * max(0.0, 1.0 - 3.0 * body.wide)
    elif narrow(c) and not (body.confirmed and scant(c) and _strides(body, c) < _SCANT_M):
        shape += 2.0 if c.n == 1 else 6.0
    return shape + 4.0 if c.attached else shape


@njit(cache=True)
def _stouter(body: Any, c: Any) -> float:
    """Negative log likelihood of a leg being so much wider or narrower than those of the one who has the name."""
    if body.own_leg_width_n < LEGS_KNOWN or body.shoe >= SHOES or c.cut or c.width > LEG_M:
        return 0.0
    return float(0.5 * min(((c.width - body.own_leg_width) / _GIRTH_M) ** 2, _OTHER))


@njit(cache=True)
def too_wide(body: Any, c: Any) -> float:
    """Negative log likelihood of one foot looking so wide: of a shoe, or of a leg, where two may be side by side."""
    if body.shoe >= SHOES:
        return _TOO_WIDE if wears_shoes(body) and c.width > LONGEST_SHOE_M else 0.0
    if body.own_leg_width_n < LEGS_KNOWN or c.width <= LEG_M:
        return 0.0
    return _PAIR if c.width < _PAIR_M else _TOO_WIDE


@njit(cache=True)
def waits(body: Any, c: Any) -> bool:
    """Whether the cluster is where a foot of the body stood when it was lost sight of."""
    if not body.stale or body.robot or max(body.a_seen, body.b_seen) <= NEVER:
        return False
    a = body.a_seen > NEVER and norm(c.x - body.ax, c.y - body.ay) < STAND_M
    return bool(a or (body.b_seen > NEVER and norm(c.x - body.bx, c.y - body.by) < STAND_M))


@njit(cache=True)
def _strides(body: Any, c: Any) -> float:
    """How far (m) the nearer foot of the body would have to step to the cluster."""
    return float(min(norm(c.x - body.ax, c.y - body.ay), norm(c.x - body.bx, c.y - body.by)))
