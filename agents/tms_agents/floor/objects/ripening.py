"""Which of the prints that rest are things: nobody's foot, no part of anybody, of a robot or of furniture."""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from tms_agents.floor.feet.own_feet import may_be_his
from tms_agents.floor.feet.person import is_person
from tms_agents.floor.feet.prints import HARDLY, lay_before
from tms_agents.floor.norm import norm
from tms_agents.floor.objects.patience import SPARE_S, patience
from tms_agents.floor.state import NEVER

Array = NDArray[np.float64]

#: What a print that rests turns out to be.
OBJECT, FURNITURE, WAITS = 1, 2, 3
#: A foot that has stood for so long (s) is one until he has been away from it for so long (s).
_HIS_S, _LEFT_S = 20.0, 8.0
#: One beam is believed after so many hits; what has never been seen whole after so long (s).
_SINGLE, _PART_S = 10, 4.0
#: So little is seen of what is hidden in part that it is believed after so long (s).
_SLIVER_S = 12.0
#: What is black or glossy is believed where so many scans saw nothing behind it; of all more than this share hit it.
_MUTES, _SELDOM = 10, 0.06
#: Somebody lost sight of so near (m) may still stand there for so long (s), on two feet so near each other (m) that are
#: seen again at the same time (within s).
_LOST_M, _STANDS_S, _PAIR_M, _TOGETHER_S = 0.35, 25.0, 0.45, 2.0
#: The same of somebody of whom one thing alone was seen that did not move.
_NOWHERE_S = 8.0
#: No foot looks narrower (m); as wide as this (m) is a shoe from its side. Whoever had it for a foot was there so
#: lately (s), or it was none.
_FOOT_M, _SHOE_M, _NEARBY_S = 0.06, 0.2, 10.0
#: Whoever is there, what is so broad (m) is furniture, where there are no robots.
_BROAD_M = 0.45
#: Robots stand for so long (s); what stands behind something is seen in part in this share of its sightings.
_PARKS_S, _COVERED = 60.0, 0.8
#: What is so far (m) from a robot's middle is no part of it; it drives so fast (m/s) while it is not seen.
_ROBOT_M, _DRIVES = 1.5, 0.7
#: Nobody stands with the feet so far apart (m) for so long (s).
_ASTRIDE_M, _ASTRIDE_S = 0.75, 4.0
#: A foot stands at a wall or a piece of furniture for so long (s) at most.
_LEANS_S = 6.0
#: What joins it may be a thing while who stands or drives beside both has not gone, for so long (s).
_JOINED_S = 3.0
#: What is joined to the background in more than this share of the scans is a part of it; what somebody brought who then
#: stayed for so long (s), in more than this share; where nothing has gone from the room, in more than the last.
_JOINED, _STAYS_S, _CLOSE, _FUSED = 0.5, 1.0, 0.75, 0.9
#: What is hidden for so long (s), and was just now (s), was in view for so long (s), in such a share of its sightings
#: whole, while everybody near it showed both feet elsewhere for so long (s).
_HIDDEN_S, _NOW_S, _SEEN_S, _SEEN, _SHOWN_S = 0.5, 0.3, 1.0, 0.3, 0.4


@njit(cache=True)
def find_ripe(
    prints: Any,
    bodies: Any,
    robots: bool,
    t: float,
    rest_s: float,
    alone_s: float,
    absorb_s: float,
    width_m: float,
    scattered: Array,
    intact: bool,
    ripe: NDArray[np.int64],
) -> int:
    """Prints that are an `OBJECT` or `FURNITURE` by now, or will be one (`WAITS`), into ``ripe``; how many.

    ``intact``: what is new was put there by somebody, nothing has gone from the room.
    """
    count = 0
    for j in range(prints.size):
        q = prints[j]
        ripe[j] = 0
        # What is not there now may be a foot that has just been lifted.
        if not q.used or q.revealed or (q.last < t and not _was_shown(q, t)):
            continue
        astride = q.owner >= 0 and _astride(q, prints, j, bodies, t)
        if q.owner >= 0 and not astride:
            continue
        age = t - (q.first if robots else q.rested)
        if age < rest_s or q.hits < 0.6 * q.looks or q.hits < 4:
            continue
        # What somebody put down may touch a wall.
        leans = age > (_LEANS_S if t - q.busy < alone_s else _JOINED_S if q.width < width_m else 0.0)
        if not astride and q.given == 0 and may_be_his(q, prints, bodies, t, scattered):
            continue
        joined = _FUSED if intact else _CLOSE if _brought(q) else _JOINED
        if q.attached > joined and q.given == 0:
            if leans and q.last == t:
                ripe[j] = FURNITURE
                count += 1
            continue
        broad = q.width > _BROAD_M and not robots
        if q.spread > (0.05 if broad else 0.03) or not _plain(q, age, t, rest_s):
            continue
        # Where somebody has stood for long he may be thought to have stepped on something else.
        his = q.owned - q.first > _HIS_S
        gone_s, spare_s = (_LEFT_S, _LEFT_S) if his else (alone_s, SPARE_S)
        alone = t - q.busy > gone_s or broad
        # What is mostly seen whole is no part of a robot.
        part = robots and 2 * q.whole < q.hits
        given = q.given == 1 and age > (_PART_S if part else 1.25 * rest_s)
        nobodys = alone or given or astride or q.spare >= spare_s
        if not nobodys and (t - q.owned < gone_s or not _third(q, bodies, t, rest_s)):
            continue
        if _somebodys(q, prints, j, bodies, t):
            continue
        if q.width < width_m:
            told = astride or t - q.rested >= patience(q, bodies, t, scattered)
            ripe[j] = OBJECT if told else WAITS
            count += 1
        elif alone and age > absorb_s:
            ripe[j] = FURNITURE
            count += 1
    return count


