"""The life of an object: born when it lies there and nobody stands at it, dead only when its place is seen empty."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from tms_agents.floor.events import Appeared, Candidates, FloorEvent, FloorLabel, Vanished
from tms_agents.floor.objects.candidates import candidates, near_movers
from tms_agents.floor.objects.ripening import WAITS, find_ripe
from tms_agents.floor.objects.visitors import Visitors
from tms_agents.floor.robots.recognizing import has_robot
from tms_agents.floor.scan.freespace import FREE, HIDDEN, HIT, PAST, QUIET, SILENT
from tms_agents.floor.settings import FloorSettings
from tms_agents.floor.state import free_slot, pack, unpack

Array = NDArray[np.float64]

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
#: A robot that was here so long ago (s) may still be.
_ROBOTS_S = 120.0
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

    def save(self) -> dict[str, Any]:
        """JSON values."""
        return {
            "things": pack(self.things),
            "visitors": self.visitors.save(self.things),
            "waiting": [[k, rested, who] for k, (rested, who) in self.waiting.items()],
            "robot_at": self.robot_at if math.isfinite(self.robot_at) else None,
        }

    def restore(self, saved: Any) -> None:
        """Raises KeyError, TypeError or ValueError where that is nothing that ``save`` gave."""
        self.things[:] = unpack(saved["things"], self.things)
        self.visitors.restore(self.things, saved["visitors"])
        self.waiting = {
            int(k): (float(rested), tuple((int(mover), float(p)) for mover, p in who))
            for k, rested, who in saved["waiting"]
        }
        self.robot_at = -math.inf if saved["robot_at"] is None else float(saved["robot_at"])

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

    def ripe(self, prints: Any, bodies: Any, t: float, scattered: Array, intact: bool = False) -> list[tuple[int, int]]:
        """Prints that rest, and what each is: `ripening.OBJECT` or `FURNITURE`.

        ``scattered`` (3,) is what `brightness.scatter` has learned; ``intact``: nothing has gone from the room.
        """
        if has_robot(bodies):
            self.robot_at = t
        s = self._settings
        if self._ripe.size != prints.size:
            self._ripe = np.zeros(prints.size, np.int64)
        if not find_ripe(
            prints,
            bodies,
            t - self.robot_at < _ROBOTS_S,
            t,
            s.rest_s,
            s.alone_s,
            s.absorb_s,
            s.object_width_m,
            scattered,
            intact,
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

    def born(self, index: int, prints: Any, bodies: Any, new_label: Callable[[], int], t: float) -> list[FloorEvent]:
        """The print ``index`` is an object; nothing, where there is no room for one."""
        print_ = prints[index]
        slot = free_slot(self.things)
        if slot < 0:
            return []
        print_["used"] = 0
        thing = self.things[slot]
        label = new_label()
        thing["used"], thing["label"] = 1, label
        self.visitors.forget(slot)
        thing["x"], thing["y"], thing["half"] = print_["x"], print_["y"], 0.5 * print_["width"]
        thing["hits"] = min(int(print_["whole"]), 5)
        thing["var"] = _SURFACE_VAR + 1e-4 / (thing["hits"] + 1)
        thing["since"], thing["seen"], thing["free_at"] = print_["rested"], print_["last"], print_["last"]
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
