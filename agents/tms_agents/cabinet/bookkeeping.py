"""From an explanation of a step to the things on the board, and to events; and better estimates while a load rests.

A thing that is lifted has vanished: its stay is over, also when its tag stays in view and it is put down again; that is
a new stay, which the tag and the weight identify. ``Moved`` is for a thing that never left the board: slid, put down
so quickly that the board was never steady without it, or simply known better than when it appeared.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tms_agents.cabinet.events import Appeared, CabinetEvent, Moved, Vanished, Weighed
from tms_agents.cabinet.fusion import Doubt, Explanation
from tms_agents.cabinet.geometry import Array
from tms_agents.cabinet.placing import Placed, Way, place, refine
from tms_agents.cabinet.settings import EstimatorSettings
from tms_agents.cabinet.stays import Shelf, Thing
from tms_agents.cabinet.steps import Step

#: So far the sum of the cells sways while it rests.
_SWAY_G = 5.0
#: What follows a thing so soon, and is so small a share of it, is the rest of it where nothing else has come or gone.
_REST_S, _REST = 3.0, 0.2


@dataclass(slots=True)
class Settling:
    """The thing put last: its load is the resting level minus ``before`` (k,), better the longer the load rests."""

    thing: Thing
    before: Array
    variance: Array
    posted: float
    #: It came with this step: if nothing remains of it, it was nothing.
    new: bool = True
    looked: bool = False
    told_again: bool = False
    #: How it came, where nothing else came with it, and what that told about its place.
    way: Way | None = None
    placed: Placed | None = None


class Bookkeeper:
    """Applies explanations to the shelf."""

    def __init__(self, shelf: Shelf, settings: EstimatorSettings) -> None:
        self._shelf, self._settings = shelf, settings
        self.settling: Settling | None = None
        #: What the last step put.
        self.newest: list[Thing] = []
        #: Slides that may have been another thing's.
        self.doubts: deque[Doubt] = deque(maxlen=8)

    def doubt(self, step: Step, chosen: Explanation, others: Sequence[Explanation]) -> None:
        """Remember which other things may have been slid by ``step``."""
        for other in others:
            if other.kind == "slide" and other.score > 0.01 * chosen.score:
                assert chosen.thing is not None and other.thing is not None
                odds = math.log(other.score / chosen.score)
                self.doubts.append(Doubt(chosen.thing, other.thing, step.change, odds))

    def apply(self, step: Step, explanation: Explanation, *, pressed: bool = False) -> list[CabinetEvent]:
        """Do to the shelf what ``explanation`` says about ``step``; a hand may still be ``pressed`` on what is put."""
        events: list[CabinetEvent] = []
        settling, self.settling = self.settling, None
        if explanation.undo is not None:
            events += self._undo(step.now, explanation.undo, explanation.removed)
        gone, gone_variance = np.zeros_like(step.change), np.zeros_like(step.change)
        for thing in explanation.removed:
            events.append(self._remove(thing, step, alone=explanation.kind == "take" and len(explanation.removed) == 1))
            gone, gone_variance = gone + thing.load, gone_variance + thing.variance
        if explanation.kind in ("put", "swap"):
            assert explanation.load is not None
            variance = step.variance + gone_variance
            thing = self._shelf.put(explanation.load, variance, since=step.settled, onset=step.earliest)
            before_variance = step.before_variance + gone_variance
            self.settling = Settling(thing, step.before - gone, before_variance, step.now)
            if explanation.kind == "put":
                self._place(self.settling, step)
            at = thing.centre(self._shelf.geometry)
            thing.told, thing.weighed = at.xy, not pressed
            events.append(Appeared(step.now, thing.id, at.xy, at.cov, at.weight_g, at.weight_sd_g, pressed))
            self.newest = [thing]
        elif explanation.kind in ("two", "joint"):
            events += self._put_two(step, explanation)
        elif explanation.kind in ("slide", "adjust"):
            assert explanation.thing is not None and explanation.load is not None
            thing = explanation.thing
            if settling is None or settling.thing is not thing:
                settling = Settling(
                    thing, step.before - thing.load, step.before_variance + thing.variance, step.now, new=False
                )
            thing.load = explanation.load
            thing.forget_place()
            settling.way = settling.placed = None  # that way led to a load that a hand pressed
            thing.variance = step.variance - step.before_variance + settling.variance
            self.settling = Settling(thing, settling.before, settling.variance, step.now, new=settling.new)
            events += self._tell(thing, step.now, always=explanation.kind == "slide")
        return events + self._regroup(step, explanation, gone)

    def settle(self, step: Step, new: Sequence[Thing], gone: int) -> None:
        """``new`` things have come up to ``step`` and so many are ``gone``, told otherwise: of one thing alone, or of
        what was put shortly before and this is the rest of, the load gets better known from now on."""
        settling, self.settling = self.settling, None
        if len(new) == 1:
            (thing,) = new
            level, variance = step.before + step.change, step.variance - step.before_variance
            before = np.maximum(thing.variance - variance, 0.1 * thing.variance)
            self.settling = Settling(thing, level - thing.load, before, step.now)
        elif not new and not gone and settling is not None and _is_rest(step, settling):
            settling.thing.forget_place()
            self.settling = Settling(settling.thing, settling.before, settling.variance, step.now, new=settling.new)

    def _regroup(self, step: Step, explanation: Explanation, load: Array) -> list[CabinetEvent]:
        """Some of a group have gone, which were held to weigh ``load``: that tells of the others, unless more came."""
        gone = {thing.id for thing in explanation.removed}
        partners = self._shelf.partners(gone)
        if not partners:
            return []
        if explanation.kind != "take":
            return [self._shelf.join(step.now, [*partners, *self.newest], gone)]
        self._shelf.tell_apart(partners, gone, step.change + load, step.variance)
        return self._tell(partners[0], step.now, always=True) if len(partners) == 1 else []

    def _place(self, settling: Settling, step: Step) -> None:
        """Nothing else came with this step: all of it tells where the thing stands."""
        placed = None if step.way is None else place(step.way, self._shelf.geometry)
        if placed is not None:
            settling.way, settling.placed = step.way, placed
            settling.thing.place(np.array(placed.xy), np.array(placed.variance), self._shelf.geometry)

    def _undo(self, now: float, doubt: Doubt, gone: Sequence[Thing]) -> list[CabinetEvent]:
        self.doubts.remove(doubt)
        doubt.thing.load = doubt.thing.load - doubt.change
        doubt.other.load = doubt.other.load + doubt.change
        for thing in (doubt.thing, doubt.other):
            thing.forget_place()
        stays = [thing for thing in (doubt.thing, doubt.other) if thing not in gone]
        return [event for thing in stays for event in self._tell(thing, now, always=True)]

    def _put_two(self, step: Step, explanation: Explanation) -> list[CabinetEvent]:
        events: list[CabinetEvent] = []
        assert explanation.load is not None and explanation.second is not None
        self.newest = []
        for load in (explanation.load, explanation.second):
            # Not told apart: each may stand anywhere.
            variance = explanation.variance if explanation.variance is not None else (0.35 * load.sum()) ** 2 + load * 0
            thing = self._shelf.put(load, variance, since=step.settled, onset=step.earliest)
            at = thing.centre(self._shelf.geometry)
            thing.told = at.xy
            events.append(Appeared(step.now, thing.id, at.xy, at.cov, at.weight_g, at.weight_sd_g))
            self.newest.append(thing)
        together = self._shelf.join(step.now, self.newest)
        if explanation.kind == "joint":
            events.append(together)
        return events

    def _remove(self, thing: Thing, step: Step, *, alone: bool) -> Vanished:
        del self._shelf.things[thing.id]
        at = thing.centre(self._shelf.geometry)
        if not alone:
            return Vanished(step.now, thing.id, at.weight_g, at.weight_sd_g)
        # Weighed twice: while it stood there for long, and by what is missing now, when a hand may still pull.
        stood, missing = 1 / max(at.weight_sd_g, 1e-3) ** 2, 1 / float(step.variance.sum())
        weight_g = (stood * at.weight_g - missing * step.weight_g) / (stood + missing)
        return Vanished(step.now, thing.id, weight_g, math.sqrt(1 / (stood + missing)))

    def rest(self, now: float, level: Array, variance: Array, since: float) -> list[CabinetEvent]:
        """The load has rested at ``level`` from ``since`` on: sharpen the thing that was put last, and weigh it."""
        return self._sharpen(now, level, variance, since) + self._weigh(now)

    def _weigh(self, now: float) -> list[CabinetEvent]:
        events: list[CabinetEvent] = []
        for thing in self._shelf.things.values():
            if thing.weighed or now - thing.since < self._settings.untagged_s:
                continue
            thing.weighed = True
            if not thing.joint:  # else their sum has been told
                events.append(Weighed(now, thing.id, *thing.centre(self._shelf.geometry)[2:]))
        return events

    def _sharpen(self, now: float, level: Array, variance: Array, since: float) -> list[CabinetEvent]:
        settling = self.settling
        if settling is None or self.measured(now, since) is None:
            return []
        thing = settling.thing
        thing.load, thing.variance = level - settling.before, variance + settling.variance
        thing.load = thing.load + _sway(thing)
        if settling.way is not None and settling.placed is not None:
            at, spread = refine(settling.way, settling.placed.tail, thing.load, variance, self._shelf.geometry)
            thing.place(at, spread, self._shelf.geometry)
        if settling.new and float(thing.load.sum()) < 0.75 * self._settings.min_weight_g:
            # It was nothing after all.
            self.settling = None
            del self._shelf.things[thing.id]
            return [Vanished(now, thing.id, *thing.centre(self._shelf.geometry)[2:])]
        rested = now - settling.posted
        if not settling.looked and rested >= self._settings.refine_after_s:
            settling.looked = True
            return self._tell(thing, now)
        if not settling.told_again and rested >= self._settings.refine_again_s and self._settings.knows_places:
            # Not that it has moved: who fetches it shall have the best of what is known.
            settling.told_again = True
            return self._tell(thing, now, always=True)
        return []

    def measured(self, now: float, since: float) -> int | None:
        """The stay that is sharpened while the load rests as it has ``since`` then."""
        settling = self.settling
        if settling is None or now - settling.posted > self._settings.refine_until_s or since > settling.posted:
            return None  # or another change has come, which was not its
        return settling.thing.id

    def _tell(self, thing: Thing, now: float, *, always: bool = False) -> list[CabinetEvent]:
        at = thing.centre(self._shelf.geometry)
        offset = np.subtract(at.xy, thing.told)
        far = float(np.hypot(*offset)) > self._settings.refine_m
        cov = np.array([[at.cov[0], at.cov[1]], [at.cov[1], at.cov[2]]]) + 1e-8 * np.eye(2)
        sure = float(offset @ np.linalg.solve(cov, offset)) > self._settings.refine_sd**2
        if not (always or (far and sure)):
            return []
        thing.told = at.xy
        return [Moved(now, thing.id, at.xy, at.cov)]


def _is_rest(step: Step, settling: Settling) -> bool:
    soon = step.onset - settling.posted < _REST_S
    return soon and abs(step.weight_g) < _REST * float(settling.thing.load.sum())


def _sway(thing: Thing) -> Array | float:
    """What a thing whose tag tells its weight seems to weigh beside that is mostly a level that sways, (k,) g."""
    if thing.known is None or thing.joint:
        return 0.0
    off, variance = thing.known.mean_g - float(thing.load.sum()), float(thing.variance.sum()) + _SWAY_G**2
    both = variance + thing.known.sd_g**2
    return 0.0 if off**2 > 16.0 * both else off * variance / both / len(thing.load)
