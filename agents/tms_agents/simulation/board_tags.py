"""The tag reader of a cabinet: inventory rounds over its antenna zones, with missed and with stray reads."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Xy = tuple[float, float]


@dataclass(frozen=True, slots=True)
class ZoneBox:
    """The part of the board that one antenna reads, metres; by default everything."""

    name: str
    low: Xy = (-math.inf, -math.inf)
    high: Xy = (math.inf, math.inf)

    def holds(self, xy: Xy) -> bool:
        return self.low[0] <= xy[0] < self.high[0] and self.low[1] <= xy[1] < self.high[1]


@dataclass(frozen=True, kw_only=True, slots=True)
class TagParameters:
    zones: tuple[ZoneBox, ...] = (ZoneBox("board"),)
    miss_rate: float = 0.05  # per round and tag
    stray_rate: float = 0.01  # per round: a tag that is not in the zone
    #: Tags near the cabinet that are never in it, for stray reads; things that were taken out are read astray too.
    strangers: tuple[str, ...] = ()
    #: A round begins every so often, each zone in its turn; its antenna is on for so long.
    period_s: float = 0.5
    on_s: float = 0.15


@dataclass(frozen=True, slots=True)
class TagRound:
    """One completed round of one zone: ``t`` is its end."""

    t: float
    zone: str
    tags: frozenset[str]


@dataclass(frozen=True, slots=True)
class InField:
    """A tag is at ``xy`` above the board from ``start`` to ``end``."""

    tag: str
    start: float
    end: float
    xy: Xy


class TagReader:
    """Reads what is in the field, as far as it reads at all."""

    def __init__(self, parameters: TagParameters, rng: np.random.Generator) -> None:
        names = [zone.name for zone in parameters.zones]
        if not names or len(set(names)) != len(names):
            raise ValueError("every zone needs a name of its own")
        self.parameters = parameters
        self._zones = {zone.name: zone for zone in parameters.zones}
        self._rng = rng
        self._near: set[str] = set(parameters.strangers)

    def read(self, zone: str, t: float, field: Iterable[InField]) -> frozenset[str]:
        """One round of ``zone`` that ends at ``t``. Raises KeyError for a zone that is not there."""
        box, p = self._zones[zone], self.parameters
        present = [one for one in field if one.start <= t < one.end]
        inside = sorted({one.tag for one in present if box.holds(one.xy)})
        self._near.update(one.tag for one in present)
        read = {tag for tag in inside if self._rng.random() >= p.miss_rate}
        if self._rng.random() < p.stray_rate and (astray := sorted(self._near.difference(inside))):
            read.add(astray[int(self._rng.integers(len(astray)))])
        return frozenset(read)

    def rounds_between(self, after: float, until: float) -> list[tuple[float, str]]:
        """End and zone of the rounds of the reader's own rhythm that end in (after, until]."""
        p = self.parameters
        first = max(0, math.floor((after - p.on_s) / p.period_s + 1e-9) + 1)
        last = math.floor((until - p.on_s) / p.period_s + 1e-9)
        return [(i * p.period_s + p.on_s, p.zones[i % len(p.zones)].name) for i in range(first, last + 1)]

    def on_at(self, t: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Whether an antenna is on at times (n,), in the reader's own rhythm."""
        p = self.parameters
        return np.asarray(np.mod(t + 1e-9, p.period_s) < p.on_s)
