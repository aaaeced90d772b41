"""Events agree with labels: whatever hypothesis is the best, it is told where movers are, and which are stale."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np
from numba import njit

from tms_agents.floor.events import Appeared, Back, Confused, FloorEvent, Met, Moved, Stale, Vanished
from tms_agents.floor.feet.place import place
from tms_agents.floor.norm import norm

#: What was told of a mover: where it is (x, y m), and whether it is stale.
_KNOWN = np.dtype([("label", "i8"), ("x", "f8"), ("y", "f8"), ("stale", "?")])
#: A mover as it is (x, y m, variance m²), where that is not what was told: what is to be told.
_NEWS = np.dtype([("label", "i8"), ("x", "f8"), ("y", "f8"), ("variance", "f8"), ("what", "i8")])
_MOVED, _BACK, _STALE = 1, 2, 4
#: Nobody who is seen, or stale, is told to be farther (m) from where the label is.
_FAR_M = 0.1


class Told:
    """What was told of each mover; so many bodies at ``most``."""

    def __init__(self, most: int) -> None:
        #: By label the row of what is known; rows of label 0 are free.
        self._rows: dict[int, int] = {}
        self._known, self._news = np.zeros(2 * most, _KNOWN), np.zeros(most, _NEWS)

    def agree(self, events: Iterable[FloorEvent], bodies: Any, t: float) -> list[FloorEvent]:
        """The ``events`` of the scan at t, without what is known, and with what ``bodies`` (n,) tell besides.

        In the hypothesis that is the best now somebody may be hidden who was not in the one before, or be seen again,
        or have somebody else's name.
        """
        told = [one for event in events if (one := self._new(event)) is not None]
        for label, x, y, variance, what in self._news[: _news(bodies, t, self._known, self._news)].tolist():
            more: list[FloorEvent] = []
            if what & (_MOVED | _BACK):
                more.append((Back if what & _BACK else Moved)(t, label, (x, y), (variance, 0.0, variance)))
            if what & _STALE:
                more.append(Stale(t, label))
            told += [one for event in more if (one := self._new(event)) is not None]
        return told

    def save(self) -> list[list[Any]]:
        """JSON values."""
        return [list(self._known[row].tolist()) for row in self._rows.values()]

    def restore(self, saved: Any) -> None:
        """Raises KeyError, TypeError or ValueError where that is nothing that ``save`` gave."""
        self._rows.clear()
        self._known["label"] = 0
        for label, x, y, stale in saved:
            row = self._row(int(label))
            self._known[row] = int(label), float(x), float(y), bool(stale)

    def _new(self, event: FloorEvent) -> FloorEvent | None:
        """The event, if it is news: what is told is known from now on."""
        if isinstance(event, Confused | Met):
            return event
        if isinstance(event, Vanished):
            if (gone := self._rows.pop(event.label, None)) is not None:
                self._known["label"][gone] = 0
            return event
        row = self._row(event.label)
        known = self._known[row]
        was_stale = bool(known["stale"])
        if isinstance(event, Stale):
            known["stale"] = True
            return None if was_stale else event
        known["x"], known["y"] = event.xy
        if isinstance(event, Appeared | Back):
            known["stale"] = False
        if isinstance(event, Back) and not was_stale:
            return Moved(event.t, event.label, event.xy, event.cov)
        return event

    def _row(self, label: int) -> int:
        """Where what is known of the label is."""
        if (row := self._rows.get(label)) is None:
            if len(self._rows) == self._known.size:
                self._known = np.concatenate([self._known, np.zeros_like(self._known)])
            row = self._rows[label] = int((self._known["label"] == 0).argmax())
            self._known[row] = label, np.nan, np.nan, False
        return row


@njit(cache=True)
def _news(bodies: Any, t: float, known: Any, news: Any) -> int:
    """Fill ``news`` (n,) with the movers among ``bodies`` (n,) of whom other things are ``known`` (k,): how many."""
    count = 0
    for b in range(bodies.size):
        body = bodies[b]
        if not body.used or not body.confirmed:
            continue
        for k in range(known.size):
            one = known[k]
            if one.label != body.label:
                continue
            x, y, variance = place(body, t)
            what = 0
            if one.stale and not body.stale:
                what = _BACK
            elif (body.stale or body.seen == t) and norm(x - one.x, y - one.y) > _FAR_M:
                # Where somebody goes whom nobody sees is a guess.
                what = _MOVED
            if body.stale and not one.stale:
                what += _STALE
            if what:
                new = news[count]
                new.label, new.x, new.y, new.variance, new.what = body.label, x, y, variance, what
                count += 1
            break
    return count
