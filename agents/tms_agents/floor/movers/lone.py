"""One foot alone that does not move is no person: whoever it was is somewhere else, unless the other one is hidden.

Nobody vanishes in plain sight, though: who came step by step and was seen without a gap since both his feet were has
not gone, as long as nobody began to be seen beside him who may be he. He stands on legs in a row, and a foot of
somebody who passed was taken for his.
"""

from __future__ import annotations

from typing import Any

from numba import njit

from tms_agents.floor.feet.build import LONGEST_SHOE_M, SHOES, wears_shoes
from tms_agents.floor.feet.prints import ALONE, UNLIKE
from tms_agents.floor.movers.twice import suspected
from tms_agents.floor.norm import norm
from tms_agents.floor.scan.freespace import HIDDEN, Sight, clear

#: While it is hidden within this (m) where the other foot was seen last, no time counts; a step is longer. Nobody
#: leaves a foot so far (m) behind, but it may have come and be hidden here: time counts less.
_STEP_M, _STRIDE_M, _SLOWER = 0.1, 0.9, 2.0
#: What had stood there for so long (s) before somebody's only foot came there, or is as wide as no foot of his, or who
#: he was may have begun elsewhere: it is most likely a thing, time counts more.
_OLDER_S, _FASTER = 1.0, 2.5
#: Of who cannot have gone time counts so much; who was not seen for so long (s) may have.
_IN_SIGHT, _GAP_S = 0.1, 1.0
#: Who goes on from a thing begins to be seen so shortly (s) before it rests, or later, and so near (m).
_GOES_S, _GOES_M = 3.0, 1.5
#: Not even who has come step by step stands for so long (s) without shifting a foot, nor for so long with one shoe
#: behind the other, if shoes are all that is seen.
_STILL_S, _SHOD_S = 900.0, 60.0
#: Who has come from so far (m), two feet of whom were seen at once so often, is somebody, too.
_CAME_M, _CAME_BOTH = 0.5, 10
#: Whose other foot was last seen so near (m) stands on both.
_STANCE_M = 0.4
#: Two feet that are seen within this time (s), and so near each other (m), are parts of one thing. But what is wider
#: than a leg of theirs may be both of them; and where one print is taken for either foot in turn, one leg hides the
#: other. Two shoes are never nearer than the last (m).
_BOTH_SEEN_S, _ONE_M, _ONE_PRINT_M = 1.0, 0.08, 0.04
#: Who had stood on one foot for so long (s) when he seemed to step away with the other has not gone.
_STOOD_S = 20.0
#: Two legs that are one thing to the laser are wider (m) than one.
_LEGS_M = 0.2
#: Who has taken so many steps, two legs of whom were seen at once so often, or two shoes, is a person: who walks has
#: both shoes on the floor for a tenth of the time only.
_STEPS, _BOTH_LEGS, _BOTH_SHOES = 3, 30, 6
#: So near (m) the edge of a thing that has stood for so long (s) is no second foot; feet are so wide at most (m).
_SLIVER_M, _SLIVER_S, _SHOE_M = 0.035, 10.0, 0.15


@njit(cache=True)
def count_lone(bodies: Any, b: int, t: float, dt: float, sight: Sight) -> None:
    """Note in ``lone`` for how long the body b, seen now, has been one foot alone."""
    body = bodies[b]
    only_a = body.a_seen >= body.b_seen
    foot_x, foot_y = (body.ax, body.ay) if only_a else (body.bx, body.by)
    if not _is_lone(body, t):
        both = max(t - body.a_seen, t - body.b_seen) < 1.0
        # What was hidden meanwhile goes on being alone.
        if both or norm(foot_x - body.lone_x, foot_y - body.lone_y) > _STEP_M:
            body.lone = 0.0
        return
    x, y, at = (body.bx, body.by, body.b_seen) if only_a else (body.ax, body.ay, body.a_seen)
    # Of whom two feet were hardly ever seen at once nothing need be hidden there.
    behind = t - at > 0.5 and body.both >= _BOTH_SHOES and clear(x, y, _STEP_M, sight) == HIDDEN
    if body.lone == 0.0:
        body.lone_x, body.lone_y = foot_x, foot_y
    if body.older > _OLDER_S or suspected(body):
        body.lone += dt * _FASTER
    elif not behind or body.odd == ALONE:
        faster = _FASTER if body.odd and not behind else 1.0
        gone = body.odd == ALONE or _is_one_print(body, t) or _may_have_gone(bodies, b)
        body.lone += dt * (faster if gone else _IN_SIGHT)
    elif norm(foot_x - x, foot_y - y) > _STRIDE_M:
        body.lone += dt / _SLOWER


