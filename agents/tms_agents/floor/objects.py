"""The life of an object: born when it lies there and nobody stands at it, dead only when its place is seen empty."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from tms_agents.floor.candidates import candidates, near_movers
from tms_agents.floor.events import Appeared, Candidates, FloorEvent, FloorLabel, Vanished
from tms_agents.floor.freespace import FREE, HIDDEN, HIT, PAST, QUIET, SILENT
from tms_agents.floor.norm import norm
from tms_agents.floor.own_feet import may_be_his
from tms_agents.floor.patience import SPARE_S, patience
from tms_agents.floor.prints import HARDLY, lay_before
from tms_agents.floor.settings import FloorSettings
from tms_agents.floor.visitors import Visitors

Array = NDArray[np.float64]

#: What a print that rests turns out to be.
OBJECT, FURNITURE, WAITS = 1, 2, 3
#: Sure that a place is free: log likelihood ratio, at most so much of it per scan (scans resemble each other), and per
#: scan that sees past the edge of what hides the thing.
_SURE, _PER_SCAN, _PER_GLIMPSE = 7.5, 1.5, 1.0
#: While it is hidden, looks past the edge of what hides it (mixed pixels) are forgotten in this time (s).
_FORGET_S = 2.0
#: Things overlap if they are nearer than this share of their half widths (and m).
_OVERLAP, _BESIDE_M = 0.6, 0.01
#: Parts of what is black or glossy are so near each other (m).
_PARTS_M = 0.1
#: One look is off by this at most (m).
_TRUST_M = 0.04
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
#: No foot looks narrower (m); as wide as this (m) is a shoe from its side.
_FOOT_M, _SHOE_M = 0.06, 0.2
#: Whoever is there, what is so broad (m) is furniture, where there are no robots.
_BROAD_M = 0.45
#: Robots stand for so long (s); what stands behind something is seen in part in this share of its sightings.
_PARKS_S, _COVERED = 60.0, 0.8
#: A robot that was here so long ago (s) may still be.
_ROBOTS_S = 120.0
#: Nobody stands with the feet so far apart (m) for so long (s).
_ASTRIDE_M, _ASTRIDE_S = 0.75, 4.0
#: A foot stands at a wall or a piece of furniture for so long (s) at most.
_LEANS_S = 6.0
#: What joins it may be a thing while who stands or drives beside both has not gone, for so long (s).
_JOINED_S = 3.0
#: A part of something is joined to it in this share of the scans; what somebody brought who stayed for so long (s), and
#: lies close to something, in less than that.
_JOINED, _STAYS_S, _CLOSE = 0.5, 1.0, 0.75
#: Surfaces lie this uncertain behind what is seen (m²).
_SURFACE_VAR = 0.006**2


@njit(cache=True)
def _within(difference: float) -> float:
    """At most so much: somebody's foot beside a thing looks like a part of it."""
    return min(max(difference, -_TRUST_M), _TRUST_M)


@njit(cache=True)
def _weigh(things: Any, looks: Any, t: float, dt: float) -> int:
    """Take in what a scan says of each thing; how many have been seen to be free for a while."""
    waiting = 0
    for k in range(things.size):
        thing, seen = things[k], looks[k]
        if not thing.used:
            continue
        if seen.verdict == HIT:
            thing.seen = t
            thing.rate += 0.02 * (1.0 - thing.rate)
            thing.solid += 0.02 * (1.0 - thing.solid)
            thing.free = 0.0
            thing.doubt = max(0.0, thing.doubt - 3.0)
            if seen.clean:
                thing.hits += 1
                gain = max(1.0 / (thing.hits + 1), 0.01)
                thing.x += gain * _within(seen.x - thing.x)
                thing.y += gain * _within(seen.y - thing.y)
                wider = 0.5 * seen.width - thing.half
                if thing.rate >= QUIET:
                    thing.half += gain * _within(wider)
                elif wider > 0.0:
                    # Now this part of it echoes, now that.
                    thing.half += max(gain, 0.1) * _within(wider)
                thing.var = _SURFACE_VAR + 1e-4 / (thing.hits + 1)
        elif seen.verdict == SILENT:
            # Black and glossy things do not always echo, but nothing is seen through them.
            thing.rate -= 0.02 * thing.rate
            thing.solid += 0.02 * (1.0 - thing.solid)
            thing.doubt = max(0.0, thing.doubt - _PER_SCAN)
        elif seen.verdict == FREE or seen.verdict == PAST:
            # Since the last look by any sensor, but no longer than a scan takes: between them it was hidden.
            thing.free += min(dt, t - thing.free_at, 0.2)
            most = _PER_SCAN if seen.verdict == FREE else _PER_GLIMPSE
            thing.doubt += min(most, -np.log(max(1.0 - thing.solid, 1e-3)))
            if thing.doubt < 4.0:
                thing.rate -= 0.02 * thing.rate
                thing.solid -= 0.02 * thing.solid
        elif seen.verdict == HIDDEN:
            fade = np.exp(-dt / _FORGET_S)
            thing.free *= fade
            thing.doubt *= fade
        if seen.verdict == HIT or seen.verdict == FREE or seen.verdict == PAST:
            thing.free_at = t
        if thing.free > 0.0:
            waiting += 1
    return waiting


