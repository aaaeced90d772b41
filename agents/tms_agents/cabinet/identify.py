"""Which present tag is on which stay: the probabilities of all assignments, by weight, antenna zone and time."""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from tms_agents.cabinet.geometry import Geometry, KnownWeight, Zone
from tms_agents.cabinet.presence import Presence, Sighting
from tms_agents.cabinet.settings import EstimatorSettings
from tms_agents.cabinet.stays import Thing

#: More open stays or tags than this are not looked at together: the newest count.
_MOST = 4
#: Prior odds of a tag that is not on any open stay (in a hand, in the neighbour's cabinet), and of a stay without tag.
_ELSEWHERE, _UNTAGGED = 0.02, 0.1
#: ... of which so much is for good (a neighbour's cabinet); that it is in a hand fades with every read after some.
_NEIGHBOUR, _FADES, _SOME = 0.004, 0.75, 5
#: Least log-likelihood of a tag that is read only long after its thing was put.
_READ_LATE = -9.0
#: ... and of one that was lifted from another stay after this one began.
_WAS_ELSEWHERE = -14.0
#: ... and of one whose last stay ended in the step in which this one began.
_IN_ONE_STEP = -3.0
#: A known weight is wrong that often: bottles are emptied, hardly ever filled to more than twice what they weighed.
_EMPTIED, _FILLED = 0.1, 0.003
#: A tag that was read for so long before the thing came did not come with it, though the rounds are not kept so long.
_LONG_BEFORE_S, _IN_HAND_S, _BEFORE_MOST = 4.0, 20.0, 8


@dataclass(frozen=True, slots=True)
class Fit:
    """What is known of tags beside where they are read."""

    weights: Mapping[str, KnownWeight]
    #: When each tag was lifted last.
    lifted: Mapping[str, float]
    presence: Presence
    zones: Mapping[str, Zone]
    geometry: Geometry
    settings: EstimatorSettings

    def __call__(self, thing: Thing, tag: str, sightings: Mapping[str, Sighting]) -> float:
        """Log-likelihood of the tag's reads and the thing's weight if they belong together, relative to strangers."""
        at = thing.centre(self.geometry)
        weight, settings = self.weights.get(tag), self.settings
        log = 0.0
        if self.lifted.get(tag, -math.inf) >= thing.since:
            log += _WAS_ELSEWHERE if self.lifted[tag] > thing.since else _IN_ONE_STEP
        if weight is not None:
            # Relative to a broad density of weights, so that unknown weights neither win nor lose.
            sd = math.hypot(weight.sd_g, at.weight_sd_g, 0.01 * weight.mean_g, 1.0)
            peak = math.exp(-0.5 * ((at.weight_g - weight.mean_g) / sd) ** 2) / (sd * math.sqrt(2 * math.pi))
            wrong = _EMPTIED if at.weight_g < 2.0 * weight.mean_g else _FILLED
            log += math.log(wrong + (1 - wrong) * peak * max(at.weight_g, 1.0) * 4.0)
        sd_m = math.sqrt(max(at.cov[0], at.cov[2]))
        for zone in sightings:
            if zone in self.zones and not self.zones[zone].covers(at.xy, settings.zone_margin_m + 2 * sd_m):
                log += math.log(settings.false_read_probability)
        # A tag on the board is read nearly every round; in the hand that brings it, now and then.
        missed = self.presence.silent_rounds(tag, thing.since)
        first, lifted = min(s.first for s in sightings.values()), self.lifted.get(tag, -math.inf)
        before = self.presence.rounds(tag, max(first, lifted), thing.onset)[0]
        if thing.onset - max(first, lifted) > (_IN_HAND_S if lifted > first else _LONG_BEFORE_S):
            before = _BEFORE_MOST
        # Shadowed by another thing, a tag may be read late all the same.
        log += max(missed * math.log(1 - settings.read_probability), _READ_LATE) + min(before, _BEFORE_MOST) * math.log(
            0.6
        )
        return log


def assign(
    things: Sequence[Thing], tags: Mapping[str, Mapping[str, Sighting]], fit: Fit
) -> dict[tuple[int, str], float]:
    """Probability of each (stay, tag); pairs that are impossible are left out."""
    things = sorted(things, key=lambda thing: -thing.since)[:_MOST]
    names = sorted(tags, key=lambda tag: -min(s.first for s in tags[tag].values()))[:_MOST]
    elsewhere = {tag: math.log(_elsewhere(tag, tags[tag], fit)) for tag in names}
    score = {(thing.id, tag): fit(thing, tag, tags[tag]) for thing in things for tag in names}
    chances: dict[tuple[int, str], float] = {}
    total = 0.0
    places: list[str | None] = [*names, *([None] * len(things))]
    seen: set[tuple[str | None, ...]] = set()
    for chosen in itertools.permutations(places, len(things)):
        if chosen in seen:
            continue
        seen.add(chosen)
        pairs = [(thing.id, tag) for thing, tag in zip(things, chosen, strict=True) if tag is not None]
        log = sum(score[pair] for pair in pairs) + sum(elsewhere[tag] for tag in names if tag not in chosen)
        log += (len(things) - len(pairs)) * math.log(_UNTAGGED)
        mass = math.exp(max(log, -300.0))
        total += mass
        for pair in pairs:
            chances[pair] = chances.get(pair, 0.0) + mass
    return {pair: mass / total for pair, mass in chances.items() if total > 0}


def _elsewhere(tag: str, sightings: Mapping[str, Sighting], fit: Fit) -> float:
    """Prior odds of a tag that it is not on any open stay."""
    first = min(sighting.first for sighting in sightings.values())
    read, _ = fit.presence.rounds(tag, max(first, fit.lifted.get(tag, -math.inf)))
    return _NEIGHBOUR + (_ELSEWHERE - _NEIGHBOUR) * _FADES ** max(read - _SOME, 0)