@njit(cache=True)
def joins(prints: Any, bodies: Any, t: float) -> bool:
    """Whether one of the prints seen now is a part of the room, or close to it, while a person is there."""
    there = False
    for b in range(bodies.size):
        there = there or is_person(bodies[b])
    if there:
        for j in range(prints.size):
            q = prints[j]
            if q.used and q.last == t and not q.revealed and q.attached > _JOINED:
                return True
    return False


@njit(cache=True)
def _was_shown(q: Any, t: float) -> bool:
    """Whether the print, hidden now, was in view long enough, and nobody's foot."""
    seen = q.last - q.rested > _SEEN_S and q.whole >= _SEEN * q.hits
    hidden = t - q.last > _HIDDEN_S and t - q.hidden < _NOW_S
    return bool(seen and q.spare >= _SHOWN_S and hidden)


@njit(cache=True)
def _somebodys(q: Any, prints: Any, j: int, bodies: Any, t: float) -> bool:
    """Whether the print j may be a foot of somebody unknown or lost there: hidden in part, wide, or there are two.

    What stands behind something new, and is never seen whole, may be a part of a robot that is near it.
    """
    if q.given:
        return False
    if q.covered > _COVERED * q.hits and t - q.rested < _PARKS_S and _robot_near(q, bodies, t):
        return True
    if t - q.first > _STANDS_S:
        return False
    his = q.owned >= q.first and t - q.busy < _NEARBY_S
    if q.width > _SHOE_M and (t - q.first < _PART_S or his):
        return True
    for b in range(bodies.size):
        body = bodies[b]
        if body.used and body.confirmed and body.stale and norm(body.x - q.x, body.y - q.y) < _LOST_M:
            # Who was found to be nowhere but on this is hardly there.
            since = q.rested if lay_before(q, body) else q.first
            nowhere = max(body.a_seen, body.b_seen) <= NEVER and t - since > _NOWHERE_S
            if q.whole < 0.5 * q.hits and not nowhere:
                return True
    if q.width < _FOOT_M:
        return False
    for o in range(prints.size):
        p = prints[o]
        other = o != j and p.used and p.owner < 0 and t - p.last < 0.5 and abs(p.first - q.first) < _TOGETHER_S
        if other and p.width > _FOOT_M and norm(p.x - q.x, p.y - q.y) < _PAIR_M:
            return True
    return False


@njit(cache=True)
def _robot_near(q: Any, bodies: Any, t: float) -> bool:
    """Whether a robot may be where the print is, as far as it can have driven since it was seen last."""
    for b in range(bodies.size):
        body = bodies[b]
        if body.used and body.machine and norm(body.x - q.x, body.y - q.y) < _ROBOT_M + _DRIVES * (t - body.seen):
            return True
    return False


@njit(cache=True)
def _astride(q: Any, prints: Any, j: int, bodies: Any, t: float) -> bool:
    """Whether the print j is taken for a foot of somebody whose other foot has stood for longer, too far away."""
    body = bodies[q.owner]
    other = body.b_print if body.a_print == j else body.a_print
    if body.robot or other < 0 or other == j or not prints[other].used or t - q.first < _ASTRIDE_S or q.whole == 0:
        return False
    p = prints[other]
    return bool(t - p.last < 0.3 and p.first <= q.first and norm(p.x - q.x, p.y - q.y) > _ASTRIDE_M)


@njit(cache=True)
def _plain(q: Any, age: float, t: float, rest_s: float) -> bool:
    """Whether enough has been seen of the print, ``age`` s old: so many beams, so often, and all of it."""
    # The smallest thing wanted is 3 cm wide and gives so many beams; one beam alone is believed later.
    # What is silent most of the time shows less of itself.
    seldom = t - q.silent < 1.0 and q.mutes >= _MUTES and q.hits > _SELDOM * (q.looks + q.mutes)
    quiet = seldom or (t - q.silent < 1.0 and q.hits >= 6)
    hidden = q.hits > HARDLY * q.whole and q.beams >= 2.0 and age > _SLIVER_S
    if q.beams < 0.6 * 0.03 / max(q.spacing, 1e-3) and not quiet and not hidden:
        return False
    if q.beams < 1.5 and not seldom and (age < 2.0 * rest_s or q.hits < 0.75 * q.looks or q.hits < _SINGLE):
        return False
    # What has never been seen whole may be a part of anything: of a robot, of somebody's feet.
    return bool(q.whole > 0 or quiet or age > (0.5 if q.given else 1.0) * _PART_S)


@njit(cache=True)
def _brought(q: Any) -> bool:
    """Whether the print, most often seen whole, came to rest while somebody was there, and he stayed for a moment."""
    return bool(q.busy - q.rested > _STAYS_S and q.beams >= 1.5 and 2 * q.whole > q.hits)


@njit(cache=True)
def _third(q: Any, bodies: Any, t: float, rest_s: float) -> bool:
    """Whether the print came to somebody who stands on two other feet."""
    third = False
    for b in range(bodies.size):
        body = bodies[b]
        if not body.used or not body.confirmed or body.stale or t - body.seen > 0.2:
            continue
        d = min(norm(body.ax - q.x, body.ay - q.y), norm(body.bx - q.x, body.by - q.y))
        both = t - body.a_seen < 0.2 and t - body.b_seen < 0.2
        came = t - q.first > 1.25 * rest_s and q.first > max(body.a_since, body.b_since)
        if both and d > 0.15 + 0.5 * q.width and came:
            third = True
        elif norm(body.x - q.x, body.y - q.y) < 0.6:
            return False
    return third
