"""Which tags are there, from inventory rounds that miss some and invent some: log-odds per tag and antenna zone."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterable
from dataclasses import dataclass, field

from tms_agents.cabinet.settings import EstimatorSettings

#: Limits of the log-odds: about two reads make a tag present, about four misses make it gone.
_LEAST, _MOST = -5.0, 8.0
_PRESENT, _GONE = 2.0, -2.0
#: So long before its thing is put a tag may be read first.
_BROUGHT_S = 1.0
_ROUNDS_KEPT = 64
_TAGS_KEPT = 2000


@dataclass(slots=True)
class Sighting:
    """One tag in one zone."""

    odds: float = _LEAST
    present: bool = False
    #: When it was first read in this visit, and when it was taken for present.
    first: float = 0.0
    since: float = 0.0
    #: When it was read last, and when it was taken for gone.
    last: float = 0.0
    left: float = -math.inf
    rounds: deque[tuple[float, bool]] = field(default_factory=lambda: deque(maxlen=_ROUNDS_KEPT))


class Presence:
    """``see`` rounds; ask who is present, and what the rounds since a moment say about a tag."""

    def __init__(self, settings: EstimatorSettings) -> None:
        hit, false = settings.read_probability, settings.false_read_probability
        self._read = math.log(hit / false)
        self._missed = math.log((1 - hit) / (1 - false))
        self._hit, self._false = hit, false
        self._zones: dict[str, dict[str, Sighting]] = {}
        self._rounds: dict[str, deque[float]] = {}

    def see(self, t: float, zone: str, tags: Iterable[str]) -> None:
        """One completed round of one zone."""
        known = self._zones.setdefault(zone, {})
        self._rounds.setdefault(zone, deque(maxlen=_ROUNDS_KEPT)).append(t)
        seen = set(tags)
        for tag in seen - known.keys():
            if len(known) < _TAGS_KEPT:
                known[tag] = Sighting()
        for tag, sighting in list(known.items()):
            read = tag in seen
            if read and sighting.odds <= _LEAST:
                sighting.first = t
            sighting.odds = min(max(sighting.odds + (self._read if read else self._missed), _LEAST), _MOST)
            sighting.rounds.append((t, read))
            if read:
                sighting.last = t
            if not sighting.present and sighting.odds > _PRESENT:
                sighting.present, sighting.since = True, t
            elif sighting.present and sighting.odds < _GONE:
                sighting.present, sighting.left = False, t
            if sighting.odds <= _LEAST and t - sighting.last > 60.0:
                del known[tag]

    def present(self) -> dict[str, dict[str, Sighting]]:
        """Present tags, each with the zones that see it."""
        found: dict[str, dict[str, Sighting]] = {}
        for zone, tags in self._zones.items():
            for tag, sighting in tags.items():
                if sighting.present:
                    found.setdefault(tag, {})[zone] = sighting
        return found

    def is_present(self, tag: str) -> bool:
        return any(tags[tag].present for tags in self._zones.values() if tag in tags)

    def sightings(self, tag: str) -> dict[str, Sighting]:
        return {zone: tags[tag] for zone, tags in self._zones.items() if tag in tags}

    def rounds(self, tag: str, start: float, end: float = math.inf) -> tuple[int, int]:
        """How often the zones that know the tag read and missed it from ``start`` to ``end``."""
        looks = [
            read
            for sighting in self.sightings(tag).values()
            if sighting.present or sighting.left >= start or sighting.last >= start - 5.0
            for t, read in sighting.rounds
            if start <= t <= end
        ]
        return sum(looks), len(looks) - sum(looks)

    def looks(self, tag: str, start: float) -> list[bool]:
        """Whether the tag was read in each round from ``start``, in order, in the zone that read it most."""
        found = []
        for zone, times in self._rounds.items():
            sighting = self._zones[zone].get(tag)
            read = set() if sighting is None else {t for t, seen in sighting.rounds if seen}
            found.append([t in read for t in times if t >= start])
        return max(found, default=[], key=lambda one: (sum(one), -len(one)))

    def undecided(self, since: float) -> bool:
        """Whether a tag may have come into view at ``since`` that is not present yet: it was read, but too rarely, or
        some zone has not looked since then."""
        if any(times[-1] < since for times in self._rounds.values()):
            return True
        seen = (sighting for tags in self._zones.values() for sighting in tags.values())
        return any(not one.present and one.last >= since - _BROUGHT_S and one.last > one.left for one in seen)

    def silent_rounds(self, tag: str, start: float) -> int:
        """Rounds from ``start`` until the tag was first read in this visit, in the zone that read it first."""
        zone, sighting = min(self.sightings(tag).items(), key=lambda item: item[1].first)
        return sum(start <= t < sighting.first - 1e-9 for t in self._rounds[zone])

    def taken(self, tag: str, since: float, in_hand: float = 0.3) -> float:
        """Log-likelihood ratio that the tag left at ``since``; a lifted thing may stay in view in the hand."""
        read, missed = self.rounds(tag, since)
        still = read * math.log(self._hit) + missed * math.log(1 - self._hit)
        gone = read * math.log(self._false) + missed * math.log(1 - self._false)
        return math.log((1 - in_hand) * math.exp(max(gone - still, -50.0)) + in_hand)
