"""Feet that were taken for things and have gone by themselves: somebody is there, also if he does not walk."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from tms_agents.floor.movers.reappearing import STEPS_S
from tms_agents.floor.movers.review import LIKELY

#: Somebody who shifts a foot puts it down so near (m), and is looked for so long (s); seen so often, he is there.
_SHIFT_M, _BY_ITSELF_S, _HITS = 0.35, 2.0, 5
#: Who was wide in such a share of late is no foot.
_WIDE = 0.3


class Strides:
    """Where such feet were, for as long as it matters."""

    def __init__(self) -> None:
        #: When each was seen last (s), x, y (m), until when it matters (s).
        self._strides: list[tuple[float, float, float, float]] = []

    def add(self, walked: Sequence[tuple[float, float, float]], t: float) -> None:
        """Things have gone by themselves (`Objects.walked`): they were feet, and whose they were is near."""
        self._strides += [(*one, t + _BY_ITSELF_S) for one in walked]

    def found(self, bodies: Any, t: float) -> set[int]:
        """Which of the ``bodies`` (n,) not believed yet are whose feet these were: they need not walk."""
        self._strides = [stride for stride in self._strides if t < stride[3]]
        return {
            index
            for since, x, y, _ in self._strides
            for index, body in enumerate(bodies)
            if _is_new_foot(body, since, t) and math.hypot(body["x"] - x, body["y"] - y) < _SHIFT_M
        }

    def save(self) -> list[tuple[float, float, float, float]]:
        """JSON values."""
        return list(self._strides)

    def restore(self, saved: Any) -> None:
        """Raises TypeError or ValueError where that is nothing that ``save`` gave."""
        self._strides = [(float(t), float(x), float(y), float(matters)) for t, x, y, matters in saved]


def _is_new_foot(body: Any, since: float, t: float) -> bool:
    new = body["used"] and not body["confirmed"] and body["seen"] == t and body["from_furniture"] == 0
    steps = body["first"] > since - STEPS_S and body["hits"] >= _HITS and body["wide"] < _WIDE
    return bool(new and steps and body["score"] >= LIKELY * body["hits"])
