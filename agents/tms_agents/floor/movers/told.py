"""Events agree with labels: whatever hypothesis is the best, it is told where movers are, and which are stale."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Any

import numpy as np
from numba import njit

from tms_agents.floor.events import Back, FloorEvent, Moved, Stale, Vanished
from tms_agents.floor.feet.place import place

Point = tuple[float, float]

#: A mover as it is now: its label, place (x, y m, variance m²), whether it is seen and whether it is stale.
_THERE = np.dtype([("label", "i8"), ("x", "f8"), ("y", "f8"), ("variance", "f8"), ("seen", "?"), ("stale", "?")])
#: Nobody is told to be farther (m) from where his label is.
_FAR_M = 0.1


class Told:
    """Where each mover was told to be (x, y m), by label, and which were told to be stale."""

    def __init__(self, most: int) -> None:
        self._places: dict[int, Point] = {}
        self._stale: set[int] = set()
        self._there = np.zeros(most, _THERE)

    def agree(self, events: Iterable[FloorEvent], bodies: Any, awaited: Iterable[Any], t: float) -> list[FloorEvent]:
        """The ``events`` of the scan at t, without what is known, and with what ``bodies`` (n,) tell besides.

        In the hypothesis that is the best now somebody may be hidden who was not in the one before, or be seen again,
        or have somebody else's name. Who is ``awaited`` is stale.
        """
        told = [one for event in events if (one := self._new(event)) is not None]
        there = self._there[: _movers(bodies, t, self._there)].tolist()
        there += [(int(body["label"]), *place(body, t), False, True) for body in awaited]
        for label, x, y, variance, seen, stale in there:
            back = not stale and label in self._stale
            # Where somebody goes whom nobody sees is a guess.
            far = (seen or stale) and math.dist((x, y), self._places.get(label, (x, y))) > _FAR_M
            if back or far:
                event = (Back if back else Moved)(t, label, (x, y), (variance, 0.0, variance))
                told.append(event)
                self._new(event)
        hidden = {label for label, *_, stale in there if stale}
        told += [Stale(t, label) for label in sorted(hidden - self._stale)]
        self._stale = hidden
        return told

    def save(self) -> dict[str, Any]:
        """JSON values."""
        return {"places": [[label, *xy] for label, xy in self._places.items()], "stale": sorted(self._stale)}

    def restore(self, saved: Any) -> None:
        """Raises KeyError, TypeError or ValueError where that is nothing that ``save`` gave."""
        self._places = {int(label): (float(x), float(y)) for label, x, y in saved["places"]}
        self._stale = {int(label) for label in saved["stale"]}

    def _new(self, event: FloorEvent) -> FloorEvent | None:
        """The event, if it is news: what is told is known from now on."""
        if isinstance(event, Stale):
            known = event.label in self._stale
            self._stale.add(event.label)
            return None if known else event
        if isinstance(event, Vanished):
            self._places.pop(event.label, None)
            self._stale.discard(event.label)
            return event
        self._places[event.label] = event.xy
        if isinstance(event, Back) and event.label not in self._stale:
            return Moved(event.t, event.label, event.xy, event.cov)
        if isinstance(event, Back):
            self._stale.remove(event.label)
        return event


@njit(cache=True)
def _movers(bodies: Any, t: float, there: Any) -> int:
    """Fill ``there`` (n,) with the movers among ``bodies`` (n,) at t: how many there are."""
    count = 0
    for b in range(bodies.size):
        body, one = bodies[b], there[count]
        if body.used and body.confirmed:
            one.label, one.seen, one.stale = body.label, body.seen == t, body.stale != 0
            one.x, one.y, one.variance = place(body, t)
            count += 1
    return count