@njit(cache=True)
def _may_have_gone(bodies: Any, b: int) -> bool:
    """Whether the body b, of which one foot is seen, was out of sight, or somebody began beside it who may be he."""
    body = bodies[b]
    only_a = body.a_seen >= body.b_seen
    x, y, since = (body.ax, body.ay, body.a_since) if only_a else (body.bx, body.by, body.b_since)
    if since > min(body.a_seen, body.b_seen) + _GAP_S or norm(body.ax - body.bx, body.ay - body.by) > _STRIDE_M:
        return True
    if not has_walked(body):
        return True
    for o in range(bodies.size):
        other = bodies[o]
        new = o != b and other.used and not other.robot and other.first > since - _GOES_S
        if new and norm(other.x0 - x, other.y0 - y) < _GOES_M:
            return True
    return False


@njit(cache=True)
def _is_lone(body: Any, t: float) -> bool:
    """Whether all that is seen of a person, unmoved for some time, may be a thing or two."""
    no_shoe = wears_shoes(body) and body.width > LONGEST_SHOE_M
    apart = norm(body.ax - body.bx, body.ay - body.by)
    # Who has walked in shoes, and whose other one was farther away than anybody stands, stands on no two side by side.
    strode = body.shoe >= SHOES and apart > _STRIDE_M and has_walked(body)
    if body.robot or body.wide > 0.6 or (body.width > _LEGS_M and not no_shoe and not strode):
        return False
    a, b = t - body.a_seen, t - body.b_seen
    parts = body.a_print != body.b_print and apart < _ONE_M and body.odd != UNLIKE
    if (max(a, b) < _BOTH_SEEN_S and parts) or _is_one_print(body, t):
        return True
    since = body.a_since if a < b else body.b_since
    # What was met beside one who stands may have been the foot of somebody who passes.
    stood = body.b_land - body.a_land if a < b else body.a_land - body.b_land
    both = apart < _STANCE_M or stood > _STOOD_S
    came = (has_walked(body) or has_come(body)) and not suspected(body)
    if came and _is_two(body) and body.older < _OLDER_S and not body.odd and both and not no_shoe:
        # One leg hides the other for as long as he likes.
        return bool(body.still > _STILL_S or (body.shoe >= SHOES and min(max(a, b), t - since) > _SHOD_S))
    sliver = apart < 0.5 * min(body.width, _SHOE_M) + _SLIVER_M and t - min(body.a_since, body.b_since) > _SLIVER_S
    if body.still > _STILL_S or sliver:
        return True
    return bool(max(a, b) > 1.0 and t - since > 1.0)


@njit(cache=True)
def _is_one_print(body: Any, t: float) -> bool:
    """Whether both shoes were seen on one print of late, at one place."""
    both = max(t - body.a_seen, t - body.b_seen) < _BOTH_SEEN_S and body.a_print == body.b_print
    return bool(both and body.shoe >= SHOES and norm(body.ax - body.bx, body.ay - body.by) < _ONE_PRINT_M)


@njit(cache=True)
def _is_two(body: Any) -> bool:
    """Whether it has shown both feet as often as a person does since it was last found to be nowhere."""
    return bool(body.doubted == 0 or body.both - body.doubted >= _both_feet(body))


@njit(cache=True)
def has_walked(body: Any) -> bool:
    """Whether it has come on two feet, step by step."""
    return bool(body.own_stance_n >= _STEPS and body.both >= _both_feet(body))


@njit(cache=True)
def has_come(body: Any) -> bool:
    """Whether it rests elsewhere than it began, and has shown both feet now and then."""
    return bool(norm(body.rest_x - body.x0, body.rest_y - body.y0) > _CAME_M and body.both >= _CAME_BOTH)


@njit(cache=True)
def _both_feet(body: Any) -> int:
    """In how many scans a person has shown both feet."""
    return _BOTH_SHOES if body.shoe >= SHOES or wears_shoes(body) else _BOTH_LEGS
