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

from tms_agents.cabinet.densities import PutDensity, balanced, normal
from tms_agents.cabinet.geometry import Array, Geometry, KnownWeight
from tms_agents.cabinet.position import centre, centre_free
from tms_agents.cabinet.settings import EstimatorSettings
from tms_agents.cabinet.splitting import Split, path_odds, split
from tms_agents.cabinet.stays import Shelf, Thing, errors_of
from tms_agents.cabinet.steps import Step

Kind = Literal["unknown", "settled", "put", "take", "slide", "swap", "adjust", "press", "two", "joint"]

#: Prior probabilities of what happens in one step. Two things at once are rare, one thing slid without lifting too.
_PRIOR: dict[Kind, float] = {
    "put": 0.45,
    "take": 0.45,
    "slide": 0.05,
    "swap": 0.02,
    "adjust": 0.3,
    "press": 0.1,
    "unknown": 1e-4,
    "settled": 0.1,
}
_TWO_TAKEN = 0.03
#: Two things put at once: usually, and while two tags that are at no stay are in view.
_TWO_PUT, _TWO_PUT_TAGS = 0.02, 0.2
_LOOSE_TRIED = 6
#: How often a slid thing is steady while a hand still presses or pulls it.
_PRESSED_SLIDE = 0.03
#: A board that is shaken may swing by so much and so often; what looks like a slide is rarely one then.
_SWING_G, _SWINGS, _STEADIER = 9.0, 0.3, 0.2
#: How often a thing was measured badly: pressed, or under a leaning arm.
_LOOSE = 0.03
#: How wrong its weight may be then (share of it, g), where that of its tag agreed with it and where nothing is known.
_KNOWN, _UNKNOWN = (0.02, 4.0), (0.1, 8.0)
#: How far from its centre a hand presses on a thing, and how near to each other the centres of two things hardly are.
_HAND_M, _CROWDED_M = 0.015, 0.03
#: Two things put at once stand so far apart at least; nearer, it was one that was tilted (log-odds of the price).
_ONE_M, _TWO_M, _TILTED = 0.06, 0.085, -8.0
#: How far the centre of a thing that has just come shifts when it is set upright.
_UPRIGHT_M = 0.003
#: ... and what is left where a thing went is it (log-odds).
_REMNANT = -4.0


@dataclass(frozen=True, slots=True, eq=False)
class Doubt:
    """A slide by ``change`` (k,) g was given to one thing and may have been another's, with these log-odds."""

    thing: Thing
    other: Thing
    change: Array
    odds: float


