"""What is due for each body, scan by scan: is it believed, lost, back, gone, furniture, or one foot of somebody?"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from tms_agents.floor.feet.bodies import misled
from tms_agents.floor.feet.person import is_person
from tms_agents.floor.movers.flickering import flickers, note_stay
from tms_agents.floor.movers.lone import count_lone
from tms_agents.floor.movers.pair import is_pair
from tms_agents.floor.movers.parked import BESIDE, KNOWN, PARKED_S, WIDE_M, is_footless, is_parked, is_piece
from tms_agents.floor.norm import norm
from tms_agents.floor.scan.freespace import FREE, HIDDEN, UNSEEN, WALLED, Sight, clear
from tms_agents.floor.scan.masks import distance
from tms_agents.floor.scan.no_echo import vacant

Array = NDArray[np.float64]

#: What `review` finds of a body; one that has moved and is broad, and new, may be furniture that is pushed; one that
#: rests and shows one broad thing alone may be a piece of it; what is no feet is a thing, whoever it was; furniture of
#: which now this comes back, now that.
NOTHING, CONFIRM, LOST, BACK, GONE, MOVED, BROAD, PIECE, THING, FLICKERS = 0, 1, 2, 3, 4, 5, 6, 7, 8, 9
#: What is new for so long (s) may turn out to be furniture.
_NEW_S = 30.0
#: A person of whom one foot alone is seen, unmoved, for so long (s) is not there.
_LONE_S = 4.0
#: Of what flickers now this is seen, now that: not one thing alone for so long (s).
_SINGLE_S = 5.0
#: No leg is broader (m).
WIDEST_LEG_M = 0.2
#: What is seen is remembered for so long (s).
_MISSED_S = 2.5
#: Who stays within this (m) rests.
_REST_M = 0.15
#: How much what is seen of a mover must look like feet (`footlike`) in the long run if it is so narrow (m) in the mean.
_QUALITY, _THIN_M = 0.3, 0.05
#: Who is believed was seen so often, and in this share of the scans that should have shown him.
_HITS, _STEADY = 4.0, 0.6
#: Of who is believed every sighting looks so much like feet (`footlike`), in the mean.
LIKELY = 0.45
#: Who walks is believed after so long (s), or never.
_UNSURE_S = 6.0
#: Where somebody began looks free, or he still stands there, within this (m).
_BEGAN_M, _STILL_THERE_M = 0.03, 0.12
#: What somebody has put down is so near him (m), also when he has gone on for a moment.
_PUT_M, _PUT_S = 1.2, 3.0
#: Places on the way of one who is hidden that are looked at: so many, so far apart (m).
_LOOKS, _LOOK_M = 4, 0.5
#: Two of whom so near each other (m) one foot alone is seen are one, if the younger has shown two in less than this
#: share of the scans.
_UNITE_M, _BOTH = 0.45, 0.25
#: A robot of known outline is looked for behind others for so long (s).
_BEHIND_S = 4.0
#: A mover is told again when it has moved so far (m).
_TELL_M = 0.05


@njit(cache=True)
def _is_put(bodies: Any, b: int, t: float) -> bool:
    """Whether one foot of a body not yet believed has never moved, and somebody was beside it: it may be a thing."""
    body = bodies[b]
    a = t - body.a_seen < 0.5 and body.a_since <= body.first
    if not a and not (t - body.b_seen < 0.5 and body.b_since <= body.first):
        return False
    for o in range(bodies.size):
        other = bodies[o]
        person = o != b and is_person(other) and t - other.seen < _PUT_S
        if person and norm(other.x - body.x0, other.y - body.y0) < _PUT_M:
            return True
    return False


@njit(cache=True)
def _has_come(body: Any, t: float, sight: Sight) -> bool:
    """Whether it has gone from where it began: of something dark that stands there parts flicker, here and there."""
    a = body.a_seen == t and norm(body.ax - body.x0, body.ay - body.y0) < _STILL_THERE_M
    if a or (body.b_seen == t and norm(body.bx - body.x0, body.by - body.y0) < _STILL_THERE_M):
        return True
    return bool(vacant(body.x0, body.y0, _BEGAN_M, sight))


@njit(cache=True)
def _accompanied(bodies: Any, b: int, t: float) -> bool:
    """Whether a person is so near something wide that it may be pushed."""
    for o in range(bodies.size):
        other = bodies[o]
        person = o != b and is_person(other) and t - other.seen < 0.5
        if person and norm(other.x - bodies[b].x, other.y - bodies[b].y) < 0.6 + 0.5 * bodies[b].far:
            return True
    return False


@njit(cache=True)
def _comes_out(body: Any, sight: Sight) -> bool:
    """Whether who walks on behind something would be out of reach, or behind a wall, when it hides him no more."""
    dx, dy = body.x - body.told_x, body.y - body.told_y
    far = norm(dx, dy)
    if body.robot or far < _REST_M:
        return False
    for i in range(1, _LOOKS + 1):
        ahead = i * _LOOK_M / far
        view = clear(body.x + ahead * dx, body.y + ahead * dy, 0.15, sight)
        if view != HIDDEN:
            return bool(view != FREE)
    return False


class Waits(NamedTuple):
    """Of `settings.FloorSettings`, what `review` has to know."""

    confirm_s: float
    confirm_m: float
    leave_s: float
    hidden_s: float
    stale_s: float


@njit(cache=True)
def review(
    bodies: Any,
    t: float,
    dt: float,
    sight: Sight,
    waits: Waits,
    actions: NDArray[np.int64],
    inside: bool,
    learned: bool,
    legs: bool,
) -> None:
    """What is due for each body, into ``actions``; drops tentative ones that came to nothing.

    ``inside``: walls are known. ``learned``: the room is. ``legs``: it is known that
    people show legs here, not shoes.
    """
    for b in range(bodies.size):
        body = bodies[b]
        actions[b] = NOTHING
        if not body.used:
            continue
        unseen = t - body.seen
        broad = body.wide > 0.3 or body.far > (WIDE_M if body.confirmed else WIDEST_LEG_M) or body.from_furniture == 1
        if broad and unseen == 0.0 and norm(body.vx, body.vy) > 0.08:
            body.pushed += 0.08 * ((1.0 if _accompanied(bodies, b, t) else 0.0) - body.pushed)
        body.missed += min(1.0, dt / _MISSED_S) * ((1.0 if unseen > 0.0 else 0.0) - body.missed)
        if unseen == 0.0:
            if norm(body.x - body.rest_x, body.y - body.rest_y) > _REST_M:
                body.rest_x, body.rest_y, body.rest_at = body.x, body.y, t
            note_stay(body, dt, legs)
        if not body.confirmed:
            actions[b] = _new(bodies, b, t, sight, waits, learned)
        elif unseen == 0.0:
            actions[b] = _seen(bodies, b, t, dt, sight, legs)
        else:
            actions[b] = _not_seen(body, t, dt, sight, waits, inside)


@njit(cache=True)
def _new(bodies: Any, b: int, t: float, sight: Sight, waits: Waits, learned: bool) -> int:
    """What is due for a body that is not believed yet; it is dropped if it came to nothing."""
    body = bodies[b]
    unseen = t - body.seen
    way = norm(body.x - body.x0, body.y - body.y0)
    age = body.seen - body.first
    furniture = body.from_furniture == 1 or body.pushed > BESIDE
    parked = furniture and t - body.rest_at > PARKED_S
    stays = (age > 3.0 and way < 0.15) or (age > _UNSURE_S and body.wide < 0.3 and body.from_furniture == 0)
    pair = stays and is_pair(body, t)
    if unseen > 0.45 or (stays and not pair) or parked or body.hits < 0.5 * body.looks - 1.0:
        body.used = 0
        return NOTHING
    if unseen > 0.0:
        return NOTHING
    if body.footprint:
        return CONFIRM
    beside, halved, part = np.inf, False, False
    for o in range(bodies.size):
        if o != b and bodies[o].used and bodies[o].confirmed and not bodies[o].stale:
            away = norm(bodies[o].x - body.x, bodies[o].y - body.y)
            # Who begins beside somebody may be he, and what stands there what he has put down.
            beside = min(beside, away, norm(bodies[o].x - body.x0, bodies[o].y - body.y0))
            # A part of somebody who is wide: legs that are one thing to the laser fall apart now and then.
            part = part or away < 0.12 + 0.5 * bodies[o].width
            # One foot of somebody there is not seen now: this may be it.
            if away < 0.6 and not bodies[o].robot and max(t - bodies[o].a_seen, t - bodies[o].b_seen) > 0.3:
                halved = True
    if part or (pair and (halved or not learned or body.score < LIKELY * body.hits)):
        body.used = 0
        return NOTHING
    if pair:
        return CONFIRM
    needed_s = waits.confirm_s if beside > 0.6 else 3.0 * waits.confirm_s
    needed_m = waits.confirm_m if beside > 0.6 else 1.5 * waits.confirm_m
    if halved:
        needed_s = 8.0 * waits.confirm_s
    if not learned:
        needed_s, needed_m = 2.0 * needed_s, 2.0 * needed_m
    if body.wide > 0.5:
        # Furniture that is pushed aside looks like a robot at first.
        needed_s, needed_m = 2.0 * needed_s, 2.0 * needed_m
    steady = body.hits >= max(_HITS, _STEADY * body.due)
    if age >= needed_s and way >= needed_m and steady and body.score >= max(3.0, LIKELY * body.hits):
        came = _has_come(body, t, sight)
        return CONFIRM if came and not _is_put(bodies, b, t) else NOTHING
    return NOTHING


@njit(cache=True)
def _seen(bodies: Any, b: int, t: float, dt: float, sight: Sight, legs: bool) -> int:
    """What is due for a body that is believed, and seen now."""
    body = bodies[b]
    count_lone(bodies, b, t, dt, sight)
    single = not body.robot and body.wide < 0.15 and max(t - body.a_seen, t - body.b_seen) > 0.9
    body.single = body.single + dt if single else 0.0
    if body.lone > _LONE_S or (misled(body) and body.hits > KNOWN):
        # One thing that does not move is no person: whoever it was is somewhere else.
        return LOST
    if (body.quality < _QUALITY and body.width < _THIN_M) or misled(body) or is_parked(body, t, legs):
        return THING
    if flickers(body, legs, t):
        # One thing alone does not flicker.
        return THING if body.single > _SINGLE_S else FLICKERS
    if body.stale:
        return BACK
    if int(t) > int(t - dt) and is_piece(body, t):
        # Once a second: to look what has gone from the background takes longer than all of this.
        return PIECE
    if norm(body.x - body.told_x, body.y - body.told_y) > _TELL_M:
        new = t - body.first < _NEW_S and body.from_furniture == 0
        return BROAD if new and (body.wide > 0.5 or is_footless(body)) else MOVED
    return NOTHING


@njit(cache=True)
def _not_seen(body: Any, t: float, dt: float, sight: Sight, waits: Waits, inside: bool) -> int:
    """What is due for a body that is believed, and not seen now."""
    unseen = t - body.seen
    if unseen > (_BEHIND_S if body.footprint else 0.12):
        view = clear(body.x, body.y, 0.15, sight)
        if view == FREE:
            body.clear += dt
        elif view == UNSEEN or (view == WALLED and not inside):
            # Where no walls are known, who walks on out of sight is soon far.
            walks = not inside and norm(body.x - body.told_x, body.y - body.told_y) > _REST_M
            body.clear += dt if walks else 0.5 * dt
        elif view == HIDDEN and not inside and _comes_out(body, sight):
            body.clear += 0.5 * dt
        elif view == HIDDEN:
            body.clear = max(0.0, body.clear - 0.5 * dt)
    if body.clear > waits.leave_s or unseen > waits.hidden_s:
        return GONE
    return LOST if unseen > waits.stale_s and not body.stale else NOTHING


@njit(cache=True)
def unseen(bodies: Any, since: float, rows: NDArray[np.int64]) -> int:
    """Fill ``rows`` (n,) with the movers, not yet stale, that were not seen ``since`` then: how many there are."""
    count = 0
    for b in range(bodies.size):
        body = bodies[b]
        if body.used and body.confirmed and not body.stale and body.seen < since:
            rows[count] = b
            count += 1
    return count


@njit(cache=True)
def outside(bodies: Any, t: float, region: Array, far: float, rows: NDArray[np.int64]) -> int:
    """Fill ``rows`` (n,) with the movers seen at t ``far`` (m) out of the ``region`` (k, 2): how many there are."""
    count = 0
    for b in range(bodies.size):
        body = bodies[b]
        if body.used and body.confirmed and body.seen == t and distance(region, body.x, body.y) > far:
            rows[count] = b
            count += 1
    return count


@njit(cache=True)
def doubled(bodies: Any) -> int:
    """A mover that is another one, with one foot each at one place: the younger; -1 if there is none."""
    for b in range(bodies.size):
        body = bodies[b]
        if not (body.used and body.confirmed and body.single > 0.5 and body.both < _BOTH * body.hits):
            continue
        for o in range(bodies.size):
            other = bodies[o]
            lone = other.used and other.confirmed and other.single > 0.5 and other.label < body.label
            if lone and norm(other.x - body.x, other.y - body.y) < _UNITE_M:
                return b
    return -1
