"""Furniture that was moved: where the background has gone, and new things nearby that are what has gone from there."""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

#: Furniture is pushed so far at most (m), and stands again so long after its old place was seen free (s).
_PUSHED_M, _PUSHED_S = 1.3, 30.0


@dataclass(slots=True)
class Spot:
    """Where the background has gone: a piece of it, ``width`` m wide."""

    t: float
    x: float
    y: float
    width: float
    matched: bool = False


class Furniture:
    """Remembers where the background has gone lately."""

    def __init__(self) -> None:
        self.spots: deque[Spot] = deque(maxlen=64)

    def revealed(self, t: float, beams: NDArray[np.int64], old: Array, rays: Array) -> None:
        """The background of ``beams`` (m,) at ``old`` (m,) m has gone."""
        start = 0
        for i in range(1, beams.size + 1):
            if i < beams.size and beams[i] - beams[i - 1] <= 3 and abs(old[i] - old[i - 1]) < 0.15:
                continue
            b, r = beams[start:i], old[start:i]
            x, y = rays[b, 0] + r * rays[b, 2], rays[b, 1] + r * rays[b, 3]
            spacing = float(r.mean()) * 0.006
            width = math.hypot(x[-1] - x[0], y[-1] - y[0]) + spacing
            self._add(Spot(t, float(x.mean()), float(y.mean()), width))
            start = i

    def _add(self, spot: Spot) -> None:
        """A piece is often revealed beam by beam."""
        for other in self.spots:
            away = math.hypot(other.x - spot.x, other.y - spot.y)
            if not other.matched and spot.t - other.t < 5.0 and away < 0.5 * (other.width + spot.width) + 0.03:
                other.width = max(other.width, spot.width, away + 0.5 * (other.width + spot.width))
                other.t = spot.t
                return
        self.spots.append(spot)

    def explains(self, print_: Any, t: float) -> bool:
        """Whether the print is a piece of furniture that has gone from somewhere near; each piece explains one."""
        best, best_cost = None, 1.0
        for spot in self.spots:
            away = math.hypot(spot.x - print_["x"], spot.y - print_["y"])
            if spot.matched or away > _PUSHED_M or not -_PUSHED_S < print_["first"] - spot.t < _PUSHED_S:
                continue
            difference = abs(spot.width - print_["width"]) / (0.03 + 0.4 * max(spot.width, float(print_["width"])))
            cost = 0.5 * away / _PUSHED_M + 0.5 * difference
            if difference < 1.0 and cost < best_cost:
                best, best_cost = spot, cost
        if best is None:
            return False
        best.matched = True
        return True

    def beside(self, x: float, y: float, t: float) -> bool:
        """Whether something at (x, y) began where background was that has gone since."""
        return any(
            math.hypot(spot.x - x, spot.y - y) < 0.15 + 0.5 * spot.width and t - spot.t < _PUSHED_S
            for spot in self.spots
        )

    def save(self) -> list[list[float]]:
        """What to keep across a restart."""
        return [[s.t, s.x, s.y, s.width, float(s.matched)] for s in self.spots]

    def restore(self, rows: list[list[float]]) -> None:
        """Go on from what was kept."""
        self.spots = deque((Spot(t, x, y, w, bool(m)) for t, x, y, w, m in rows), maxlen=64)
