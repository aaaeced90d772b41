"""Whether a polygon that a person wrote down is one."""

from __future__ import annotations

import itertools
from collections.abc import Sequence

Xy = tuple[float, float]
#: Less (m²) is no area.
_LEAST_M2 = 1e-4


def fault_of(polygon: Sequence[Xy]) -> str:
    """What is wrong with it; empty where it has an inside. Corners may repeat, and sides may touch."""
    sides = list(zip(polygon, [*polygon[1:], polygon[0]], strict=True))
    for (n, one), (m, other) in itertools.combinations(enumerate(sides), 2):
        if _cross(one, other):
            return f"its sides {n + 1} and {m + 1} cross: give the corners in the order of a walk around it"
    area = abs(sum(a[0] * b[1] - a[1] * b[0] for a, b in sides)) / 2
    return "a polygon without an area" if area < _LEAST_M2 else ""


def _cross(one: tuple[Xy, Xy], other: tuple[Xy, Xy]) -> bool:
    """Each has an end on both sides of the other."""
    return _left(one, other[0]) * _left(one, other[1]) < 0 and _left(other, one[0]) * _left(other, one[1]) < 0


def _left(side: tuple[Xy, Xy], point: Xy) -> float:
    (ax, ay), (bx, by) = side
    return (bx - ax) * (point[1] - ay) - (by - ay) * (point[0] - ax)
