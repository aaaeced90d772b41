"""Looks back at what was told since the board last rested, and puts it right where everything says otherwise."""

from __future__ import annotations

import math
from collections.abc import Sequence, Set
from dataclasses import replace

import numpy as np

from tms_agents.cabinet.baseline import Level
from tms_agents.cabinet.blocks import Block
from tms_agents.cabinet.caution import IN_HAND_S
from tms_agents.cabinet.episodes import Episode, Outcome, outcomes
from tms_agents.cabinet.events import CabinetEvent
from tms_agents.cabinet.geometry import Array
from tms_agents.cabinet.naming import Namer
from tms_agents.cabinet.plans import Known
from tms_agents.cabinet.presence import Presence
from tms_agents.cabinet.revising import Revision, current, order
from tms_agents.cabinet.settings import EstimatorSettings
from tms_agents.cabinet.stays import Shelf, Thing
from tms_agents.cabinet.steps import Step

#: An episode is looked at when the board has rested so long; the next one begins after so long a rest; later the last
#: one is looked at less often, and after so long a rest no more.
_LOOK_S, _RESTED_S, _RARELY_S, _CLOSED_S = 1.5, 2.5, 4.0, 20.0
_AGAIN_S = 2.0
#: Another outcome must be so sure, and what was told so improbable.
_SURE, _DOUBT = 0.9, 0.05
#: ... while something shakes the board, and before anything else was told.
_SURE_SHAKEN, _SURE_AT_ONCE = 0.98, 0.85
#: What was told and is so probable is looked at no more once the board rests.
_CERTAIN = 0.95
#: What is no more probable than that is not where the next episode begins.
_IMPROBABLE = 0.3
#: A verdict that is so sure ends the episode: the next change begins another one. Not where something does not weigh
#: what its tag says: the rest of it may follow.
_CLOSES = 0.97
#: How much more probable an outcome is that was told step by step.
_TOLD = 8.0
#: More often than that an episode is not put right: something else speaks against it.
_MOST_REVISIONS = 2
#: So long before the load changes the tag of what is brought may come into view.
_BROUGHT_S = 3.0
#: Log-odds that a thing was taken only after the load seemed to rest, and less with every round in which it was there.
_LATER, _LATE = -2.0, 0.5
#: Log-odds that the tag of what was taken is still in view, in the hand; how long that lasts; that it lasts for good.
_IN_HAND, _HELD_S, _KEPT = math.log(0.2), 1.5, math.log(0.01)
#: Rounds go wrong in ways of their own: no tag's evidence counts more than this.
_MOST_ODDS = 16.0

Told = tuple[frozenset[int], tuple[str | None, ...]]


