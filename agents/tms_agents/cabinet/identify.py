"""Which present tag is on which stay: the probabilities of all assignments, by weight, antenna zone and time."""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence

from tms_agents.cabinet.geometry import Geometry, KnownWeight, Zone
from tms_agents.cabinet.presence import Presence, Sighting
from tms_agents.cabinet.settings import EstimatorSettings
from tms_agents.cabinet.stays import Thing

#: More open stays or tags than this are not looked at together: the newest count.
_MOST = 4
#: Prior odds of a tag that is not on any open stay (in a hand, in the neighbour's cabinet), and of a stay without tag.
_ELSEWHERE, _UNTAGGED = 0.02, 0.1
#: A known weight is wrong that often: bottles are emptied.
_EMPTIED = 0.1


def assign(
    things: Sequence[Thing],
    tags: Mapping[str, Mapping[str, Sighting]],
    weights: Mapping[str, KnownWeight],
    presence: Presence,
    zones: Mapping[str, Zone],
    geometry: Geometry,
    settings: EstimatorSettings,
) -> dict[tuple[int, str], float]:
    """Probability of each (stay, tag); pairs that are impossible are left out."""
    things = sorted(things, key=lambda thing: -thing.since)[:_MOST]
    names = sorted(tags, key=lambda tag: -min(s.first for s in tags[tag].values()))[:_MOST]
    score = {
        (thing.id, tag): _fit(thing, tag, tags[tag], weights.get(tag), presence, zones, geometry, settings)
        for thing in things
        for tag in names
    }
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


def _fit(
    thing: Thing,
    tag: str,
    sightings: Mapping[str, Sighting],
    weight: KnownWeight | None,
    presence: Presence,
    zones: Mapping[str, Zone],
    geometry: Geometry,
    settings: EstimatorSettings,
) -> float:
    at = thing.centre(geometry)
    log = 0.0
    if weight is not None and not thing.joint:
        # Relative to a broad density of weights, so that unknown weights neither win nor lose.
        sd = math.hypot(weight.sd_g, at.weight_sd_g, 0.01 * weight.mean_g, 1.0)
        peak = math.exp(-0.5 * ((at.weight_g - weight.mean_g) / sd) ** 2) / (sd * math.sqrt(2 * math.pi))
        log += math.log(_EMPTIED + (1 - _EMPTIED) * peak * max(at.weight_g, 1.0) * 4.0)
    sd_m = math.sqrt(max(at.cov[0], at.cov[2]))
    for zone in sightings:
        if zone in zones and not zones[zone].covers(at.xy, settings.zone_margin_m + 2 * sd_m):
            log += math.log(settings.false_read_probability)
    # A tag on the board is read nearly every round; in the hand that brings it, now and then.
    first = min(s.first for s in sightings.values())
    _, missed = presence.rounds(tag, thing.since, first - 1e-9)
    before, _ = presence.rounds(tag, -math.inf, thing.onset)
    log += missed * math.log(1 - settings.read_probability) + min(before, 6) * math.log(0.6)
    return log
