"""People whose place is seen to be empty but who cannot have left: far from every door nobody goes and nobody comes."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tms_agents.floor.events import FloorEvent, Vanished
from tms_agents.floor.identity import alike
from tms_agents.floor.masks import Area
from tms_agents.floor.state import BODY, empty, pack, unpack

Array = NDArray[np.float64]

#: So near a door (m) people come; who is lost so near one has gone.
_DOOR_M, _GONE_M = 1.0, 0.3
#: Who was seen for so many scans is somebody.
_SOMEBODY = 30
#: Where somebody turns up again: so far away (m), and so fast (m/s); for how long he is waited for (s).
_AWAY_M, _SPEED, _WAIT_S = 1.0, 1.0, 20.0
#: So near (m) where he was lost he may stand, since so long (s) before that at most.
_STEPS_M, _JUST_S = 1.2, 4.0
#: Who looks and walks as unlikely as this (log likelihood) is somebody else.
_UNLIKE = -6.0


class Absent:
    """``gates``: the doors. Where they are not known, people may come and go anywhere, and nobody is waited for."""

    def __init__(self, gates: Area) -> None:
        self._gates = gates
        self._bodies: list[Any] = []

    def keep(self, body: Any) -> bool:
        """Whether this one, of whom nothing is seen any more, must be somewhere: then he is waited for."""
        inside = math.inf > self._gates.distance(float(body["x"]), float(body["y"])) > _GONE_M
        somebody = body["hits"] >= _SOMEBODY and not body["robot"] and body["wide"] < 0.3
        if inside and somebody:
            self._bodies.append(body.copy())
            self._bodies[-1]["stale"] = 1
        return bool(inside and somebody)

    def save(self) -> dict[str, Any]:
        """JSON values."""
        return pack(np.array(self._bodies, BODY))

    def restore(self, saved: Any) -> None:
        """Raises KeyError, TypeError or ValueError where that is nothing that ``save`` gave."""
        self._bodies = list(unpack(saved, empty(BODY, int(saved["shape"][0]))))

    def find(self, body: Any, scattered: Array) -> Any:
        """Who of those waited for this new one most probably is, or None; ``scattered`` (3,) as `alike` takes."""
        x, y = float(body["x0"]), float(body["y0"])
        if not self._bodies or body["wide"] > 0.3 or self._gates.distance(x, y) < _DOOR_M:
            return None
        best, best_cost = None, 1.0
        for index, one in enumerate(self._bodies):
            since = max(0.0, float(body["first"]) - float(one["seen"]))
            gap = math.hypot(x - float(one["x"]), y - float(one["y"])) / (_AWAY_M + _SPEED * since)
            likely = float(alike(body, one, scattered))
            cost = 0.5 * gap + 0.5 * likely / _UNLIKE
            if gap < 1.0 and likely > _UNLIKE and cost < best_cost:
                best, best_cost = index, cost
        return None if best is None else self._bodies.pop(best)

    def stands(self, print_: Any) -> bool:
        """Whether the print (`state.PRINT`) may be a foot of one of them: it came near where he was lost."""
        return any(
            print_["rested"] > one["seen"] - _JUST_S
            and math.hypot(print_["x"] - one["x"], print_["y"] - one["y"]) < _STEPS_M
            for one in self._bodies
        )

    def gone(self, t: float) -> list[FloorEvent]:
        """Those who did not turn up."""
        late = [one for one in self._bodies if t - one["seen"] > _WAIT_S]
        self._bodies = [one for one in self._bodies if t - one["seen"] <= _WAIT_S]
        return [Vanished(t, int(one["label"]), float(one["seen"]), t) for one in late]
