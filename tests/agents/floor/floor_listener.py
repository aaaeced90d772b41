"""Whoever hears the floor estimator's events, and nothing else."""

from __future__ import annotations

import math
from collections.abc import Sequence

from tms_agents.floor import Appeared, Back, Confused, FloorEvent, FloorLabel, Met, Moved, Stale, Vanished


class Listener:
    """Knows which labels there are, of which kind, and which are stale."""

    def __init__(self) -> None:
        self.kinds: dict[int, str] = {}
        self.stale: set[int] = set()
        self.before: set[int] = set()

    def hear(self, event: FloorEvent) -> None:
        if isinstance(event, Appeared):
            assert event.label not in self.kinds | dict.fromkeys(self.before)
            self.kinds[event.label] = event.kind
            return
        if isinstance(event, Confused):
            assert {event.label, event.other} <= self.kinds.keys() | self.before and event.label != event.other
            assert 0.0 < event.p <= 1.0 and event.since <= event.t
            return
        if isinstance(event, Met):
            assert {event.label, event.other} <= self.kinds.keys() | self.before and event.label != event.other
            assert event.since <= event.t
            return
        assert event.label in self.kinds
        if isinstance(event, Stale):
            assert event.label not in self.stale
            self.stale.add(event.label)
        elif isinstance(event, Back):
            self.stale.remove(event.label)
        elif isinstance(event, Vanished):
            del self.kinds[event.label]
            self.stale.discard(event.label)
            self.before.add(event.label)
            assert event.into is None or event.into in self.kinds
        else:
            assert isinstance(event, Moved)

    def agrees(self, there: Sequence[FloorLabel]) -> None:
        """With these labels, each of which is somewhere."""
        assert len({one.id for one in there}) == len(there)
        assert {one.id: one.kind for one in there} == self.kinds
        assert {one.id for one in there if one.stale} == self.stale
        assert all(math.isfinite(value) for one in there for value in (*one.xy, *one.cov))
