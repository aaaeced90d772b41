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
#: Least log-likelihood of a tag that is read only long after its thing was put.
_READ_LATE = -9.0
#: ... and of one that was lifted from another stay after this one began.
_WAS_ELSEWHERE = -9.0
#: A known weight is wrong that often: bottles are emptied.
_EMPTIED = 0.1


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
        if self.lifted.get(tag, -math.inf) > thing.since:
            log += _WAS_ELSEWHERE
        if weight is not None:
            # Relative to a broad density of weights, so that unknown weights neither win nor lose.
            sd = math.hypot(weight.sd_g, at.weight_sd_g, 0.01 * weight.mean_g, 1.0)
            peak = math.exp(-0.5 * ((at.weight_g - weight.mean_g) / sd) ** 2) / (sd * math.sqrt(2 * math.pi))
            log += math.log(_EMPTIED + (1 - _EMPTIED) * peak * max(at.weight_g, 1.0) * 4.0)
        sd_m = math.sqrt(max(at.cov[0], at.cov[2]))
        for zone in sightings:
            if zone in self.zones and not self.zones[zone].covers(at.xy, settings.zone_margin_m + 2 * sd_m):
                log += math.log(settings.false_read_probability)
        # A tag on the board is read nearly every round; in the hand that brings it, now and then.
        missed = self.presence.silent_rounds(tag, thing.since)
        before = self.presence.rounds(tag, min(s.first for s in sightings.values()), thing.onset)[0]
        # Shadowed by another thing, a tag may be read late all the same.
        log += max(missed * math.log(1 - settings.read_probability), _READ_LATE) + min(before, 6) * math.log(0.6)
        return log


def assign(
    things: Sequence[Thing], tags: Mapping[str, Mapping[str, Sighting]], fit: Fit
) -> dict[tuple[int, str], float]:
    """Probability of each (stay, tag); pairs that are impossible are left out."""
    things = sorted(things, key=lambda thing: -thing.since)[:_MOST]
    names = sorted(tags, key=lambda tag: -min(s.first for s in tags[tag].values()))[:_MOST]
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
        log = sum(score[pair] for pair in pairs) + (len(names) - len(pairs)) * math.log(_ELSEWHERE)
        log += (len(things) - len(pairs)) * math.log(_UNTAGGED)
        mass = math.exp(max(log, -300.0))
        total += mass
        for pair in pairs:
            chances[pair] = chances.get(pair, 0.0) + mass
    return {pair: mass / total for pair, mass in chances.items() if total > 0}
