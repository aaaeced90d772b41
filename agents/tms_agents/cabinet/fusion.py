"""Which things explain a step of the load? Every assignment gets a likelihood; the most probable one is taken.

With D the step, V its variance and d_r the load vector of a thing r on the board, each explanation leaves something:

    nothing but zero          take r: D + d_r      take r and s: D + d_r + d_s
    the load of a new thing   put: D               swap, r out and another in: D + d_r      adjust r: d_r + D

What should be zero has a normal density; the load of a thing has a broad one: any weight (narrower where a present tag
tells it), a centre of gravity anywhere on the board, a twist of the board within what its cells may share. Reads and
misses since the step count for and against the tagged things that an explanation takes away.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from tms_agents.cabinet.geometry import Array, Geometry, KnownWeight
from tms_agents.cabinet.position import centre_free, off_board
from tms_agents.cabinet.settings import EstimatorSettings
from tms_agents.cabinet.splitting import path_odds, split
from tms_agents.cabinet.stays import Shelf, Thing
from tms_agents.cabinet.steps import Step

Kind = Literal["unknown", "put", "take", "slide", "swap", "adjust", "press", "two", "joint"]

#: Prior probabilities of what happens in one step. Two things at once are rare, one thing slid without lifting too.
_PRIOR: dict[Kind, float] = {
    "put": 0.45,
    "take": 0.45,
    "slide": 0.05,
    "swap": 0.02,
    "adjust": 0.3,
    "press": 0.1,
    "unknown": 1e-4,
}
_TWO_TAKEN = 0.03
#: Two things put at once: usually, and while two tags that are at no stay are in view.
_TWO_PUT, _TWO_PUT_TAGS = 0.02, 0.2
_LOOSE_TRIED = 6
#: How often a slid thing is steady while a hand still presses or pulls it.
_PRESSED_SLIDE = 0.03
#: How often a thing was measured badly: pressed, or under a leaning arm.
_LOOSE = 0.01
#: How far from its centre a hand presses on a thing, and how near to each other the centres of two things hardly are.
_HAND_M, _CROWDED_M = 0.015, 0.03
#: Weights of things are spread evenly in their logarithm between these.
_LIGHTEST_G, _HEAVIEST_G = 3.0, 20_000.0
_LOG_RANGE = math.log(math.log(_HEAVIEST_G / _LIGHTEST_G))


@dataclass(frozen=True, slots=True, eq=False)
class Doubt:
    """A slide by ``change`` (k,) g was given to one thing and may have been another's, with these log-odds."""

    thing: Thing
    other: Thing
    change: Array
    odds: float


@dataclass(frozen=True, slots=True)
class Explanation:
    """``removed`` things leave, ``load`` (k,) is what a new (put, swap) or remaining (slide, adjust) thing has then."""

    kind: Kind
    score: float
    removed: tuple[Thing, ...] = ()
    thing: Thing | None = None
    load: Array | None = None
    #: Load of the second thing (two), or the tags of those whose loads only the sum is known of (joint).
    second: Array | None = None
    variance: Array | None = None
    tags: tuple[str, ...] = ()
    #: The load fits within its noise.
    tight: bool = True
    #: An earlier slide is taken back and given to another thing.
    undo: Doubt | None = None

    @property
    def several(self) -> bool:
        """More than one thing, or more than one change of one: not what usually happens."""
        return self.kind in ("swap", "two", "joint", "slide") or len(self.removed) > 1


@dataclass(frozen=True, slots=True)
class Evidence:
    """Beside the load: tags taken (log-likelihood ratio), weights that may be put, a thing still settling."""

    taken: Callable[[Thing], float]
    #: Tags that are at no stay, with their weights where these are known.
    loose: Mapping[str, KnownWeight | None]
    settling: Thing | None = None
    settling_share: float = 0.0
    doubts: Sequence[Doubt] = ()