@dataclass(frozen=True, slots=True)
class Explanation:
    """``removed`` things leave, ``load`` (k,) is what a new (put, swap) or remaining (slide, adjust) thing has then.

    A ``thing`` that remains where another one leaves (take) has that one's tag.
    """

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
    #: What the load is beside zeros and stays after the step, (k,) g, and its variance: None while not known.
    left: tuple[Array, Array] | None = None
    #: Something shakes the board, so that its level may swing.
    shaking: bool = False


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
    if evidence.left is not None:
        # It makes good what was wrong before, so that everything fits now; if nothing was wrong, that is hardly it.
        before = evidence.left[0] - change
        right = normal(before, evidence.left[1]) - put.anything(before, evidence.left[1])
        settled = math.log(_PRIOR["settled"]) + normal(*evidence.left) - max(right, 0.0)
        found.append(Explanation("settled", settled))
    if evidence.shaking:
        swing = math.log(_PRIOR["settled"] * _SWINGS) + normal(change, variance + _SWING_G**2)
        found.append(Explanation("settled", swing))
    each = math.log(1.0 / max(len(things), 1))
    errors = [errors_of([thing], step.now, settings.creep_per_hour, geometry.count) for thing in things]
    noises, whole_variance = [noise for noise, _ in errors], float(variance.sum())
    taken = [evidence.taken(thing) for thing in things]
    for thing, (noise, total), tag in zip(things, errors, taken, strict=True):
        left, both, total = change + thing.load, variance + noise, whole_variance + total
        tight, loose = _remaining(left, both, total, thing)
        prior = math.log(_PRIOR["take"]) + each + tag
        both_ways = float(np.logaddexp(tight, loose))
        found.append(Explanation("take", prior + both_ways, removed=(thing,), tight=tight > loose))
        newest = evidence.settling
        if settings.knows_places and newest is not None and newest is not thing and evidence.settling_share > 0.01:
            # It was on its way while the other one was put, which was measured with a part of it.
            prior = math.log(_PRIOR["take"] * _PRIOR["adjust"] * evidence.settling_share) + each + tag
            whole = left + newest.load
            score = prior + put(whole, both + newest.variance)
            found.append(Explanation("adjust", score, removed=(thing,), thing=newest, load=whole))
        after = put(left, both, total)
        if after > -math.inf:
            prior = math.log(_PRIOR["swap"]) + each + tag + path_odds(step, -thing.load, geometry)
            # A thing half lifted or tilted looks like a lighter one in its place.
            crowd = crowded(left) + _remnant(left, thing, geometry)
            found.append(Explanation("swap", prior + after + crowd, removed=(thing,), load=left))
            if settings.knows_places and abs(step.weight_g) < 0.5 * float(thing.load.sum()):
                prior = math.log(_PRIOR["slide"] * (_STEADIER if evidence.shaking else 1.0)) + each - max(tag, 0.0)
                prior += max(path_odds(step, -thing.load, geometry, same_thing=True), 0.0)
                still, pressed = put.slid(change, left, both)
                found.append(Explanation("slide", prior + still, thing=thing, load=left))
                found.append(Explanation("press", prior + math.log(_PRESSED_SLIDE) + pressed, thing=thing))
            pressed_on = settings.knows_places and step.weight_g > 0
            if pressed_on and not (thing is evidence.settling and evidence.settling_share > 0.3):
                prior = math.log(_PRIOR["press"]) + each
                found.append(
                    Explanation("press", prior + put.same_place(thing, change, variance, _HAND_M), thing=thing)
                )
            if settings.knows_places and thing is evidence.settling and evidence.settling_share > 0.01:
                prior = math.log(_PRIOR["adjust"] * evidence.settling_share)
                # The last of it may also set it upright: its whole load shifts a little.
                upright = _UPRIGHT_M * float(thing.load.sum()) / max(abs(step.weight_g), 1.0)
                here = put.same_place(thing, change, variance, math.hypot(0.005, upright))
                found.append(Explanation("adjust", prior + here, thing=thing, load=left))
    found += _taken_and_pressed(step, found, things, put)
    for doubt in evidence.doubts:
        for which, sign in ((doubt.thing, -1.0), (doubt.other, 1.0)):
            if doubt.thing.id not in shelf.things or doubt.other.id not in shelf.things:
                continue
            noise = variance + which.at(step.now, settings.creep_per_hour) + step.variance
            score = math.log(_PRIOR["take"]) + each + evidence.taken(which) + doubt.odds
            score += normal(change + which.load + sign * doubt.change, noise)
            found.append(Explanation("take", score, removed=(which,), undo=doubt))
    found += _two_taken(step, things, noises, taken, geometry, settings)
    if step.weight_g > 2 * settings.min_weight_g:
        found += _two_put(step, put, evidence.loose)
    return _normalised(found)


def _remaining(left: Array, variance: Array, total: float, thing: Thing) -> tuple[float, float]:
    """Log densities of what is left when ``thing`` is taken: measured well, and badly."""
    badly = (0.15 * np.abs(thing.load) + 12.0) ** 2
    share, least = _KNOWN if thing.known is not None and not thing.joint else _UNKNOWN
    more = min((share * float(thing.load.sum()) + least) ** 2, float(badly.sum()))
    loose = balanced(left, variance + badly, total + more)
    return math.log(1 - _LOOSE) + balanced(left, variance, total), math.log(_LOOSE) + loose


def _crowded(load: Array, shelf: Shelf, gone: Thing | None = None) -> float:
    """Log of the room that the things on the board, without the one that is ``gone``, leave for a new one."""
    at = np.array(centre_free(load, shelf.geometry))
    near = [
        float(np.hypot(*(at - thing.centre(shelf.geometry).xy))) for thing in shelf.things.values() if thing is not gone
    ]
    return math.log(1.0 - 0.95 * math.exp(-0.5 * (min(near) / _CROWDED_M) ** 2)) if near else 0.0


