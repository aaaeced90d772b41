"""From single reads of a tag reader to rounds: which tags a zone had, and when it had been asked for all."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

from tms_agents.devices.tags import RoundEnd, TagItem

_MAX_TAGS = 1000


class Round(NamedTuple):
    """A completed round of one zone at sensor time ``t``."""

    t: float
    zone: str
    tags: frozenset[str]


class Rounds:
    """Collects per antenna.

    Where the reader ``tells_ends`` of its rounds, only those count; of any other, what it reported within ``window_s``
    seconds is a round. Antennas that share a zone are one: its round is complete when each of them was asked. Tags
    longer than 64 digits do not exist on the wire and are left out.
    """

    def __init__(
        self, zones: Mapping[int, str], rest: str | None, window_s: float, *, tells_ends: bool = False
    ) -> None:
        """``zones`` by antenna; ``rest`` is the zone of antennas that are not named, None ignores them.

        ``tells_ends``: known to tell the end of its rounds, so that none it leaves out is made up from a window.
        """
        self._zones, self._rest, self._window_s = dict(zones), rest, window_s
        self._tags: dict[int, set[str]] = {}
        self._done: dict[str, dict[int, frozenset[str]]] = {}
        self.tells_ends = tells_ends
        self._window_end: float | None = None

    def take(self, t: float, items: Sequence[TagItem]) -> list[Round]:
        rounds: list[Round] = []
        for item in items:
            zone = self._zones.get(item.antenna, self._rest)
            if zone is None:
                continue
            if isinstance(item, RoundEnd):
                rounds += self._antenna_done(t, zone, item.antenna)
            elif len(item.tag) <= 64 and len(tags := self._tags.setdefault(item.antenna, set())) < _MAX_TAGS:
                tags.add(item.tag.upper())
        return rounds

    def tick(self, t: float, delivering: bool) -> list[Round]:
        """For readers without ends of rounds: call now and then; nothing is told of a reader that does not deliver."""
        if self.tells_ends:
            return []
        if not delivering or self._window_end is None:
            self._window_end = t + self._window_s
            self._tags.clear()
            return []
        if t < self._window_end:
            return []
        self._window_end = t + self._window_s
        found: dict[str, set[str]] = {zone: set() for zone in self._all_zones()}
        for antenna, tags in self._tags.items():
            zone = self._zones.get(antenna, self._rest)
            assert zone is not None
            found.setdefault(zone, set()).update(tags)
        self._tags.clear()
        return [Round(t, zone, frozenset(tags)) for zone, tags in found.items()]

    def reset(self) -> None:
        """The reader failed: what it reported so far is no whole round."""
        self._tags.clear()
        self._done.clear()
        self._window_end = None

    def _antenna_done(self, t: float, zone: str, antenna: int) -> list[Round]:
        done = self._done.setdefault(zone, {})
        done[antenna] = frozenset(self._tags.pop(antenna, ()))
        if any(self._zones[other] == zone and other not in done for other in self._zones):
            return []
        del self._done[zone]
        return [Round(t, zone, frozenset().union(*done.values()))]

    def _all_zones(self) -> list[str]:
        return sorted({*self._zones.values(), *([self._rest] if self._rest else [])})
