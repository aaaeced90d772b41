"""One foot of a body, and a cluster that may be it: what costs the same of a leg and of a shoe."""

from __future__ import annotations

from typing import Any, NamedTuple

from numba import njit

from tms_agents.floor.norm import norm

UNLIKELY = 1e6
#: Time for which a new print counts as a fresh step (s).
FRESH_S = 1.0
#: What still stands after so long (s) while the other foot goes may be no foot.
_LEFT_S = 1.0
#: Two feet are at one place within this (m).
_ASIDE_M = 0.02


class OneFoot(NamedTuple):
    """Where and when (m, s) a foot was seen, its velocity (u, v m/s) and print (-1: none), and the same of the other.

    Which swings so fast (m/s) and has landed then; ``side`` (m): so far to the left of it this one is put down;
    ``left``: it still stands while the other one goes.
    """

    x: float
    y: float
    u: float
    v: float
    seen: float
    print_: int
    other_x: float
    other_y: float
    other_swings: float
    other_seen: float
    other_landed: float
    other_print: int
    side: float
    left: bool


class Candidate(NamedTuple):
    """A cluster that may be a foot of a body, on a print (-1: none) that has been there for so long (``age``, s).

    ``lately`` it was his foot; ``strange``: it has rested there as nobody's. ``base``: what it costs to be so far from
    the body; ``broad``: to look so wide, where the other foot is elsewhere; ``anywhere``: as a leg put down just there.
    """

    print_: int
    age: float
    lately: bool
    strange: bool
    base: float
    broad: float
    anywhere: float


@njit(cache=True, inline="always")
def one_foot(body: Any, which: int, t: float) -> OneFoot:
    """The first (0) or the second foot of the body."""
    a_left = t - body.a_since > _LEFT_S and t - body.b_since < FRESH_S
    b_left = t - body.b_since > _LEFT_S and t - body.a_since < FRESH_S
    if which == 0:
        mine = body.ax, body.ay, body.a_vx, body.a_vy, body.a_seen, body.a_print
        swings, side, left = norm(body.b_vx, body.b_vy), body.side, a_left
        return OneFoot(*mine, body.bx, body.by, swings, body.b_seen, body.b_land, body.b_print, side, left)
    mine = body.bx, body.by, body.b_vx, body.b_vy, body.b_seen, body.b_print
    swings, side, left = norm(body.a_vx, body.a_vy), -body.side, b_left
    return OneFoot(*mine, body.ax, body.ay, swings, body.a_seen, body.a_land, body.a_print, side, left)


@njit(cache=True)
def apart(dx: float, dy: float, body: Any, speed: float, along: float, aside: float) -> float:
    """Negative log likelihood of being (dx, dy) from the body: more along the way it goes than aside."""
    if speed > 0.3:
        ux, uy = body.vx / speed, body.vy / speed
        dx, dy = dx * ux + dy * uy, dy * ux - dx * uy
    else:
        along = aside = 0.5 * (along + aside)
    return float(0.5 * (dx * dx / (along * along + body.pp) + dy * dy / (aside * aside + body.pp)))


@njit(cache=True, inline="always")
def stands(foot: OneFoot, one: Candidate, off: float, stand_m: float, moved: float, left: float, lost: bool) -> float:
    """The same of a foot that stands where it stood: ``off`` (m²) from there, within ``stand_m``.

    On one print it costs ``moved`` at most, and more by ``left`` if it was left behind. ``lost``: it was not seen there
    for long.
    """
    value = 0.5 * off / stand_m**2
    if foot.print_ >= 0 and foot.print_ == one.print_:
        value = one.base + min(value, moved)
        if foot.left:
            value += left
        return value
    return UNLIKELY if lost else one.base + value


@njit(cache=True, inline="always")
def alone(foot: OneFoot, one: Candidate, c: Any, t: float) -> float:
    """The same of one foot looking so wide as the cluster c: both may be one, but the other is elsewhere."""
    elsewhere = norm(c.x - foot.other_x, c.y - foot.other_y) > 0.5 * c.width + _ASIDE_M
    return one.broad if one.broad > 0.0 and t - foot.other_seen < 0.2 and elsewhere else 0.0


@njit(cache=True, inline="always")
def beside(foot: OneFoot, c: Any, near_m: float, cost: float) -> float:
    """The same of a foot put down within ``near_m`` of the other one."""
    return float(0.5 * ((c.x - foot.other_x) ** 2 + (c.y - foot.other_y) ** 2) / near_m**2 + cost)
