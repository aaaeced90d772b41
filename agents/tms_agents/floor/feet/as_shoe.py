"""How likely a cluster is to be somebody's shoe, seen on the floor only: one that stands, rolls off, or has landed."""

from __future__ import annotations

from typing import Any

from numba import njit

from tms_agents.floor.feet.build import SHOES, SHOES_KNOWN, WALKS, astray, from_side, shoe_length
from tms_agents.floor.feet.fitted import Shoes
from tms_agents.floor.feet.landing import Way, lands
from tms_agents.floor.feet.one_foot import UNLIKELY, Candidate, OneFoot, alone, beside, stands
from tms_agents.floor.norm import norm


@njit(cache=True, inline="always")
def as_shoe(shoes: Shoes, body: Any, goes: Way, c: Any, foot: OneFoot, one: Candidate, t: float) -> float:
    """Negative log likelihood of the cluster c being this shoe of a body that ``goes`` its way."""
    gap = t - foot.seen
    off = (c.x - foot.x) ** 2 + (c.y - foot.y) ** 2
    lost = not (gap < 1.0 or body.stale)
    value = stands(foot, one, off, shoes.stand_m, shoes.moved, shoes.left, lost)
    if gap < 0.35:
        rolls = one.base + 0.5 * off / shoes.rolls_m**2 + shoes.rolls
        value = min(value, rolls if off < shoes.farthest_m**2 else UNLIKELY)
    value += alone(foot, one, c, t)
    step = lands(body, goes, c, foot.other_x, foot.other_y, foot.seen, foot.other_landed, t - one.age)
    if foot.left:
        step = min(step, beside(foot, c, shoes.beside_m, shoes.beside))
    if one.age > gap + 0.15 and (not one.lately or foot.other_print == one.print_):
        # Whatever stands here came while this foot was somewhere else.
        step += shoes.stolen
    # What has stood there for long is hardly a foot, except that of somebody who stands.
    return min(value, step + shoes.rested if one.strange else step)


@njit(cache=True)
def another_shoe(body: Any, c: Any, shoes: Shoes) -> float:
    """Negative log likelihood of a shoe that is longer or shorter than his, or does not point where he goes."""
    if body.shoe < SHOES or not from_side(c):
        return 0.0
    value = 0.0
    if body.own_shoe_length_n >= SHOES_KNOWN:
        value += min(0.5 * ((shoe_length(c) - body.own_shoe_length) / shoes.sole_m) ** 2, shoes.another)
    if norm(body.vx, body.vy) > WALKS:
        value += min(0.5 * (astray(body, c) / shoes.turned) ** 2, shoes.astray)
    return value