def _remnant(load: Array, gone: Thing, geometry: Geometry) -> float:
    """What is a small part of the thing that went, and where that was, is hardly another thing."""
    if float(load.sum()) > 0.3 * float(gone.load.sum()):
        return 0.0
    apart = math.dist(centre_free(load, geometry), gone.centre(geometry).xy)
    return _REMNANT * math.exp(-0.5 * (apart / _ONE_M) ** 2)


def _taken_and_pressed(
    step: Step, found: Sequence[Explanation], things: Sequence[Thing], put: PutDensity
) -> list[Explanation]:
    """What looks like a swap may be a thing taken, and the hand already on the next one."""
    swaps = sorted((item for item in found if item.kind == "swap"), key=lambda item: -item.score)[:2]
    pressed = []
    for swap in swaps:
        assert swap.load is not None
        for thing in things:
            if thing not in swap.removed:
                prior = math.log(_PRIOR["take"] * _PRIOR["press"]) - 2 * math.log(len(things))
                prior += path_odds(step, step.change - swap.load, put.geometry)
                pressed.append(
                    Explanation("press", prior + put.same_place(thing, swap.load, step.variance, _HAND_M), thing=thing)
                )
    return pressed


def _two_taken(
    step: Step,
    things: list[Thing],
    noises: list[Array],
    taken: list[float],
    geometry: Geometry,
    settings: EstimatorSettings,
) -> list[Explanation]:
    if len(things) < 2 or step.weight_g > 0:
        return []
    loads, spreads, tags = np.array([t.load for t in things]), np.array(noises), np.array(taken)
    first, second = np.triu_indices(len(things), 1)
    left = step.change + loads[first] + loads[second]
    both = step.variance + spreads[first] + spreads[second]
    scores = -0.5 * (left**2 / both + np.log(2 * math.pi * both)).sum(axis=1) + tags[first] + tags[second]
    for i, pair in enumerate(zip(first, second, strict=True)):
        two = [things[n] for n in pair]
        if any(thing.joint for thing in two):
            noise, total = errors_of(two, step.now, settings.creep_per_hour, geometry.count)
            scores[i] = balanced(left[i], step.variance + noise, float(step.variance.sum()) + total)
            scores[i] += tags[pair[0]] + tags[pair[1]]
    scores += math.log(_TWO_TAKEN / len(first))
    best = np.argsort(scores)[::-1][:8]
    for i in best:
        scores[i] += path_odds(step, -loads[first[i]], geometry)
    return [Explanation("take", float(scores[i]), removed=(things[first[i]], things[second[i]])) for i in best]


def _two_put(step: Step, put: PutDensity, loose: Mapping[str, KnownWeight | None]) -> list[Explanation]:
    """Two things at once: told apart by the path of the load, or only known as a sum of two known weights."""
    prior = math.log(_TWO_PUT_TAGS if len(loose) >= 2 else _TWO_PUT)
    found = []
    parts = split(step, put.geometry)
    if parts is not None:
        volume = 0.5 * float(np.log(2 * math.pi * parts.variance).sum())
        score = (
            prior
            + parts.gain
            + _tilted(parts, put.geometry)
            + put(parts.first, parts.variance)
            + put(parts.second, parts.variance)
            + volume
        )
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


def _tilted(parts: Split, geometry: Geometry) -> float:
    """Log of how probable it is that two things stand as near to each other as the parts of a step."""
    one, two = (centre(load, parts.variance, geometry) for load in (parts.first, parts.second))
    apart = math.dist(one.xy, two.xy) + math.sqrt(one.cov[0] + one.cov[2] + two.cov[0] + two.cov[2])
    return _TILTED * min(max((_TWO_M - apart) / (_TWO_M - _ONE_M), 0.0), 1.0)


def _normalised(found: list[Explanation]) -> list[Explanation]:
    top = max(item.score for item in found)
    total = sum(math.exp(item.score - top) for item in found)
    ranked = sorted(found, key=lambda item: -item.score)
    return [replace(item, score=math.exp(item.score - top) / total) for item in ranked]
