"""Who came near an object while it was not seen: that is who may have taken it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from tms_agents.floor.norm import norm
from tms_agents.floor.objects.candidates import FAR_M

Array = NDArray[np.float64]

#: So many are remembered for one object.
_MOST = 32


class Visitors:
    """Of each of so many ``things`` (n): labels of movers, and how near (m) each was since the thing was last seen."""

    def __init__(self, things: int) -> None:
        self._movers, self._gaps = np.zeros((things, _MOST), np.int64), np.zeros((things, _MOST))

    def attend(self, things: Any, bodies: Any, t: float) -> None:
        """Take in where all are at t: whoever is near a thing when it is seen last is kept from this scan on."""
        _attend(things, bodies, t, self._movers, self._gaps)

    def of(self, index: int) -> dict[int, float]:
        """Label -> m of those near the thing, in the order of their labels."""
        count = int(np.count_nonzero(self._movers[index]))
        return dict(sorted(zip(self._movers[index, :count].tolist(), self._gaps[index, :count].tolist(), strict=True)))

    def forget(self, index: int) -> None:
        """The thing is another one."""
        self._movers[index] = 0

    def save(self, things: Any) -> list[Any]:
        """JSON values."""
        used = np.flatnonzero(things["used"]).tolist()
        return [[int(things["label"][index]), list(self.of(index).items())] for index in used]

    def restore(self, things: Any, saved: Sequence[Any]) -> None:
        """Raises KeyError, TypeError or ValueError where that is nothing that ``save`` gave."""
        slots = {int(things["label"][index]): index for index in np.flatnonzero(things["used"]).tolist()}
        for label, visitors in saved:
            index = slots[int(label)]
            for slot, (mover, gap) in enumerate(visitors[:_MOST]):
                self._movers[index, slot], self._gaps[index, slot] = int(mover), float(gap)


@njit(cache=True)
def _attend(things: Any, bodies: Any, t: float, movers: NDArray[np.int64], gaps: Array) -> None:
    for k in range(things.size):
        thing = things[k]
        if not thing.used:
            continue
        if thing.seen == t:
            movers[k, :] = 0
        for b in range(bodies.size):
            body = bodies[b]
            if body.used and body.confirmed:
                away = norm(thing.x - body.x, thing.y - body.y)
                if away < FAR_M:
                    _note(movers[k], gaps[k], body.label, away)


@njit(cache=True)
def _note(movers: NDArray[np.int64], gaps: Array, label: int, away: float) -> None:
    """Somebody was so near (m); where there is no more room, whoever was farthest is forgotten."""
    slot = 0
    for k in range(movers.size):
        if movers[k] == label:
            gaps[k] = min(gaps[k], away)
            return
        if movers[k] == 0:
            movers[k], gaps[k] = label, away
            return
        if gaps[k] > gaps[slot]:
            slot = k
    if away < gaps[slot]:
        movers[slot], gaps[slot] = label, away
