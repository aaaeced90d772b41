"""What was taken for somebody, rests, and is furniture or a thing: by how wide it is, and what is known of his feet."""

from __future__ import annotations

from typing import Any

from numba import njit

from tms_agents.floor.feet.build import LEGS_KNOWN, SHOES
from tms_agents.floor.movers.lone import has_come, has_walked

#: What was pushed stands still for so long (s): it is furniture.
PARKED_S = 5.0
#: Who has not come from elsewhere on two feet, and rests for so long (s), is a thing.
_INERT_S = 30.0
#: So broad (m) a person is never.
WIDE_M = 0.35
#: No leg and no shoe looks so broad in the long run (m), and of a person two feet are seen in this share of the scans
#: at least.
_BROAD_LEG_M, _BROAD_SHOE_M, _FEET = 0.27, 0.45, 0.25
#: Where legs are seen, two side by side are hardly ever so broad (m) in the mean while somebody stands; what is no
#: narrower than this (m) may be furniture, and is looked at when it has rested for so long (s).
_SIDE_BY_SIDE_M, _BLOCK_M, _SETTLED_S = 0.26, 0.18, 8.0
#: Where somebody began of late (s) who may be he, what rests for so long (s) and looks so much (m) wider or narrower
#: than a leg of his is none; nor is one thing alone, for so long (s), thinner (m) than a shoe from most sides, that
#: rests longer (s).
_BEGAN_S, _LEFT_S, _UNLIKE_M = 30.0, 4.0, 0.05
_LEFT_ALONE_S, _THIN_SHOE_M, _SHOE_LEFT_S = 2.0, 0.1, 6.0
#: What moved with people beside it for this share of its way may have been pushed.
BESIDE = 0.15
#: Who was seen so often is somebody.
KNOWN = 200


@njit(cache=True)
def is_parked(body: Any, t: float, legs: bool) -> bool:
    """Whether it stands still and is no person: as wide as furniture, not come by itself, or unlike his feet.

    Where people show ``legs`` nobody stands who is so broad.
    """
    if body.machine:
        return False
    rests = t - body.rest_at
    since = body.a_since if body.a_seen >= body.b_seen else body.b_since
    if body.wide > 0.5:
        # What is wide goes without landing anew.
        return bool(min(rests, t - since) > PARKED_S)
    if legs and body.width > _SIDE_BY_SIDE_M and rests > 2.0 * PARKED_S:
        return True
    if _is_left(body, t) or (_is_too_wide(body) and (rests > _SETTLED_S or body.stay > 2.0 * PARKED_S)):
        return True
    inert = rests > _INERT_S and not body.robot and not has_come(body)
    if inert and not is_somebody(body):
        return True
    if body.pushed < BESIDE and body.from_furniture != 1 and not _is_known(body):
        # It came by itself.
        return False
    # Furniture half hidden by who pushes it: as broad as no leg or shoe, or broad once and hardly ever on two feet.
    broad = body.width > (_BROAD_SHOE_M if body.shoe >= SHOES else _BROAD_LEG_M)
    return bool((broad and rests > PARKED_S) or (is_footless(body) and rests > 2.0 * PARKED_S))


@njit(cache=True)
def _is_too_wide(body: Any) -> bool:
    """Whether it looks wider than both legs of the one whose name it has, side by side."""
    known = body.own_leg_width_n >= LEGS_KNOWN and body.shoe < SHOES and not body.robot
    return bool(known and body.width > 2.0 * body.own_leg_width + body.spacing)


@njit(cache=True)
def _is_left(body: Any, t: float) -> bool:
    """Whether somebody began of late who may be who it was, and it does not look like his feet."""
    if t - body.suspected > _BEGAN_S or body.robot:
        return False
    rests = t - body.rest_at
    if body.shoe >= SHOES:
        return bool(rests > _SHOE_LEFT_S and body.single > _LEFT_ALONE_S and body.width < _THIN_SHOE_M)
    known = body.own_leg_width_n >= LEGS_KNOWN
    return bool(known and rests > _LEFT_S and abs(body.width - body.own_leg_width) > _UNLIKE_M)


@njit(cache=True)
def is_piece(body: Any, t: float) -> bool:
    """Whether all that is seen of it is one thing that rests, broad enough for a piece of furniture."""
    one = body.a_print == body.b_print or max(t - body.a_seen, t - body.b_seen) > 1.0
    rests = t - body.rest_at > _SETTLED_S
    return bool(one and rests and body.width > _BLOCK_M and not body.robot and not body.machine)


@njit(cache=True)
def is_somebody(body: Any) -> bool:
    """Whether it is a person for certain: if what is seen now is none, he is somewhere else."""
    return bool(_is_known(body) or has_walked(body))


@njit(cache=True)
def _is_known(body: Any) -> bool:
    """Whether two feet have been seen so often that it is a person."""
    return bool(body.hits > KNOWN and body.both > _FEET * body.hits)


@njit(cache=True)
def is_footless(body: Any) -> bool:
    """Whether it has been broader than two feet side by side, and two feet were hardly ever seen."""
    return bool(not body.machine and body.far > WIDE_M and body.both < _FEET * body.hits and not has_walked(body))
