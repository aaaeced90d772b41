"""A board with known loads: hand-written signals for the estimator, and what it says of them."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from tms_agents.cabinet import CabinetEstimator, CabinetEvent, Geometry, KnownWeight, Zone

CELLS = ((0.04, 0.047), (0.425, 0.047), (0.04, 0.27), (0.425, 0.27))
GEOMETRY = Geometry(CELLS, 0.465, 0.317)
ZONES = {"shelf": Zone("shelf")}


def share(x: float, y: float) -> np.ndarray:
    """What a rigid board gives to each cell of a gram at (x, y); the centre of gravity is (x, y) exactly."""
    across, along = (x - 0.04) / 0.385, (y - 0.047) / 0.223
    return np.array([(1 - across) * (1 - along), across * (1 - along), (1 - across) * along, across * along])


class Bench:
    """A board whose load is whatever a function of time says, sampled at 50 Hz with noise and steps of 5 g."""

    def __init__(self, seed: int = 0, known: dict[str, KnownWeight] | None = None) -> None:
        self.estimator = CabinetEstimator(GEOMETRY, known=known or {}, zones=ZONES)
        self.rng = np.random.default_rng(seed)
        self.t = 0.0
        self.load = np.zeros(4)
        self.tags: frozenset[str] = frozenset()
        self.sd = 8.0
        self.events: list[CabinetEvent] = []
        self.run(4.0)

    def run(self, seconds: float, extra: Callable[[float], np.ndarray] = lambda s: np.zeros(4)) -> list[CabinetEvent]:
        """Go on for so long, ``extra`` grams (of seconds from now) on top of the load; returns the new events."""
        begin, before = self.t, len(self.events)
        for i in range(round(seconds * 50)):
            self.t = begin + 0.02 * i
            grams = self.load + extra(self.t - begin) + self.rng.normal(0.0, self.sd, 4)
            self.events += self.estimator.load(self.t, np.round(grams / 5) * 5)
            if i % 10 == 5:
                read = {tag for tag in self.tags if self.rng.random() < 0.95}
                self.events += self.estimator.inventory(self.t, "shelf", frozenset(read))
        self.t = begin + seconds
        return self.events[before:]

    def change(self, load: np.ndarray, seconds: float = 0.2, rest: float = 3.0) -> list[CabinetEvent]:
        """Add ``load`` within ``seconds``, then rest."""
        events = self.run(seconds, lambda s: load * s / seconds)
        self.load = self.load + load
        return events + self.run(rest)


def of(kind: type, events: list[CabinetEvent]) -> list:
    return [event for event in events if isinstance(event, kind)]