@njit(cache=True)
def _somebodys(q: Any, prints: Any, j: int, bodies: Any, robots: bool, t: float) -> bool:
    """Whether the print j may be a foot of somebody unknown or lost there: hidden in part, wide, or there are two.

    Where there are ``robots``, what stands behind something new, and is never seen whole, may be a part of one.
    """
    if q.given:
        return False
    if robots and q.covered > _COVERED * q.hits and t - q.rested < _PARKS_S:
        return True
    if t - q.first > _STANDS_S:
        return False
    if q.width > _SHOE_M and (t - q.first < _PART_S or q.owned >= q.first):
        return True
    for b in range(bodies.size):
        body = bodies[b]
        if body.used and body.confirmed and body.stale and norm(body.x - q.x, body.y - q.y) < _LOST_M:
            # Who was found to be nowhere but on this is hardly there.
            since = q.rested if lay_before(q, body) else q.first
            nowhere = max(body.a_seen, body.b_seen) < 0.0 and t - since > _NOWHERE_S
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


@njit(cache=True)
def _ripe(
    prints: Any,
    bodies: Any,
    robots: bool,
    t: float,
    rest_s: float,
    alone_s: float,
    absorb_s: float,
    width_m: float,
    scattered: Array,
    ripe: NDArray[np.int64],
) -> int:
    """Prints that are an `OBJECT` or `FURNITURE` by now, or will be one (`WAITS`), into ``ripe``; how many."""
    count = 0
    for j in range(prints.size):
        q = prints[j]
        ripe[j] = 0
        # What is not there now may be a foot that has just been lifted.
        if not q.used or q.last < t or q.revealed:
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
        if q.attached > (_CLOSE if _brought(q) else _JOINED) and q.given == 0:
            if leans:
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
        if _somebodys(q, prints, j, bodies, robots, t):
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
def _any_robot(bodies: Any) -> bool:
    """Whether one of a size that robots have is there."""
    found = False
    for b in range(bodies.size):
        found |= bodies[b].used == 1 and bodies[b].machine == 1
    return found