def explain(step: Step, shelf: Shelf, evidence: Evidence, settings: EstimatorSettings) -> list[Explanation]:
    """All explanations with their posterior probability as score, the most probable first."""
    change, variance, geometry = step.change, step.variance, shelf.geometry
    weights = [weight for weight in evidence.loose.values() if weight is not None]
    put = PutDensity(geometry, settings.min_weight_g, weights)
    things = list(shelf.things.values())

    def crowded(load: Array, gone: Thing | None = None) -> float:
        return _crowded(load, shelf, gone) if settings.knows_places else 0.0

    found = [
        Explanation("put", math.log(_PRIOR["put"]) + put(change, variance) + crowded(change), load=change),
        Explanation("unknown", math.log(_PRIOR["unknown"]) + put.anything(change, variance)),
    ]
    each = math.log(1.0 / max(len(things), 1))
    noises = [thing.at(step.now, settings.creep_per_hour) for thing in things]
    taken = [evidence.taken(thing) for thing in things]
    for thing, noise, tag in zip(things, noises, taken, strict=True):
        left, both = change + thing.load, variance + noise
        tight, loose = _remaining(left, both, thing)
        prior = math.log(_PRIOR["take"]) + each + tag
        both_ways = float(np.logaddexp(tight, loose))
        found.append(Explanation("take", prior + both_ways, removed=(thing,), tight=tight > loose))
        after = put(left, both)
        if after > -math.inf:
            prior = math.log(_PRIOR["swap"]) + each + tag + path_odds(step, -thing.load)
            crowd = crowded(left, thing)
            found.append(Explanation("swap", prior + after + crowd, removed=(thing,), load=left))
            if settings.knows_places and abs(step.weight_g) < 0.5 * float(thing.load.sum()):
                prior = math.log(_PRIOR["slide"]) + each
                prior += max(path_odds(step, -thing.load, same_thing=True), 0.0)
                still, pressed = put.slid(change, left, both)
                found.append(Explanation("slide", prior + still, thing=thing, load=left))
                found.append(Explanation("press", prior + math.log(_PRESSED_SLIDE) + pressed, thing=thing))
            pressed_on = settings.knows_places and step.weight_g > 0
            if pressed_on and not (thing is evidence.settling and evidence.settling_share > 0.3):
                prior = math.log(_PRIOR["press"]) + each
                found.append(Explanation("press", prior + put.same_place(thing, step, _HAND_M), thing=thing))
            if settings.knows_places and thing is evidence.settling and evidence.settling_share > 0.01:
                prior = math.log(_PRIOR["adjust"] * evidence.settling_share)
                found.append(Explanation("adjust", prior + put.same_place(thing, step), thing=thing, load=left))
    found += _taken_and_pressed(step, found, things, put)
    for doubt in evidence.doubts:
        for which, sign in ((doubt.thing, -1.0), (doubt.other, 1.0)):
            if doubt.thing.id not in shelf.things or doubt.other.id not in shelf.things:
                continue
            noise = variance + which.at(step.now, settings.creep_per_hour) + step.variance
            score = math.log(_PRIOR["take"]) + each + evidence.taken(which) + doubt.odds
            score += normal(change + which.load + sign * doubt.change, noise)
            found.append(Explanation("take", score, removed=(which,), undo=doubt))
    found += _two_taken(step, things, noises, taken)
    if step.weight_g > 2 * settings.min_weight_g:
        found += _two_put(step, put, evidence.loose)
    return _normalised(found)


def _remaining(left: Array, variance: Array, thing: Thing) -> tuple[float, float]:
    """Log densities of what is left when ``thing`` is taken: measured well, and badly."""
    loose = normal(left, variance + (0.15 * np.abs(thing.load) + 12.0) ** 2)
    return math.log(1 - _LOOSE) + normal(left, variance), math.log(_LOOSE) + loose


