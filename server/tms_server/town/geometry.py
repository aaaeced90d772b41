"""Where a point is: in which polygon, nearest to what. Metres in the room frame."""

from __future__ import annotations

from collections.abc import Sequence

Point = tuple[float, float]
#: A point this close to an edge (metres) is on it, and so inside.
_ON_EDGE = 1e-9


def inside(point: Point, polygon: Sequence[Point]) -> bool:
    """Even-odd rule; the border belongs to the polygon."""
    x, y = point
    odd = False
    ax, ay = polygon[-1]
    for bx, by in polygon:
        if _on_edge(x, y, ax, ay, bx, by):
            return True
        if (ay > y) != (by > y) and x < ax + (y - ay) * (bx - ax) / (by - ay):
            odd = not odd
        ax, ay = bx, by
    return odd


def distance2(a: Point, b: Point) -> float:
    """Squared distance, m^2."""
    return (a[0] - b[0]) ** 2 + (a[1] - b[1]) ** 2


def _on_edge(x: float, y: float, ax: float, ay: float, bx: float, by: float) -> bool:
    if not (min(ax, bx) - _ON_EDGE <= x <= max(ax, bx) + _ON_EDGE):
        return False
    if not (min(ay, by) - _ON_EDGE <= y <= max(ay, by) + _ON_EDGE):
        return False
    cross = (bx - ax) * (y - ay) - (by - ay) * (x - ax)
    return bool(cross**2 <= _ON_EDGE**2 * ((bx - ax) ** 2 + (by - ay) ** 2))