class Hindsight:
    """Feed it every block while the load changes, and ask it now and then while it rests."""

    def __init__(self, shelf: Shelf, presence: Presence, namer: Namer, settings: EstimatorSettings) -> None:
        self._shelf, self._presence, self._namer, self._settings = shelf, presence, namer, settings
        self._before: list[Thing] | None = None
        self._episode: Episode | None = None
        self._uncertain = False
        self._looked = -math.inf
        self._sure = False
        #: How probable what was told is, where something shakes the board.
        self._likely = 1.0
        #: The tags that were in view when it was looked at.
        self._heard: frozenset[str] = frozenset()
        self._revisions = 0

    def changing(self, block: Block, level: Level, unwatched_since: float | None = None) -> None:
        """The load is not at rest; ``level`` is where it rested last. It may have left it while no samples came."""
        if self._before is not None:
            earliest = block.start if unwatched_since is None else unwatched_since
            self._episode = Episode(level.mean.copy(), level.variance.copy(), self._before, block.start, earliest)
            self._before, self._uncertain, self._revisions, self._likely = None, False, 0, 1.0
        self._sure = False
        if self._episode is not None:
            self._episode.add(block)

    def interrupt(self) -> None:
        """Samples are missing, and the zeros may have jumped meanwhile."""
        self._uncertain = True

    def forget(self, stays: Set[int]) -> None:
        """Stays that were over long before: it was found out by their tags, and the load tells nothing of them."""
        for things in (self._before, None if self._episode is None else self._episode.things):
            if things is not None:
                things[:] = [thing for thing in things if thing.id not in stays]

    def rest(
        self, t: float, level: Array, variance: Array, seconds: float, rested: float, *, shaking: bool
    ) -> list[CabinetEvent]:
        """The load rests at ``level``, (k,) g, for some ``seconds``; the last change ended at ``rested``."""
        events: list[CabinetEvent] = []
        again = seconds < _RARELY_S or t - self._looked >= _AGAIN_S
        due = seconds >= _LOOK_S and again and not (self._sure and self._present() == self._heard)
        if self._episode is not None and due and self._revisions < _MOST_REVISIONS:
            self._looked = t
            self._heard = self._present()
            events = self._revise(self._episode, t, level, variance, rested, shaking or self._uncertain)
        # What is improbable, though the board shakes too much for anything else to be sure, what comes next decides.
        if seconds >= (_RESTED_S if self._likely > _IMPROBABLE else _CLOSED_S):
            self._before = self._copies()
        if seconds >= _CLOSED_S:
            self._episode = None
        return events

    def verdict(self, step: Step, *, shaking: bool) -> Outcome | None:
        """What has happened up to the steady load of ``step``, where that is sure."""
        if self._episode is None:
            return None
        level, variance = step.before + step.change, step.variance - step.before_variance
        best = self._outcomes(self._episode, step.now, level, variance, step.settled, shaking or self._uncertain)[0]
        # What has been brought and is not there yet is on its way.
        coming = self._namer.fresh(self._episode.earliest - _BROUGHT_S).difference(best.new)
        return best if best.known and best.score >= _SURE_AT_ONCE and not coming else None

    def tell(self, outcome: Outcome, t: float) -> list[CabinetEvent]:
        """Make the shelf what a verdict says."""
        assert self._episode is not None
        events = self._revision(self._episode, outcome, t).events()
        known = {thing.id for thing in self._episode.things}
        new = [thing for i, thing in self._shelf.things.items() if i not in known]
        if outcome.score >= _CLOSES and not any(self._namer.misfits(thing) for thing in new):
            self._before = self._copies()
        return events

    def _revise(
        self, episode: Episode, t: float, level: Array, variance: Array, rested: float, shaking: bool
    ) -> list[CabinetEvent]:
        told = current(episode, self._shelf)
        found = _trusting(self._outcomes(episode, t, level, variance, rested, shaking), told)
        best = found[0]
        likely = sum(one.score for one in found if one.known and _same(one, told))
        self._sure, self._likely = likely > _CERTAIN, likely if shaking else 1.0
        enough = _SURE_SHAKEN if shaking else _SURE
        if not best.known or best.score < enough or _same(best, told) or likely > _DOUBT:
            return []
        self._revisions += 1
        self._likely = best.score
        return self._revision(episode, best, t).events()

    def _revision(self, episode: Episode, outcome: Outcome, t: float) -> Revision:
        return Revision(
            self._shelf,
            episode,
            outcome,
            t,
            pin=self._namer.pin,
            left=lambda thing: self._left(thing, t),
            weight=self._namer.weight,
        )

    def _outcomes(
        self, episode: Episode, t: float, level: Array, variance: Array, rested: float, shaking: bool
    ) -> list[Outcome]:
        things = self._shelf.things
        for thing in episode.things:
            if thing.id in things:
                thing.tag = things[thing.id].tag
        return outcomes(
            episode,
            t,
            level,
            variance,
            Known(
                {*self._namer.loose(), *(thing.tag for thing in things.values() if thing.tag is not None)},
                lambda tag: self._odds(tag, rested + IN_HAND_S),
                self._namer.weight,
                shaking,
                self._namer.fresh(episode.earliest - _BROUGHT_S),
                max(_IN_HAND - max(t - rested - IN_HAND_S, 0.0) / _HELD_S, _KEPT),
            ),
            self._shelf.geometry,
            self._settings.creep_per_hour,
        )

    def _odds(self, tag: str, since: float) -> tuple[float, float]:
        hit, false = self._settings.read_probability, self._settings.false_read_probability
        read = np.array(self._presence.looks(tag, since), dtype=bool)
        there = np.where(read, math.log(hit), math.log(1 - hit))
        gone = np.where(read, math.log(false), math.log(1 - false))
        # A slow hand takes a light thing after the load seemed to rest: in view for some rounds more.
        more = np.arange(len(read))
        left = np.append(there.cumsum() - there, 0.0)[: len(read)] + gone[::-1].cumsum()[::-1] - _LATE * more
        absent = max(float(gone.sum()), _LATER + float(left[1:].max(initial=-math.inf)))
        return float(np.logaddexp(there.sum(), -_MOST_ODDS)), float(np.logaddexp(absent, -_MOST_ODDS))

    def _present(self) -> frozenset[str]:
        return frozenset(self._presence.present())

    def _copies(self) -> list[Thing]:
        return [
            replace(thing, load=thing.load.copy(), variance=thing.variance.copy())
            for thing in self._shelf.things.values()
        ]

    def _left(self, thing: Thing, t: float) -> None:
        at = thing.centre(self._shelf.geometry)
        self._namer.left(thing, t, at.weight_g, at.weight_sd_g)


def _trusting(found: Sequence[Outcome], told: Told) -> list[Outcome]:
    """The same, with what was told step by step more probable: each step was explained by what the load was then."""
    weights = [one.score * (_TOLD if one.known and (_same(one, told) or _one(one, told)) else 1.0) for one in found]
    total = sum(weights)
    trusted = [replace(one, score=weight / total) for one, weight in zip(found, weights, strict=True)]
    return sorted(trusted, key=lambda one: -one.score)


def _one(outcome: Outcome, told: Told) -> bool:
    """Whether two loads without a tag that were told are one thing that was put down slowly."""
    gone, new = told
    return new.count(None) > 1 and (outcome.gone, order((*outcome.new, None))) == (gone, new)


def _same(outcome: Outcome, told: Told) -> bool:
    return (outcome.gone, order(outcome.new)) == told