def _crowded(load: Array, shelf: Shelf, gone: Thing | None = None) -> float:
    """Log of the room that the things on the board, without the one that is ``gone``, leave for a new one."""
    at = np.array(centre_free(load, shelf.geometry))
    near = [
        float(np.hypot(*(at - thing.centre(shelf.geometry).xy))) for thing in shelf.things.values() if thing is not gone
    ]
    return math.log(1.0 - 0.95 * math.exp(-0.5 * (min(near) / _CROWDED_M) ** 2)) if near else 0.0


def _taken_and_pressed(
    step: Step, found: Sequence[Explanation], things: Sequence[Thing], put: PutDensity
) -> list[Explanation]:
    """What looks like a swap may be a thing taken, and the hand already on the next one."""
    swaps = sorted((item for item in found if item.kind == "swap"), key=lambda item: -item.score)[:2]
    pressed = []
    for swap in swaps:
        assert swap.load is not None
        left = replace(step, change=swap.load)
        for thing in things:
            if thing not in swap.removed:
                prior = math.log(_PRIOR["take"] * _PRIOR["press"]) - 2 * math.log(len(things))
                prior += path_odds(step, step.change - swap.load)
                pressed.append(Explanation("press", prior + put.same_place(thing, left, _HAND_M), thing=thing))
    return pressed


def _two_taken(step: Step, things: list[Thing], noises: list[Array], taken: list[float]) -> list[Explanation]:
    if len(things) < 2 or step.weight_g > 0:
        return []
    loads, spreads, tags = np.array([t.load for t in things]), np.array(noises), np.array(taken)
    first, second = np.triu_indices(len(things), 1)
    left = step.change + loads[first] + loads[second]
    both = step.variance + spreads[first] + spreads[second]
    scores = -0.5 * (left**2 / both + np.log(2 * math.pi * both)).sum(axis=1) + tags[first] + tags[second]
    scores += math.log(_TWO_TAKEN / len(first))
    best = np.argsort(scores)[::-1][:8]
    for i in best:
        scores[i] += path_odds(step, -loads[first[i]])
    return [Explanation("take", float(scores[i]), removed=(things[first[i]], things[second[i]])) for i in best]


def _two_put(step: Step, put: PutDensity, loose: Mapping[str, KnownWeight | None]) -> list[Explanation]:
    """Two things at once: told apart by the path of the load, or only known as a sum of two known weights."""
    prior = math.log(_TWO_PUT_TAGS if len(loose) >= 2 else _TWO_PUT)
    found = []
    parts = split(step)
    if parts is not None:
        volume = 0.5 * float(np.log(2 * math.pi * parts.variance).sum())
        score = prior + parts.gain + put(parts.first, parts.variance) + put(parts.second, parts.variance) + volume
        if score > -math.inf:
            found.append(Explanation("two", score, load=parts.first, second=parts.second, variance=parts.variance))
    known = [(tag, weight) for tag, weight in loose.items() if weight is not None][-_LOOSE_TRIED:]
    pairs = list(itertools.combinations(known, 2))
    for (tag, weight), (other, more) in pairs:
        both = KnownWeight(weight.mean_g + more.mean_g, math.hypot(weight.sd_g, more.sd_g))
        score = prior - math.log(len(pairs)) + put.of(both)(step.change, step.variance)
        share = weight.mean_g / both.mean_g
        load, second = share * step.change, (1 - share) * step.change
        found.append(Explanation("joint", score, load=load, second=second, tags=(tag, other)))
    return found


def _normalised(found: list[Explanation]) -> list[Explanation]:
    top = max(item.score for item in found)
    total = sum(math.exp(item.score - top) for item in found)
    ranked = sorted(found, key=lambda item: -item.score)
    return [replace(item, score=math.exp(item.score - top) / total) for item in ranked]


def normal(value: Array, variance: Array) -> float:
    """Log density of independent normal errors."""
    return float(-0.5 * (value**2 / variance + np.log(2 * math.pi * variance)).sum())


