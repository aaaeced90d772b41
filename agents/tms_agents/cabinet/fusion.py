"""Which things explain a step of the load? Every assignment gets a likelihood; the most probable one is taken.

With D the step, V its variance and d_r the load vector of a thing r on the board, each explanation leaves something:

    nothing but zero          take r: D + d_r      take r and s: D + d_r + d_s
    the load of a new thing   put: D               swap, r out and another in: D + d_r      adjust r: d_r + D

What should be zero has a normal density; the load of a thing has a broad one: any weight (narrower where a present tag
tells it), a centre of gravity anywhere on the board, a twist of the board within what its cells may share. Reads and
misses since the step count for and against the tagged things that an explanation takes away.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from tms_agents.cabinet.geometry import Array, Geometry, KnownWeight
from tms_agents.cabinet.position import centre_free, off_board
from tms_agents.cabinet.settings import EstimatorSettings
from tms_agents.cabinet.stays import Shelf, Thing
from tms_agents.cabinet.steps import Step

Kind = Literal["unknown", "put", "take", "slide", "swap", "adjust"]

#: Prior probabilities of what happens in one step. Two things at once are rare, one thing slid without lifting too.
_PRIOR: dict[Kind, float] = {"put": 0.45, "take": 0.45, "slide": 0.01, "swap": 0.03, "adjust": 0.3, "unknown": 1e-4}
_TWO_TAKEN = 0.03
#: Weights of things are spread evenly in their logarithm between these.
_LIGHTEST_G, _HEAVIEST_G = 3.0, 20_000.0
_LOG_RANGE = math.log(math.log(_HEAVIEST_G / _LIGHTEST_G))


@dataclass(frozen=True, slots=True)
class Explanation:
    """``removed`` things leave, ``load`` (k,) is what a new (put, swap) or remaining (slide, adjust) thing has then."""

    kind: Kind
    score: float
    removed: tuple[Thing, ...] = ()
    thing: Thing | None = None
    load: Array | None = None


@dataclass(frozen=True, slots=True)
class Evidence:
    """Beside the load: tags taken (log-likelihood ratio), weights that may be put, a thing still settling."""

    taken: Callable[[Thing], float]
    weights: Sequence[KnownWeight]
    settling: Thing | None = None
    settling_share: float = 0.0


def explain(step: Step, shelf: Shelf, evidence: Evidence, settings: EstimatorSettings) -> list[Explanation]:
    """All explanations with their posterior probability as score, the most probable first."""
    change, variance, geometry = step.change, step.variance, shelf.geometry
    put = PutDensity(geometry, evidence.weights)
    things = list(shelf.things.values())
    found = [
        Explanation("put", math.log(_PRIOR["put"]) + put(change, variance), load=change),
        Explanation("unknown", math.log(_PRIOR["unknown"]) + put(np.abs(change), variance)),
    ]
    each = math.log(1.0 / max(len(things), 1))
    noises = [thing.at(step.now, settings.creep_per_hour) for thing in things]
    taken = [evidence.taken(thing) for thing in things]
    weight_free = abs(step.weight_g) ** 2 < 12.0 * float(variance.sum()) + 4.0
    for thing, noise, tag in zip(things, noises, taken, strict=True):
        left, both = change + thing.load, variance + noise
        found.append(Explanation("take", math.log(_PRIOR["take"]) + each + normal(left, both) + tag, removed=(thing,)))
        after = put(left, both)
        if after > -math.inf:
            found.append(
                Explanation("swap", math.log(_PRIOR["swap"]) + each + after + tag, removed=(thing,), load=left)
            )
            if weight_free:
                found.append(
                    Explanation(
                        "slide",
                        math.log(_PRIOR["slide"]) + each + put.slid(change, left, both),
                        thing=thing,
                        load=left,
                    )
                )
            if thing is evidence.settling and evidence.settling_share > 0:
                prior = math.log(_PRIOR["adjust"] * evidence.settling_share)
                found.append(Explanation("adjust", prior + put.same_place(thing, step), thing=thing, load=left))
    found += _two_taken(step, things, noises, taken)
    return _normalised(found)


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
    return [Explanation("take", float(scores[i]), removed=(things[first[i]], things[second[i]])) for i in best]


def _normalised(found: list[Explanation]) -> list[Explanation]:
    top = max(item.score for item in found)
    total = sum(math.exp(item.score - top) for item in found)
    ranked = sorted(found, key=lambda item: -item.score)
    return [
        Explanation(i.kind, math.exp(i.score - top) / total, removed=i.removed, thing=i.thing, load=i.load)
        for i in ranked
    ]


def normal(value: Array, variance: Array) -> float:
    """Log density of independent normal errors."""
    return float(-0.5 * (value**2 / variance + np.log(2 * math.pi * variance)).sum())


class PutDensity:
    """Log density of a load vector (k,), per g^k, if it is that of one thing somewhere on the board."""

    def __init__(self, geometry: Geometry, weights: Sequence[KnownWeight] = ()) -> None:
        self._geometry, self._weights = geometry, weights
        self._area = geometry.width * geometry.depth
        self._jacobian = float(np.linalg.slogdet(np.vstack([geometry.moments, geometry.twist]))[1])

    def __call__(self, load: Array, variance: Array) -> float:
        weight, sd2 = float(load.sum()), float(variance.sum())
        if weight < max(2.0 * math.sqrt(sd2), _LIGHTEST_G):
            return -math.inf
        place = off_board(load, variance, self._geometry) - math.log(self._area) - 2 * math.log(weight)
        return self._weight(weight, sd2) + place + self._twist(load, variance, weight) + self._jacobian

    def same_place(self, thing: Thing, step: Step) -> float:
        """Density of a further change where ``thing`` stands: it was still being put down, or pressed."""
        weight = step.weight_g
        size = max(abs(weight), 1.0)
        if weight + float(thing.load.sum()) < _LIGHTEST_G:
            return -math.inf
        here = np.array(thing.centre(self._geometry).xy) - np.array(centre_free(step.change, self._geometry))
        at = np.array(self._geometry.cells)
        arms, own = (at - thing.centre(self._geometry).xy).T, float(thing.load.sum())
        cov = (arms * step.variance) @ arms.T / size**2 + (arms * thing.variance) @ arms.T / own**2
        cov = cov + np.eye(2) * 0.005**2
        place = -0.5 * float(here @ np.linalg.solve(cov, here)) - 0.5 * math.log(float(np.linalg.det(cov)))
        place -= math.log(2 * math.pi) + 2 * math.log(size)
        return (
            self._weight(size, 0.0, known=False)
            + place
            + self._twist(step.change, step.variance, size)
            + self._jacobian
        )

    def slid(self, change: Array, load: Array, variance: Array) -> float:
        """Density of a step that leaves the weight and makes ``load`` of a thing's load vector."""
        weight, sd2 = float(load.sum()), float(variance.sum())
        place = off_board(load, variance, self._geometry) - math.log(self._area) - 2 * math.log(weight)
        total = -0.5 * (float(change.sum()) ** 2 / sd2 + math.log(2 * math.pi * sd2))
        return total + place + self._twist(load, variance, weight) + self._jacobian

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
