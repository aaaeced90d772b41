"""Everything that happened since the board last rested, looked at as one: what is there now, and what is not any more?

Steps are explained at once, from what is known then: a level half a second old, one round or none of the tags. Once the
board has rested for a while more is known: the level well, every tag by several rounds, and the whole way of the load.
Then every outcome is weighed: any things of those that stood there before are gone, and up to two others have come.
All of them explain the same net change, (k,) g, so that their likelihoods may be compared.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from tms_agents.cabinet.blocks import Block
from tms_agents.cabinet.densities import PutDensity, balanced
from tms_agents.cabinet.geometry import Array, Geometry, KnownWeight
from tms_agents.cabinet.plans import Known, plans_of
from tms_agents.cabinet.stays import Thing, errors_of
from tms_agents.cabinet.ways import WAY, way_odds

#: A level at rest is never known better than this.
_FLOOR_G = 1.5
#: How often a thing was measured badly before, or a zero has moved, by so much at least; how far known weights are
#: trusted.
_LOOSE, _BADLY_G, _TRUST = 0.05, 6.0, 0.95
#: ... and how far it is trusted that nothing weighs more than is known, by a share and some g.
_TRUST_MORE, _MORE, _MORE_G = 0.998, 0.1, 10.0
#: The same while something shakes the board.
_SHAKEN, _SHAKEN_G = 0.4, 9.0
#: Outcomes so much less probable by tags alone than the best one are not weighed, nor more than so many.
_HOPELESS, _MOST, _MOST_PATHS = 25.0, 250, 12
#: Blocks of the way that are kept, and the most that a misfit of it counts (log-odds).
_WAY_BLOCKS, _MOST_ODDS = 600, 4.5
#: The least weight of a thing, and how many of its standard deviations it must be.
_LEAST_G, _CLEAR = 14.0, 2.0
#: How wrong the weight of a thing may be that agrees with its tag's.
_OFF_SHARE, _OFF_G = 0.02, 3.0
#: What came so shortly before may have been still on its way down, and how often (log).
_PUT_S, _STILL_PUT = 8.0, math.log(0.5)
#: The centre of two is somewhere in the middle rather than anywhere (log density).
_IN_THE_MIDDLE = math.log(1.5)
#: How often something happens that nobody can explain, and a thing goes that nobody knew of.
_UNKNOWN, _UNLISTED = math.log(1e-3), math.log(5e-3)
#: How often a thing is slid rather than lifted and put down.
_SLID = 0.02
#: More than that is never missing (share of the weight, g; of a board that swings); log-odds of what cannot be.
_TOO_MUCH, _TOO_MUCH_G, _SWING_G, _HOPELESSLY = 1.2, 20.0, 80.0, -10.0
#: Of what is lifted so much is missing, of what is slid at most so much; log-odds of neither. Blocks that are averaged.
_OFF, _ON, _NEITHER, _SMOOTH = 0.85, 0.4, -4.0, 3


@dataclass(slots=True, eq=False)
class Episode:
    """From the level and the ``things`` (copies) of the last rest until the board rests again."""

    level: Array
    variance: Array
    things: list[Thing]
    onset: float
    #: When it may have begun: before ``onset`` where nobody looked then.
    earliest: float
    way: list[tuple[Array, Array]] = field(default_factory=list)

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


def outcomes(
    episode: Episode, now: float, level: Array, variance: Array, known: Known, geometry: Geometry, creep_per_hour: float
) -> list[Outcome]:
    """All outcomes of the ``episode``, given that the board rests at ``level`` (k,) g with errors of ``variance`` (k,).

    Scores are posterior probabilities, the most probable first; among them is one that nothing explains it.
    """
    change, spread = level - episode.level, variance + episode.variance + _FLOOR_G**2
    things = {thing.id: thing for thing in episode.things}
    noises = {thing.id: thing.at(now, creep_per_hour) for thing in episode.things}
    plans = sorted(plans_of(episode.things, known), key=lambda plan: -plan.prior)[:_MOST]
    found: list[Outcome] = []
    for prior, gone, new in plans:
        if prior < plans[0].prior - _HOPELESS:
            break
        left = change + sum((things[i].load for i in sorted(gone)), np.zeros_like(change))
        errors, sure = errors_of([things[i] for i in sorted(gone)], now, creep_per_hour, geometry.count)
        both, total = spread + errors, float(spread.sum()) + sure
        one = _not_told_apart(gone, things)
        if new:
            density = _of_new(left, both, total, new, [things[i] for i in sorted(gone)], known, geometry)
        elif one is not None:
            # Only the sum of it and of others was known: it stood anywhere.
            alone = PutDensity(geometry, _LEAST_G, [_weight(one)], trust=_TRUST, clear=_CLEAR)
            density = alone(one.load - left, both - noises[one.id])
        else:
            density = _of_nothing(left, both, total, [things[i] for i in sorted(gone)], known.shaking)
            if not gone:
                density = float(np.logaddexp(density, _of_the_rest(episode, left, both, geometry)))
        if density > -math.inf:
            found.append(Outcome(gone, new, prior + density, left, both))
    found = sorted(found, key=lambda outcome: -outcome.score)[:_MOST_PATHS]
    ways = [_way(episode, outcome, things, geometry) for outcome in found]
    best = max(ways, default=0.0)
    weighed = [
        replace(outcome, score=outcome.score - _dampened(best - way) + _lifted(episode, outcome, things, known.shaking))
        for outcome, way in zip(found, ways, strict=True)
    ]
    return _normalised([*weighed, _unexplained(episode, change, spread, known, geometry, best)])


def _of_new(
    load: Array,
    variance: Array,
    total: float,
    new: Sequence[str | None],
    gone: Sequence[Thing],
    known: Known,
    geometry: Geometry,
) -> float:
    """Log density of a load that is that of the ``new`` things."""
    of = _expected(gone, new, known.weight)
    trust = 0.5
    if of:
        # What was used up weighs less than is known of it; hardly anything weighs more.
        heavy = float(load.sum()) > max(one.mean_g for one in of) * (1 + _MORE) + _MORE_G
        trust = _TRUST_MORE if heavy else _TRUST
    put = PutDensity(geometry, _LEAST_G * len(new), of, trust=trust, clear=_CLEAR)
    return put(load, variance, total) + (_IN_THE_MIDDLE if len(new) == 2 else 0.0)


def _of_nothing(left: Array, variance: Array, total: float, gone: Sequence[Thing], shaking: bool) -> float:
    """Log density of what is left and should be nothing: but for noise, or for what was measured badly."""
    share, far = (_SHAKEN, _SHAKEN_G) if shaking else (_LOOSE, _BADLY_G)
    more = far**2 + sum(((0.1 * np.abs(thing.load)) ** 2 for thing in gone), np.zeros_like(left))
    sum_more = float(more.sum())
    if gone and not shaking and all(thing.known is not None and not thing.joint for thing in gone):
        # What they weigh was measured well: it is what their tags say.
        sum_more = sum((_OFF_SHARE * float(thing.load.sum()) + _OFF_G) ** 2 for thing in gone)
    well, badly = balanced(left, variance, total), balanced(left, variance + more, total + sum_more)
    return float(np.logaddexp(math.log(1 - share) + well, math.log(share) + badly))


def _of_the_rest(episode: Episode, left: Array, variance: Array, geometry: Geometry) -> float:
    """Log density of what is left, if something was still being put down when the board seemed to rest."""
    put = PutDensity(geometry, _LEAST_G)
    newest = [thing for thing in episode.things if episode.onset - thing.since < _PUT_S]
    return max((_STILL_PUT + put.same_place(thing, left, variance) for thing in newest), default=-math.inf)


def _unexplained(
    episode: Episode, change: Array, spread: Array, known: Known, geometry: Geometry, best_way: float
) -> Outcome:
    """Nobody knows what happened, or a thing went that nobody knew of."""
    put = PutDensity(geometry, _LEAST_G, clear=_CLEAR)
    score = float(np.logaddexp(_UNKNOWN + put.anything(change, spread), _UNLISTED + put(-change, spread)))
    score += sum(max(known.odds(tag)) for tag in sorted({*known.tags, *(one.tag for one in episode.things if one.tag)}))
    score -= _dampened(best_way + 0.5 * WAY * len(change) * len(episode.way))
    return Outcome(frozenset(), (), score, change, spread, known=False)


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


def _weight(thing: Thing) -> KnownWeight:
    weight = float(thing.load.sum())
    return thing.known or KnownWeight(weight, 0.1 * weight + 5.0)


def _dampened(odds: float) -> float:
    """An arm, a slide or a hand also leads a load astray: the way alone never decides."""
    return _MOST_ODDS * math.tanh(odds / _MOST_ODDS)


def _way(episode: Episode, outcome: Outcome, things: Mapping[int, Thing], geometry: Geometry) -> float:
    gone = [things[i] for i in sorted(outcome.gone)]
    anywhere = [thing for thing in gone if thing.joint - outcome.gone]
    loads = [thing.load for thing in gone if thing not in anywhere]
    if outcome.new:
        loads.append(outcome.load)
    return way_odds(episode.way, loads, geometry, free=len(outcome.new) == 2 or bool(anywhere))


def _lifted(episode: Episode, outcome: Outcome, things: Mapping[int, Thing], shaking: bool) -> float:
    """No more is missing on the way than goes or is put elsewhere, and what is put elsewhere was lifted or slid."""
    if len(episode.way) < _SMOOTH:
        return 0.0
    totals = np.array([mean.sum() for mean, _ in episode.way])
    least = float(np.convolve(totals, np.ones(_SMOOTH) / _SMOOTH, "valid").min())
    noise = 3.0 * math.sqrt(float(np.mean([variance.sum() for _, variance in episode.way])) / _SMOOTH)
    weight = sum(float(things[i].load.sum()) for i in outcome.gone)
    if least < -_TOO_MUCH * weight - noise - (_SWING_G if shaking else _TOO_MUCH_G):
        return _HOPELESSLY
    moved = len(outcome.gone) == len(outcome.new) == 1 and things[min(outcome.gone)].tag == outcome.new[0]
    if not moved or least < -_OFF * weight + noise:
        return 0.0
    return math.log(_SLID) if least > -_ON * weight - noise else math.log(_SLID) + _NEITHER


def _normalised(found: Sequence[Outcome]) -> list[Outcome]:
    if not found:
        return []
    top = max(one.score for one in found)
    total = sum(math.exp(one.score - top) for one in found)
    ranked = sorted(found, key=lambda one: -one.score)
    return [replace(one, score=math.exp(one.score - top) / total) for one in ranked]