class PutDensity:
    """Log density of a load vector (k,), per g^k, if it is that of one thing somewhere on the board."""

    def __init__(self, geometry: Geometry, least_g: float, weights: Sequence[KnownWeight] = ()) -> None:
        self._geometry, self._least_g, self._weights = geometry, least_g, weights
        self._area = geometry.width * geometry.depth
        self._jacobian = float(np.linalg.slogdet(np.vstack([geometry.moments, geometry.twist]))[1])

    def __call__(self, load: Array, variance: Array) -> float:
        weight, sd2 = float(load.sum()), float(variance.sum())
        if weight < max(4.0 * math.sqrt(sd2), self._least_g):
            return -math.inf
        place = off_board(load, variance, self._geometry) - math.log(self._area) - 2 * math.log(weight)
        return self._weight(weight, sd2) + place + self._twist(load, variance, weight) + self._jacobian

    def of(self, weight: KnownWeight) -> PutDensity:
        """The same for a load of that weight."""
        return PutDensity(self._geometry, self._least_g, [weight])

    def same_place(self, thing: Thing, step: Step, apart_m: float = 0.005) -> float:
        """Density of a further change where ``thing`` stands: it was still being put down, or pressed."""
        weight = step.weight_g
        size = max(abs(weight), 1.0)
        if weight + float(thing.load.sum()) < self._least_g:
            return -math.inf
        here = np.array(thing.centre(self._geometry).xy) - np.array(centre_free(step.change, self._geometry))
        at = np.array(self._geometry.cells)
        arms, own = (at - thing.centre(self._geometry).xy).T, float(thing.load.sum())
        cov = (arms * step.variance) @ arms.T / size**2 + (arms * thing.variance) @ arms.T / own**2
        cov = cov + np.eye(2) * apart_m**2
        place = -0.5 * float(here @ np.linalg.solve(cov, here)) - 0.5 * math.log(float(np.linalg.det(cov)))
        place -= math.log(2 * math.pi) + 2 * math.log(size)
        return (
            self._weight(size, 0.0, known=False)
            + place
            + self._twist(step.change, step.variance, size)
            + self._jacobian
        )

    def slid(self, change: Array, load: Array, variance: Array) -> tuple[float, float]:
        """Densities of a step that makes ``load`` of a thing's load vector: with its weight, or still pressed."""
        weight, sd2, more = float(load.sum()), float(variance.sum()), float(change.sum())
        place = off_board(load, variance, self._geometry) - math.log(self._area) - 2 * math.log(weight)
        place += self._twist(load, variance, weight) + self._jacobian
        still = -0.5 * (more**2 / sd2 + math.log(2 * math.pi * sd2))
        return still + place, -math.log(weight) + place

    def anything(self, change: Array, variance: Array) -> float:
        """Density of a change that no thing makes: any size and sign, shared among the cells in any way."""
        size = np.sqrt(change**2 + variance).sum()
        return -math.log(2 * size) - _LOG_RANGE - (len(change) - 1) * math.log(size)

    def _weight(self, weight: float, sd2: float, *, known: bool = True) -> float:
        broad = -math.log(max(weight, 1.0)) - _LOG_RANGE
        if not known or not self._weights:
            return broad
        peaks = sum(
            math.exp(-0.5 * (weight - item.mean_g) ** 2 / (item.sd_g**2 + sd2))
            / math.sqrt(2 * math.pi * (item.sd_g**2 + sd2))
            for item in self._weights
        )
        return math.log(0.5 * math.exp(broad) + 0.5 * peaks / len(self._weights))

    def _twist(self, load: Array, variance: Array, weight: float) -> float:
        twist = self._geometry.twist
        if not len(twist):
            return 0.0
        # A soft board gives a corner more than its share: up to half the weight, a fifth of it on average.
        spread = (twist**2) @ variance + (0.2 * weight) ** 2
        return normal(twist @ load, spread)
