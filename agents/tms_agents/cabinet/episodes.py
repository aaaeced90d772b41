"""Everything that happened since the board last rested, looked at as one: what is there now, and what is not any more?

Steps are explained at once, from what is known then: a level half a second old, one round or none of the tags. Once the
board has rested for a while more is known: the level well, every tag by several rounds, and the whole way of the load.
Then every outcome is weighed: any things of those that stood there before are gone, and up to two others have come.
All of them explain the same net change, (k,) g, so that their likelihoods may be compared.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from tms_agents.cabinet.blocks import Block
from tms_agents.cabinet.densities import PutDensity, normal
from tms_agents.cabinet.geometry import Array, Geometry, KnownWeight
from tms_agents.cabinet.settings import EstimatorSettings
from tms_agents.cabinet.stays import Thing
from tms_agents.cabinet.wandering import misfit, pulls_of

#: Log-probability of so many changes between two rests; a thing that was put elsewhere is one change.
_CHANGES = [math.log(p) for p in (0.05, 0.75, 0.17, 0.02, 0.002, 1e-4, 1e-5)]
#: A new thing has a tag; one of the tags in view that nobody put there belongs to something else.
_TAGGED, _UNTAGGED, _ELSEWHERE = math.log(0.8), math.log(0.2), math.log(0.03)
#: A level at rest is never known better than this.
_FLOOR_G = 1.5
#: How often a thing was measured badly before, or a zero has moved, by so much at least; how far known weights are
#: trusted.
_LOOSE, _BADLY_G, _TRUST = 0.02, 6.0, 0.95
#: Outcomes so much less probable by tags alone than the best one are not weighed, nor more than so many.
_HOPELESS, _MOST, _MOST_PATHS = 25.0, 250, 12
#: Misfit of a block of the way that counts, what a hand adds to a load in other directions, and how much of it counts.
_CAP, _HAND, _WAY = 12.0, 0.03, 0.35
_WAY_BLOCKS = 600
#: The centre of two is somewhere in the middle rather than anywhere (log density).
_IN_THE_MIDDLE = math.log(1.5)
#: How often a thing is also put elsewhere when others come or go, something happens that nobody can explain,
#: and a thing goes that nobody knew of.
_ASIDE, _UNKNOWN, _UNLISTED = math.log(0.03), math.log(1e-3), math.log(5e-3)
#: How often a thing is slid rather than lifted and put down.
_SLID = 0.02


@dataclass(slots=True, eq=False)
class Episode:
    """From the level and the ``things`` (copies) of the last rest until the board rests again."""

    level: Array
    variance: Array
    things: Sequence[Thing]
    onset: float
    way: list[tuple[Array, Array]] = field(default_factory=list)
    #: When it was looked at last.
    looked: float = -math.inf

    def add(self, block: Block) -> None:
        if len(self.way) < _WAY_BLOCKS:
            self.way.append((block.mean - self.level, block.variance))


@dataclass(frozen=True, slots=True)
class Outcome:
    """``gone``: ids of things that stood there before; ``new``: tags of those that have come, None without one.

    ``load`` is that of all new ones together, (k,) g, and ``variance`` its errors.
    """

    gone: frozenset[int]
    new: tuple[str | None, ...]
    score: float
    load: Array
    variance: Array
    #: False for what cannot be explained.
    known: bool = True


#: Log-likelihood of the rounds since the board rests, if the tag is there and if it is not.
TagOdds = Callable[[str], tuple[float, float]]


def outcomes(
    episode: Episode,
    now: float,
    level: Array,
    variance: Array,
    odds: TagOdds,
    tags: Collection[str],
    weight: Callable[[str], KnownWeight | None],
    geometry: Geometry,
    settings: EstimatorSettings,
) -> list[Outcome]:
    """``tags``: those in view that were at no thing before. All outcomes with their posterior probabilities as scores, the most probable first."""
    change = level - episode.level
    spread = variance + episode.variance + _FLOOR_G**2
    things = {thing.id: thing for thing in episode.things}
    noises = {thing.id: thing.at(now, settings.creep_per_hour) for thing in episode.things}

    def put(count: int, of: list[KnownWeight]) -> PutDensity:
        return PutDensity(
            geometry, settings.min_weight_g * count, of, trust=_TRUST if of else 0.5, clear=2.0
        )

    plans = sorted(_plans(list(things.values()), tags, odds), key=lambda plan: -plan[0])[:_MOST]
    found: list[Outcome] = []
    for prior, gone, new in plans:
        if prior < plans[0][0] - _HOPELESS:
            break
        left = change + sum((things[i].load for i in gone), np.zeros_like(change))
        both = spread + sum((noises[i] for i in gone), np.zeros_like(change))
        if new:
            of = _expected([things[i] for i in gone], new, weight)
            density = put(len(new), of)(left, both)
            if len(new) == 2:
                density += _IN_THE_MIDDLE
        elif (one := _not_told_apart(gone, things)) is not None:
            # Only the sum of it and of others was known: it stood anywhere.
            alone = PutDensity(geometry, settings.min_weight_g, [KnownWeight(*_weight(one))], trust=_TRUST, clear=2.0)
            density = alone(one.load - left, both - noises[one.id])
        else:
            badly = both + _BADLY_G**2 + sum(((0.1 * np.abs(things[i].load)) ** 2 for i in gone), np.zeros_like(change))
            density = float(np.logaddexp(math.log(1 - _LOOSE) + normal(left, both), math.log(_LOOSE) + normal(left, badly)))
        if density > -math.inf:
            found.append(Outcome(gone, new, prior + density, left, both))
    found.sort(key=lambda one: -one.score)
    found = found[:_MOST_PATHS]
    weighed = [
        replace(one, score=one.score + _way(episode, one, things, geometry) + _lifted(episode, one, things))
        for one in found
    ]
    unlisted = PutDensity(geometry, settings.min_weight_g, clear=2.0)
    anything = float(np.logaddexp(_UNKNOWN + unlisted.anything(change, spread), _UNLISTED + unlisted(-change, spread)))
    prior = sum(max(odds(tag)) for tag in {*tags, *(one.tag for one in episode.things if one.tag is not None)})
    way = -0.5 * _WAY * len(change) * len(episode.way)
    weighed.append(Outcome(frozenset(), (), anything + prior + way, change, spread, known=False))
    return _normalised(weighed)


def _plans(
    things: Sequence[Thing], others: Collection[str], odds: TagOdds
) -> Iterator[tuple[float, frozenset[int], tuple[str | None, ...]]]:
    """Prior and tags of everything that may have happened."""
    tags = {thing.id: thing.tag for thing in things}
    present, absent = {}, {}
    for tag in {*others, *(tag for tag in tags.values() if tag is not None)}:
        present[tag], absent[tag] = odds(tag)
    stay = sum(present[tag] for tag in tags.values() if tag is not None)
    astray = {tag: max(absent[tag], _ELSEWHERE + present[tag]) for tag in present}
    free = [tag for tag in others if tag not in tags.values()]
    nobody = sum(astray[tag] for tag in free)
    most = 3 if len(things) <= 10 else 2
    for count in range(min(most, len(things)) + 1):
        for group in itertools.combinations(things, count):
            gone = frozenset(thing.id for thing in group)
            lifted = [tag for thing in group if (tag := thing.tag) is not None]
            untagged = count - len(lifted)
            without = stay + nobody + sum(astray[tag] - present[tag] for tag in lifted)
            choice: list[str | None] = [*free, *lifted, None, None]
            for number in range(3):
                for new in dict.fromkeys(itertools.combinations(choice, number)):
                    same = sum(tag in lifted for tag in new)
                    same += min(untagged, sum(tag is None for tag in new))
                    changes = count + number - same
                    aside = max(same - 1, 0) if changes == same else same
                    prior = aside * _ASIDE + _CHANGES[min(changes, len(_CHANGES) - 1)] - count * math.log(max(len(things), 1))
                    for tag in new:
                        prior += _UNTAGGED if tag is None else present[tag] - astray[tag] + _TAGGED
                    yield prior + without, gone, new


def _expected(
    gone: Sequence[Thing], new: Sequence[str | None], weight: Callable[[str], KnownWeight | None]
) -> list[KnownWeight]:
    """What the new things may weigh together, as far as that is known."""
    choices: list[list[KnownWeight | None]] = []
    for tag in new:
        if tag is not None:
            choices.append([weight(tag)])
        else:
            weights = [(float(one.load.sum()), float(one.variance.sum())) for one in gone if one.tag is None]
            choices.append([KnownWeight(mean, math.sqrt(var) + 0.005 * mean) for mean, var in weights] or [None])
    return [
        KnownWeight(sum(one.mean_g for one in those), math.hypot(*(one.sd_g + 0.005 * one.mean_g for one in those)))
        for choice in itertools.product(*choices)
        if all(one is not None for one in choice)
        for those in [[one for one in choice if one is not None]]
    ]


def _not_told_apart(gone: Collection[int], things: Mapping[int, Thing]) -> Thing | None:
    """The one of those ``gone`` that came together with others which are still there."""
    found = [things[i] for i in gone if things[i].joint - set(gone)]
    return found[0] if len(found) == 1 else None


def _weight(thing: Thing) -> tuple[float, float]:
    if thing.known is not None:
        return thing.known.mean_g, thing.known.sd_g
    weight = float(thing.load.sum())
    return weight, 0.1 * weight + 5.0


def _way(episode: Episode, outcome: Outcome, things: Mapping[int, Thing], geometry: Geometry) -> float:
    """How well the way of the load fits: on it the load is made of parts of what went and what came."""
    if not episode.way:
        return 0.0
    path = np.array([mean for mean, _ in episode.way])
    force = (path**2).sum(axis=1)
    sd = np.sqrt(np.array([variance for _, variance in episode.way]) + (_HAND**2 * force / path.shape[1])[:, None])
    directions = [things[i].load for i in outcome.gone]
    if outcome.new:
        directions.append(outcome.load)
    common = np.sqrt((sd**2).mean(axis=0))
    weight = np.linalg.norm(common) / np.linalg.norm(sd, axis=1)
    scaled = path / common * weight[:, None]
    pulls = pulls_of(path, geometry) / common[:, None] * weight[:, None, None]
    if directions:
        basis, size, _ = np.linalg.svd((np.array(directions) / common).T, full_matrices=False)
        basis = basis[:, size > 1e-3 * size[0]]
        scaled = scaled - (scaled @ basis) @ basis.T
        pulls = pulls - np.einsum("tkb,kr,lr->tlb", pulls, basis, basis)
        rank = basis.shape[1]
    else:
        rank = 0
    if len(outcome.new) == 2 and rank < path.shape[1]:
        # They came one after the other, or not: one more direction, whatever it is.
        _, vectors = np.linalg.eigh(scaled.T @ scaled)
        scaled = scaled - np.outer(scaled @ vectors[:, -1], vectors[:, -1])
        rank += 1.5
    return -0.5 * _WAY * (misfit(scaled, pulls, _CAP) + rank * len(path))


def _lifted(episode: Episode, outcome: Outcome, things: Mapping[int, Thing]) -> float:
    """A thing that is somewhere else now was lifted on the way; what was slid never took its weight off the board."""
    if len(outcome.gone) != 1 or len(outcome.new) != 1:
        return 0.0
    (old,) = (things[i] for i in outcome.gone)
    weight = float(old.load.sum())
    totals = np.array([mean.sum() for mean, _ in episode.way])
    if old.tag != outcome.new[0] or len(totals) < 3:
        return 0.0
    least = float(np.convolve(totals, np.ones(3) / 3, "valid").min())
    return 0.0 if least < -0.5 * weight else math.log(_SLID)


def _normalised(found: Sequence[Outcome]) -> list[Outcome]:
    if not found:
        return []
    top = max(one.score for one in found)
    total = sum(math.exp(one.score - top) for one in found)
    ranked = sorted(found, key=lambda one: -one.score)
    return [replace(one, score=math.exp(one.score - top) / total) for one in ranked]
