"""The smart cabinet's estimator: samples of load cells and inventory rounds in, events out. Pure; no clock, no I/O."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, Self

import numpy as np

from tms_agents.cabinet.balance import Balance, search
from tms_agents.cabinet.blocks import Block, Blocks
from tms_agents.cabinet.bookkeeping import Bookkeeper
from tms_agents.cabinet.caution import IN_HAND_S, Caution
from tms_agents.cabinet.episodes import Outcome
from tms_agents.cabinet.events import CabinetEvent, Stay, Vanished
from tms_agents.cabinet.fusion import Evidence, Explanation, explain
from tms_agents.cabinet.geometry import Array, Geometry, KnownWeight, Zone
from tms_agents.cabinet.hindsight import Hindsight
from tms_agents.cabinet.naming import Namer
from tms_agents.cabinet.noise import Noise
from tms_agents.cabinet.plateau import Plateau
from tms_agents.cabinet.presence import Presence
from tms_agents.cabinet.settings import EstimatorSettings
from tms_agents.cabinet.stays import Shelf, Thing
from tms_agents.cabinet.steps import Step, StepDetector
from tms_agents.cabinet.wobble import Wobble

#: An unclear level that the load left sooner than this was one in passing.
_PASSING_S = 0.8
#: ... and one that is not longer, and explained with no more than this probability.
_GUESS_S, _GUESS = 2.5, 0.9
#: How long the load must rest before its sum is believed, and before what it says is corrected (everything since the
#: last rest has been looked at by then), and how sure another explanation must be.
_BALANCE_S, _CORRECT_S, _BALANCE_SURE = 1.0, 4.0, 0.9
#: How long it must be steady before what is not simple is decided by all that happened since the last rest.
_VERDICT_S = 1.5
#: What may be a part of several things that are being put must stay so for so long to be believed.
_PART_S = 3.0
#: A load that only seems to put an error right may be a light thing on its way: unless that is so sure, it must stay so
#: for so long.
_SETTLED_SURE, _SETTLED_S = 0.98, 2.5
#: How often a lifted thing's tag is still in view after ``IN_HAND_S``: while it is carried over the board.
_CARRIED = 0.1
#: A gap in the samples may be a board without power, whose zeros then jump by about so much.
_JUMP_G = 6.0


class CabinetEstimator:
    """One board on load cells with its antenna zones; frame of ``geometry`` in metres, grams, seconds.

    Times must not go back; each method returns what follows from its input, in the order in which it happened.
    """

    def __init__(
        self,
        geometry: Geometry,
        settings: EstimatorSettings | None = None,
        known: Mapping[str, KnownWeight] | None = None,
        *,
        zones: Mapping[str, Zone],
    ) -> None:
        self._geometry, self._settings = geometry, settings or EstimatorSettings()
        self._zones = dict(zones)
        self._blocks = Blocks(geometry.count, self._settings)
        self._noise = Noise(geometry.count, self._settings)
        self._wobble = Wobble(geometry.count)
        self._detector = StepDetector(geometry.count, self._settings)
        self._shelf = Shelf(geometry)
        self._presence = Presence(self._settings)
        self._known = dict(known or {})
        self._connect()
        self._interrupted: float | None = None
        self._looked = -math.inf
        self._rested = -math.inf
        self._plateau = Plateau()

    def _connect(self) -> None:
        self._book = Bookkeeper(self._shelf, self._settings)
        self._balance = Balance(self._shelf, self._settings)
        self._namer = Namer(self._shelf, self._presence, self._zones, self._known, self._settings)
        self._caution = Caution(self._shelf, self._presence, self._namer, self._settings)
        self._hindsight = Hindsight(self._shelf, self._presence, self._namer, self._settings)

    # --- input

    def load(self, t: float, grams: Sequence[float] | Array) -> list[CabinetEvent]:
        """Take one sample: calibrated grams per cell, (k,); NaN where a cell is unusable now.

        Raises:
            ValueError: another number of cells than the geometry has.
        """
        done = self._blocks.push(t, grams)
        if self._blocks.unusable:
            if self._interrupted is None:
                self._interrupted = t
                self._detector.interrupt()
                self._noise.interrupt()
                self._hindsight.interrupt()
            return []
        if done is None:
            return []
        return [event for block in self._noise.learn(*done) for event in self._take_block(block)]

    def inventory(self, t: float, zone: str, tags: frozenset[str]) -> list[CabinetEvent]:
        """Take one completed round of one antenna zone; an empty set means that nothing was read.

        Raises:
            ValueError: a zone that was not configured.
        """
        if zone not in self._zones:
            raise ValueError(f"there is no zone {zone!r}")
        self._presence.see(t, zone, tags)
        return self._name(t)

    def know(self, tag: str, weight: KnownWeight) -> None:
        """What the object with this tag weighs, from the object database."""
        self._namer.known[tag] = weight

    # --- state

    def stays(self) -> list[Stay]:
        """Everything on the board now, oldest first."""
        return self._shelf.stays()

    @property
    def unusable_cells(self) -> tuple[int, ...]:
        """Indices of the cells that are NaN, overloaded or stuck now; while there are any, the load is not judged."""
        return self._blocks.unusable

    @property
    def knows_load(self) -> bool:
        """Whether the load at rest is known, so that whatever changes is told; half a second or so after the start."""
        return self._detector.level.known

    @property
    def noise_sd_g(self) -> Array:
        """Standard deviation of a single sample of each cell at the moment, (k,) g; NaN until it is known."""
        return self._noise.sd_g

    @property
    def zero_g(self) -> Array:
        """What the cells show without the things on the board, (k,) g: drift and creep so far."""
        return self._detector.level.mean - self._shelf.total()

    @property
    def resting(self) -> bool:
        """Whether the load is steady and everything about it told."""
        return self._detector.resting and not self._blocks.unusable

    # --- block by block

    def _take_block(self, block: Block) -> list[CabinetEvent]:
        self._wobble.take(block, self._detector.level)
        if self._interrupted is not None:
            self._drifted(block.start - self._interrupted)
            self._interrupted = None
        self._balance.shaking = self._wobble.shaking
        step = self._detector.push(block)
        if not self._detector.resting:
            self._hindsight.changing(block, self._detector.level, self._detector.unwatched_since)
        if step is not None:
            return self._explain(step)
        if self._detector.resting and block.end - self._looked > 0.5:
            self._looked = block.end
            return self._rest(block.end)
        return []

    # --- at rest

    def _rest(self, t: float) -> list[CabinetEvent]:
        level, variance, seconds = self._detector.resting_level()
        if seconds <= 0:
            return []
        events = self._book.rest(t, level, variance, self._detector.since)
        if seconds < _BALANCE_S:
            return events
        if self._settings.knows_places:
            rested, shaking = self._rested, self._wobble.shaking
            revised = self._hindsight.rest(t, level, variance, seconds, rested, shaking=shaking)
            if revised:
                self._book.settling = None
                events += revised
        step = self._balance.rest(t, level, variance, self._book.measured(t, self._detector.since))
        if step is None:
            events += self._nothing(t)
        if step is not None and seconds >= _CORRECT_S:
            events += self._correct(step)
        return events

    def _nothing(self, t: float) -> list[CabinetEvent]:
        """Stays that turn out to weigh nothing, unless their tags are read."""
        events: list[CabinetEvent] = []
        for thing in self._balance.faded():
            if thing.tag is None or not self._presence.is_present(thing.tag):
                del self._shelf.things[thing.id]
                events.append(Vanished(t, thing.id, *thing.centre(self._geometry)[2:]))
        return events

    def _correct(self, step: Step) -> list[CabinetEvent]:
        """The sum of the stays is not what the cells show: what is more probable?"""
        best = search(step, self._balance, self._shelf, self._recent_evidence(), self._settings)[0]
        if best.kind == "unknown" or best.score < _BALANCE_SURE:
            return []
        return self._apply(step, best)

    def _recent_evidence(self) -> Evidence:
        def taken(thing: Thing) -> float:
            if thing.tag is None:
                return 0.0
            return self._presence.taken(thing.tag, max(self._rested, thing.since) + IN_HAND_S, 0.01)

        return Evidence(taken, self._namer.loose())

    # --- a step of the load

    def _explain(self, step: Step) -> list[CabinetEvent]:
        final = self._detector.is_final(step)
        if self._blocks.frozen(step.settled):
            self._detector.ignore(step) if final else self._detector.hold(step)
            return []
        steady = step.now - self._plateau.since(step)
        waited = math.inf if final else steady
        whole = self._whole(step)
        evidence = self._evidence(step)
        if whole is not None:
            evidence = replace(evidence, left=(whole.change, whole.variance), shaking=self._wobble.shaking)
        explanations = explain(step, self._shelf, evidence, self._settings)
        if steady > self._settings.patience_s and waited > self._settings.stubborn_s:
            # No hand presses for so long.
            explanations = [item for item in explanations if item.kind != "press"]
        best, *others = explanations
        if best.kind == "settled":
            doubtful = best.score < _SETTLED_SURE and abs(step.weight_g) > self._settings.min_weight_g
            if doubtful and steady < _SETTLED_S:
                self._detector.ignore(step) if final else self._detector.hold(step)
                return []
            self._detector.accept(step)
            self._rested = step.settled
            return []
        if best.kind == "unknown" and steady > _BALANCE_S and not final and whole is not None:
            self._rested = step.settled
            other = search(whole, self._balance, self._shelf, self._recent_evidence(), self._settings)[0]
            if other.kind != "unknown" and other.score > _BALANCE_SURE:
                self._detector.accept(step)
                return self._apply(whole, other)
        if best.kind in ("unknown", "press"):
            if waited < self._settings.stubborn_s:
                self._detector.hold(step)
            elif final:
                self._detector.ignore(step)
            else:
                self._detector.accept(step)
            return []
        odd = self._caution.odd(step, best)
        # A slide is simple, unless something else has been brought that may stand there now.
        several = best.several and (best.kind != "slide" or bool(self._namer.loose()))
        if self._settings.knows_places and (odd or several):
            outcome = self._hindsight.verdict(step, shaking=self._wobble.shaking) if steady >= _VERDICT_S else None
            if outcome is not None:
                return self._decided(step, outcome)
            if waited < self._settings.stubborn_s:
                self._detector.hold(step)
                return []
            if steady < _VERDICT_S:
                self._detector.ignore(step)
                return []
        arm = self._caution.may_be_an_arm(step, best)
        patience = self._settings.stubborn_s if arm else self._settings.patience_s
        unsure = arm or self._caution.unclear(step, explanations) or (odd and not _PASSING_S < waited < math.inf)
        # Several tags are new: one thing has come, and another is on its way.
        part = odd and len(self._namer.loose()) > 1
        if (unsure and waited < patience) or (part and waited < _PART_S):
            self._detector.hold(step)
            return []
        passing = steady < _PASSING_S and (unsure or best.several)
        # The load went on: rather all of a slow change than a guess at a part of it.
        passing = passing or (steady < _GUESS_S and best.score < _GUESS)
        if final and (arm or (part and steady < _PART_S) or passing):
            self._detector.ignore(step)
            return []
        if best.kind == "slide":
            self._book.doubt(step, best, others)
        self._detector.accept(step)
        return self._apply(step, best)

    def _decided(self, step: Step, outcome: Outcome) -> list[CabinetEvent]:
        """What is not simple is decided by all that happened since the last rest, as soon as that is sure."""
        self._detector.accept(step)
        self._rested = step.settled
        before = set(self._shelf.things)
        events = self._hindsight.tell(outcome, step.now)
        things = self._shelf.things
        self._book.settle(step, [things[i] for i in things.keys() - before], len(before - things.keys()))
        return events + self._name(step.now)

    def _name(self, t: float) -> list[CabinetEvent]:
        events = self._namer.update(t, resting=self._detector.resting)
        self._hindsight.forget({event.stay for event in events if isinstance(event, Vanished)})
        return events

    def _whole(self, step: Step) -> Step | None:
        """All that the stays and the zeros leave unexplained after ``step``, not only what is new."""
        if not self._balance.known:
            return None
        level, variance = step.before + step.change, step.variance - step.before_variance
        whole = self._balance.compare(step.onset, step.settled, step.now, level, variance)
        return replace(whole, unwatched_since=step.unwatched_since)

    def _apply(self, step: Step, explanation: Explanation) -> list[CabinetEvent]:
        for thing in explanation.removed:
            at = thing.centre(self._geometry)
            # What was measured badly when it came is known better now.
            badly = len(explanation.removed) == 1 and explanation.kind == "take" and not explanation.tight
            weight_g = -step.weight_g if badly else at.weight_g
            self._namer.left(thing, step.settled, weight_g, at.weight_sd_g)
        self._rested = step.settled
        self._book.newest = []
        events = self._book.apply(step, explanation, pressed=self._caution.may_be_pressed(step, explanation))
        for thing, tag in zip(self._book.newest, explanation.tags, strict=False):
            events.append(self._namer.pin(step.now, thing, tag))
        if explanation.kind == "take" and explanation.thing is not None and explanation.removed[0].tag is not None:
            events.append(self._namer.pin(step.now, explanation.thing, explanation.removed[0].tag))
        return events + self._name(step.now)

    def _evidence(self, step: Step) -> Evidence:
        settling = self._book.settling

        def taken(thing: Thing) -> float:
            if thing.tag is None:
                return 0.0
            later = step.settled + IN_HAND_S
            soon = self._presence.taken(thing.tag, step.settled)
            if sum(self._presence.rounds(thing.tag, later)) == 0:
                return soon
            return min(soon, self._presence.taken(thing.tag, later, _CARRIED))

        if settling is None:
            return Evidence(taken, self._namer.loose(), doubts=self._book.doubts)
        gap = max(step.onset - settling.posted, 0.0)
        return Evidence(taken, self._namer.loose(), settling.thing, math.exp(-gap / 0.7), self._book.doubts)

    def _drifted(self, seconds: float) -> None:
        rate = self._settings.creep_per_hour * (np.abs(self._shelf.total()) + 500.0)
        self._detector.level.loosen((rate * max(seconds, 0.0) / 3600.0) ** 2)
        self._balance.loosen(_JUMP_G)

    # --- across restarts

    def to_dict(self) -> dict[str, Any]:
        """State that survives a restart of the agent, as JSON values: stays, resting level, noise, learned weights."""
        noise = self._noise.variance
        return {
            "format": 1,
            "shelf": self._shelf.to_dict(),
            "balance": self._balance.to_dict(),
            "level": self._detector.level.mean.tolist() if self._detector.level.known else None,
            "noise": None if np.isnan(noise).any() else noise.tolist(),
            "learned": {tag: [w.mean_g, w.sd_g] for tag, w in self._namer.learned.items()},
        }

    @classmethod
    def from_dict(
        cls,
        state: Mapping[str, Any],
        geometry: Geometry,
        settings: EstimatorSettings | None = None,
        known: Mapping[str, KnownWeight] | None = None,
        *,
        zones: Mapping[str, Zone],
    ) -> Self:
        """Go on from a saved state: the load is compared with what it was then.

        Raises:
            ValueError: the state is of another format or of a board with other cells.
        """
        if state.get("format") != 1:
            raise ValueError("the saved state of the estimator has a format that this version does not know")
        try:
            self = cls(geometry, settings, known, zones=zones)
            self._shelf = Shelf.from_dict(geometry, state["shelf"])
            self._connect()
            if "balance" in state:
                self._balance.restore(state["balance"])
                self._balance.loosen(_JUMP_G)
            self._namer.learned = {tag: KnownWeight(*pair) for tag, pair in state["learned"].items()}
            if state["noise"] is not None:
                self._noise.variance = np.array(state["noise"], dtype=float)
            if state["level"] is not None:
                level = np.array(state["level"], dtype=float)
                # Drift of some hours without power.
                rate = 3 * self._settings.creep_per_hour * (np.abs(self._shelf.total()) + 500.0)
                self._detector.level.set(level, rate**2 + 1.0)
                self._detector.interrupt()
        except (KeyError, TypeError) as error:
            raise ValueError(f"the saved state of the estimator is damaged: {error}") from None
        return self