class Objects:
    """Objects: the used ones of ``things``, their labels and events."""

    def __init__(self, things: Any, settings: FloorSettings) -> None:
        self.things = things
        self._settings = settings
        self.visitors = Visitors(things.size)
        #: For each print that waits: since when it has rested, and who was near when it seemed to be a thing.
        self.waiting: dict[int, tuple[float, Candidates]] = {}
        #: When there was a robot.
        self.robot_at = -math.inf
        #: Which went by themselves in the last scan, nobody being near: when they were seen last, x, y (m).
        self.walked: list[tuple[float, float, float]] = []
        self._ripe = np.zeros(0, np.int64)

    def weigh(self, looks: Any, bodies: Any, t: float, dt: float) -> list[FloorEvent]:
        """Take in what a scan says (`freespace.look`) of each thing: removals."""
        waiting = _weigh(self.things, looks, t, dt)
        self.visitors.attend(self.things, bodies, t)
        events: list[FloorEvent] = []
        self.walked = []
        if not waiting:
            return events
        due = (self.things["used"] == 1) & (self.things["free"] >= self._settings.free_s - 0.05)
        for index in np.flatnonzero(due & (self.things["doubt"] >= _SURE - 1e-9)).tolist():
            thing = self.things[index]
            who = candidates(self.visitors.of(index))
            events.append(Vanished(t, int(thing["label"]), float(thing["seen"]), t, who))
            thing["used"] = 0
            if not who:
                self.walked.append((float(thing["seen"]), *_xy(thing)))
        return events

    def ripe(self, prints: Any, bodies: Any, t: float, scattered: Array) -> list[tuple[int, int]]:
        """Prints that rest, and what each is: `OBJECT` or `FURNITURE`.

        ``scattered`` (3,) is what `shine.scatter` has learned.
        """
        if _any_robot(bodies):
            self.robot_at = t
        s = self._settings
        if self._ripe.size != prints.size:
            self._ripe = np.zeros(prints.size, np.int64)
        if not _ripe(
            prints,
            bodies,
            t - self.robot_at < _ROBOTS_S,
            t,
            s.rest_s,
            s.alone_s,
            s.absorb_s,
            s.object_width_m,
            scattered,
            self._ripe,
        ):
            return []
        found = [(j, int(self._ripe[j])) for j in np.flatnonzero(self._ripe).tolist()]
        there = {j: float(prints[j]["rested"]) for j in self.waiting if prints[j]["used"]}
        self.waiting = {j: one for j, one in self.waiting.items() if there.get(j) == one[0]}
        for j, kind in found:
            if kind == WAITS and j not in self.waiting:
                self.waiting[j] = float(prints[j]["rested"]), candidates(near_movers(bodies, prints[j]))
        return [(j, kind) for j, kind in found if kind != WAITS]

    def born(self, index: int, prints: Any, bodies: Any, label: int, t: float) -> list[FloorEvent]:
        """The print ``index`` is an object."""
        print_ = prints[index]
        print_["used"] = 0
        slot = int(self.things["used"].argmin())
        thing = self.things[slot]
        if thing["used"]:
            return []
        thing["used"], thing["label"] = 1, label
        self.visitors.forget(slot)
        thing["x"], thing["y"], thing["half"] = print_["x"], print_["y"], 0.5 * print_["width"]
        thing["hits"] = min(int(print_["whole"]), 5)
        thing["var"] = _SURFACE_VAR + 1e-4 / (thing["hits"] + 1)
        thing["since"], thing["seen"], thing["free_at"] = print_["rested"], t, t
        thing["free"], thing["doubt"], thing["part"], thing["part_by"], thing["part_hits"] = 0.0, 0.0, 0.0, -1, 0
        hits, mutes, looks = (int(print_[name]) for name in ("hits", "mutes", "looks"))
        thing["rate"] = min(0.99, max(0.2, hits / max(looks + mutes, 1)))
        thing["solid"] = min(0.99, max(0.5, (hits + mutes) / max(looks + mutes, 1)))
        _, who = self.waiting.pop(index, (0.0, candidates(near_movers(bodies, print_))))
        since, width = float(thing["since"]), float(print_["width"])
        return [Appeared(t, label, "object", _xy(thing), _cov(thing), False, since, who, width)]

    def at(self, print_: Any) -> bool:
        """Whether an object lies where the print is: another laser, or a mirror, shows it a little beside its place."""
        things = self.things[self.things["used"] == 1]
        away = np.hypot(things["x"] - print_["x"], things["y"] - print_["y"])
        # Of what is black or glossy now this part echoes, now that.
        quiet = (things["rate"] < QUIET) | (print_["silent"] > print_["first"])
        beside = np.where(quiet, _PARTS_M, _BESIDE_M)
        return bool((away < _OVERLAP * (things["half"] + 0.5 * print_["width"]) + beside).any())

    def labels(self) -> list[FloorLabel]:
        """The objects there are, hidden ones too."""
        return [
            FloorLabel(
                int(thing["label"]), "object", _xy(thing), _cov(thing), float(thing["since"]), float(thing["seen"])
            )
            for thing in self.things
            if thing["used"]
        ]


def _xy(thing: Any) -> tuple[float, float]:
    return float(thing["x"]), float(thing["y"])


def _cov(thing: Any) -> tuple[float, float, float]:
    variance = float(thing["var"])
    return variance, 0.0, variance
