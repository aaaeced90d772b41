"""Mass balance: at rest the cells show their zeros and the sum of all loads. If they do not, an explanation was wrong.

Zeros drift and loads creep slowly (`ledger`). When the load at rest is beyond what that allows, every set of stays that
may be over is tried, with and without one new thing, and one stay that was measured badly or slid. Tags count.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Collection, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from tms_agents.cabinet.densities import PutDensity, normal
from tms_agents.cabinet.fusion import Evidence, Explanation, Kind
from tms_agents.cabinet.geometry import Array
from tms_agents.cabinet.ledger import Ledger
from tms_agents.cabinet.settings import EstimatorSettings
from tms_agents.cabinet.stays import Shelf, Thing
from tms_agents.cabinet.steady import chi_square_limit
from tms_agents.cabinet.steps import Step

#: Prior odds: a stay is over and nobody told, a thing is there and nobody told, a stay was measured badly, or slid.
_OVER, _NEW, _MEASURED, _LATE_MEASURED, _SLID = 0.02, 0.05, 0.05, 0.003, 1e-3
#: The tag of something new was left with a stay that is over; weights are spread over so many g, and told so well.
_MISNAMED, _WEIGHTS_G, _ALIKE_G = 0.02, 500.0, 1.0
#: ... something else, and that the zeros have moved by some grams.
_UNKNOWN, _MOVED, _MOVED_G = 1e-3, 0.02, 8.0
#: The zero moves by so much per square root of an hour, a resting level is never better known than this, g.
_WALK_G, _FLOOR_G = 6.0, 1.0
#: A board that is shaken swings by so much.
_SHAKEN_G = 6.0
#: Up to so many stays may be over at once.
_MOST_OVER, _MANY = 3, 10
#: What nothing explains for so long is a zero that has moved.
_GIVEN_UP_S = 60.0


class Balance:
    """The zeros, (k,) g, and what the load at rest says against the sum of the stays."""

    def __init__(self, shelf: Shelf, settings: EstimatorSettings) -> None:
        self._shelf, self._settings = shelf, settings
        self._ledger: Ledger | None = None
        #: When the zeros were followed last.
        self._seen = -math.inf
        self._off_since: float | None = None
        #: When the sum was right last.
        self.right_at = -math.inf
        #: Something shakes the board, so that its level may swing.
        self.shaking = False
        self._whole_limit = chi_square_limit(settings.change_sd, shelf.geometry.count) / settings.change_sd**2

    @property
    def known(self) -> bool:
        return self._ledger is not None

    def loosen(self, grams: float) -> None:
        """The zeros may have jumped by so much each."""
        if self._ledger is not None:
            self._ledger.walk(grams**2)

    def rest(self, now: float, level: Array, variance: Array, measured: int | None = None) -> Step | None:
        """The load rests at ``level``, (k,) g: follow the zero, or return what is too much or too little.

        ``measured``: the stay whose load is being measured by the same rest.
        """
        if self._ledger is None:
            self._ledger = Ledger(level - self._shelf.total(), variance + _FLOOR_G**2)
            self._seen = now
            self._ledger.keep(self._shelf.things)
            return None
        step = self.compare(now, now, now, level, variance)
        if not self.off(step):
            self._off_since, self.right_at = None, now
            if not self.shaking:  # a level that swings tells nothing of the zeros
                self._ledger.observe(level, variance + _FLOOR_G**2)
                self._ledger.teach(self._shelf.things, measured)
            return None
        if self._off_since is None:
            self._off_since = now
        if now - self._off_since > _GIVEN_UP_S:
            self._ledger.walk(step.change**2)
            self._ledger.observe(level, variance + _FLOOR_G**2)
            self._off_since = None
            return None
        return step

    def faded(self) -> list[Thing]:
        """Stays that turn out to weigh next to nothing."""
        return [] if self._ledger is None else [self._shelf.things[i] for i in self._ledger.faded()]

    def compare(self, onset: float, settled: float, now: float, level: Array, variance: Array) -> Step:
        """The step from what the stays make of the zeros to ``level``."""
        assert self._ledger is not None
        # Creep of what stands there: a random walk that has gone through its share of the load after an hour, and has
        # come to an end by then where nobody looked for longer.
        hours = min(max(now - self._seen, 0.0) / 3600.0, 1.0)
        self._seen = now
        creep = 3 * self._settings.creep_per_hour * np.abs(self._shelf.total())
        self._ledger.walk((_WALK_G**2 + creep**2) * hours)
        self._ledger.keep(self._shelf.things)
        before, spread = self._ledger.expected()
        none = np.zeros((0, len(level)))
        both = variance + spread + _FLOOR_G**2 + (_SHAKEN_G**2 if self.shaking else 0.0)
        return Step(onset, settled, now, level - before, both, before, spread, none, none, 1.0)

    def without(self, stays: Collection[int], step: Step) -> tuple[Array, Array]:
        """What would be left of the level of ``step``, (k,) g, were these stays over, and its variance, (k,) g^2."""
        assert self._ledger is not None
        expected, spread = self._ledger.expected(stays)
        return step.before + step.change - expected, step.variance - step.before_variance + spread

    def off(self, step: Step) -> bool:
        total = step.weight_g**2 / float(step.variance.sum())
        whole = float((step.change**2 / step.variance).sum()) / self._whole_limit
        return max(total, whole) > self._settings.change_sd**2

    def to_dict(self) -> dict[str, Any]:
        return {} if self._ledger is None else self._ledger.to_dict() | {"seen": self._seen}

    def restore(self, state: dict[str, Any]) -> None:
        if "cov" in state:
            self._ledger = Ledger.from_dict(state)
            self._seen = float(state.get("seen", -math.inf))


def search(
    step: Step, balance: Balance, shelf: Shelf, evidence: Evidence, settings: EstimatorSettings
) -> list[Explanation]:
    """Explanations of ``step``, which is what the stays leave unexplained; the most probable first."""
    things = list(shelf.things.values())
    weights = [weight for weight in evidence.loose.values() if weight is not None]
    put = PutDensity(shelf.geometry, settings.min_weight_g, weights)
    taken = {thing.id: evidence.taken(thing) for thing in things}
    spreads = {thing.id: thing.at(step.now, settings.creep_per_hour) for thing in things}
    moved = math.log(_MOVED) + normal(step.change, step.variance + _MOVED_G**2)
    other = math.log(_UNKNOWN) + put.anything(step.change, step.variance)
    found = [Explanation("unknown", float(np.logaddexp(moved, other)))]
    most = _MOST_OVER if len(things) <= _MANY else 2
    sets = [those for n in range(min(most, len(things)) + 1) for those in itertools.combinations(things, n)]
    if len(things) > most:
        sets.append(tuple(things))
    for those in sets:
        left, variance = balance.without([thing.id for thing in those], step)
        prior = sum(math.log(_OVER) + taken[thing.id] for thing in those)
        if those:
            found.append(Explanation("take", prior + normal(left, variance), removed=those))
        score = put(left, variance)
        if score > -math.inf:
            kind: Kind = "swap" if those else "put"
            found.append(Explanation(kind, prior + math.log(_NEW) + score, removed=those, load=left))
    found += _misnamed(step, balance, things)
    if settings.knows_places:
        found += _measured_badly(step, things, spreads, taken, put, balance.right_at)
    top = max(item.score for item in found)
    all_of_them = sum(math.exp(item.score - top) for item in found)
    ranked = sorted(found, key=lambda item: -item.score)
    return [replace(item, score=math.exp(item.score - top) / all_of_them) for item in ranked]


def _misnamed(step: Step, balance: Balance, things: Sequence[Thing]) -> list[Explanation]:
    """Its tag is read, but from where a thing without one has come since then: the same thing, moved."""
    found = []
    for old in [thing for thing in things if thing.tag is not None and not thing.joint]:
        left, variance = balance.without([old.id], step)
        score = math.log(_OVER * _MISNAMED) + normal(left, variance)
        for new in [thing for thing in things if thing.tag is None and thing.since > old.since and not thing.joint]:
            apart = float((new.load - old.load).sum())
            sd = math.sqrt(float((new.variance + old.variance).sum())) + _ALIKE_G
            alike = math.log(_WEIGHTS_G / sd) - 0.5 * (apart / sd) ** 2
            found.append(Explanation("take", score + alike, removed=(old,), thing=new))
    return found


def _measured_badly(
    step: Step,
    things: Sequence[Thing],
    spreads: dict[int, Array],
    taken: dict[int, float],
    put: PutDensity,
    right_at: float,
) -> list[Explanation]:
    found = []
    for thing in things:
        left = step.change + thing.load
        if float(left.sum()) < 1.0:
            continue
        score = math.log(_MEASURED if thing.since > right_at else _LATE_MEASURED) + put.same_place(
            thing, step.change, step.variance
        )
        found.append(Explanation("adjust", score, thing=thing, load=left))
        still, _ = put.slid(step.change, left, step.variance + spreads[thing.id])
        found.append(Explanation("slide", math.log(_SLID) + still - max(taken[thing.id], 0.0), thing=thing, load=left))
    return found
