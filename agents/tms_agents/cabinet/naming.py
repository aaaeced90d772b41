"""Tags to stays: identified where the evidence is clear, told as read in the zone where it is not."""

from __future__ import annotations

import math
from collections.abc import Mapping

from tms_agents.cabinet.events import CabinetEvent, Identified, Vanished, ZoneRead
from tms_agents.cabinet.geometry import KnownWeight, Zone
from tms_agents.cabinet.identify import Fit, assign
from tms_agents.cabinet.presence import Presence, Sighting
from tms_agents.cabinet.settings import EstimatorSettings
from tms_agents.cabinet.stays import Shelf, Thing

#: Weights of that many objects are remembered from their stays.
_LEARNED_KEPT = 5000
#: A tag that was away for so long, and came back within so long of a new thing, came with it.
_AWAY_S, _BROUGHT_S = 2.0, 8.0
#: Two weights are alike within so many standard deviations of both, a share, and 1 g.
_ALIKE, _ALIKE_SHARE = 3.0, 0.005


class Namer:
    """Keeps which present tags are loose, and since when."""

    def __init__(
        self,
        shelf: Shelf,
        presence: Presence,
        zones: Mapping[str, Zone],
        known: Mapping[str, KnownWeight],
        settings: EstimatorSettings,
    ) -> None:
        self._shelf, self._presence, self._zones, self._settings = shelf, presence, zones, settings
        self.known: dict[str, KnownWeight] = dict(known)
        self.learned: dict[str, KnownWeight] = {}
        self._loose: dict[str, float] = {}
        #: When a tag's last stay ended: it cannot be at a stay that began before.
        self._lifted: dict[str, float] = {}
        self._told: dict[tuple[str, str], float] = {}
        #: Weights unlike what was known, seen once.
        self._odd: dict[str, KnownWeight] = {}

    def weight(self, tag: str) -> KnownWeight | None:
        """What the object weighed when it was here last, else what the database says."""
        return self.learned.get(tag) or self.known.get(tag)

    def misfits(self, thing: Thing) -> bool:
        """Whether it does not weigh what its tag says."""
        return thing.tag is not None and thing.known is None and self.weight(thing.tag) is not None

    def loose(self) -> dict[str, KnownWeight | None]:
        """The present tags that are at no stay, with what is known of their weights: what may be put next."""
        return {tag: self.weight(tag) for tag in self._loose}

    def fresh(self, since: float) -> set[str]:
        """The present tags that are at no stay and came into view after a time."""
        return {tag for tag, first in self._loose.items() if first > since}

    def update(self, now: float, *, resting: bool) -> list[CabinetEvent]:
        """Look at tags and stays together; called after every round and every event of the load.

        While the load is not ``resting`` no tag is pinned: it may be that of the thing which is just being put.
        """
        present = self._presence.present()
        events = self._moved_unseen(now, present) if resting else []
        pinned = {thing.tag for thing in self._shelf.things.values() if thing.tag is not None}
        loose = {tag: zones for tag, zones in present.items() if tag not in pinned}
        self._loose = {tag: self._loose.get(tag, now) for tag in loose}
        open_things = [thing for thing in self._shelf.things.values() if thing.tag is None]
        if resting and open_things and loose:
            weights = {tag: weight for tag in loose if (weight := self.weight(tag)) is not None}
            fit = Fit(weights, self._lifted, self._presence, self._zones, self._shelf.geometry, self._settings)
            chances = assign(open_things, loose, fit)
            for (stay, tag), chance in chances.items():
                if chance >= 1 - self._settings.doubt:
                    events.append(self.pin(now, self._shelf.things[stay], tag))
                    del loose[tag], self._loose[tag]
        return events + self._zone_reads(now, loose)

    def pin(self, now: float, thing: Thing, tag: str) -> Identified:
        thing.tag = tag
        weight, at = self.weight(tag), thing.centre(self._shelf.geometry)
        # A weight that does not fit is out of date.
        if weight is not None and abs(at.weight_g - weight.mean_g) < 4 * (at.weight_sd_g + weight.sd_g) + 1.0:
            thing.known = weight
            if thing.joint:
                self._weigh_apart(thing, weight)
        return Identified(now, thing.id, tag)

    def _moved_unseen(self, now: float, present: Mapping[str, Mapping[str, Sighting]]) -> list[CabinetEvent]:
        """Stays whose tag was away and came back with another thing of its weight: that they ended was missed."""
        gone: list[CabinetEvent] = []
        for old in [thing for thing in self._shelf.things.values() if thing.tag in present]:
            assert old.tag is not None
            left = max(sighting.left for sighting in present[old.tag].values())
            back = min(sighting.first for sighting in present[old.tag].values())
            if left < old.since or back - left < _AWAY_S:
                continue
            at = old.centre(self._shelf.geometry)
            for new in self._shelf.things.values():
                weight, sd = (value for value in new.centre(self._shelf.geometry)[2:])
                near = abs(weight - at.weight_g) < 4 * math.hypot(sd, at.weight_sd_g) + 0.02 * at.weight_g
                if new.tag is None and near and abs(new.since - back) < _BROUGHT_S:
                    del self._shelf.things[old.id]
                    gone += [Vanished(now, old.id, at.weight_g, at.weight_sd_g), self.pin(now, new, old.tag)]
                    break
        return gone

    def _weigh_apart(self, thing: Thing, weight: KnownWeight) -> None:
        """The weight of a thing that came together with others tells about the others too."""
        spread = float(thing.variance.sum())
        gain = thing.variance / (spread + weight.sd_g**2)
        change = gain * (weight.mean_g - float(thing.load.sum()))
        thing.load = thing.load + change
        thing.variance = thing.variance * (1 - 0.9 * gain)
        partners = [self._shelf.things[i] for i in thing.joint if i in self._shelf.things]
        for partner in partners:
            partner.load = partner.load - change / len(partners)

    def left(self, thing: Thing, now: float, weight_g: float, sd_g: float) -> None:
        """A thing was lifted: remember what it weighed."""
        if thing.tag is not None:
            self._lifted[thing.tag] = now
            if self._is_odd(thing.tag, KnownWeight(weight_g, sd_g)):
                return
            self.learned.pop(thing.tag, None)
            self.learned[thing.tag] = KnownWeight(weight_g, sd_g + 0.005 * abs(weight_g))
            while len(self.learned) > _LEARNED_KEPT:
                del self.learned[next(iter(self.learned))]
            while len(self._lifted) > _LEARNED_KEPT:
                del self._lifted[next(iter(self._lifted))]

    def _is_odd(self, tag: str, new: KnownWeight) -> bool:
        """Whether a weight is unlike what is known, for the first time: it may be another thing's."""
        known, odd = self.weight(tag), self._odd.pop(tag, None)
        if known is None or _like(new, known) or (odd is not None and _like(new, odd)):
            return False
        self._odd[tag] = new
        while len(self._odd) > _LEARNED_KEPT:
            del self._odd[next(iter(self._odd))]
        return True

    def _zone_reads(self, now: float, loose: Mapping[str, Mapping[str, Sighting]]) -> list[CabinetEvent]:
        events: list[CabinetEvent] = []
        for tag, zones in loose.items():
            for zone, sighting in zones.items():
                # Read for so long, not only not yet taken for gone: that takes some rounds after a thing was lifted.
                long = sighting.last - self._loose[tag] >= self._settings.zone_read_after_s
                if long and (zone, tag) not in self._told:
                    self._told[zone, tag] = now
                    events.append(ZoneRead(now, zone, tag))
        over = [(zone, tag) for zone, tag in self._told if zone not in loose.get(tag, {})]
        for zone, tag in over:
            del self._told[zone, tag]
            if not self._presence.is_present(tag) and not any(z == zone for z, _ in self._told):
                events.append(ZoneRead(now, zone, None))
        return events


def _like(one: KnownWeight, other: KnownWeight) -> bool:
    return (
        abs(one.mean_g - other.mean_g) < _ALIKE * math.hypot(one.sd_g, other.sd_g) + _ALIKE_SHARE * other.mean_g + 1.0
    )
