"""A polygon of the registry must enclose something."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from tms_schemas.problem import ProblemItem
from tms_server.errors import Invalid

#: Square metres; a square of a tenth of a millimetre.
_LEAST_AREA = 1e-8
Ring = Sequence[tuple[float, float]]


def area(polygon: Ring) -> float:
    """Enclosed area in square metres, positive whichever way round the corners (x, y in metres) go."""
    x0, y0 = polygon[0]  # relative to a corner: keeps the digits of a small polygon far from the origin
    corners = [(x - x0, y - y0) for x, y in polygon]
    following = [*corners[1:], corners[0]]
    return abs(sum(ax * by - bx * ay for (ax, ay), (bx, by) in zip(corners, following, strict=True))) / 2


def require_area(polygons: Iterable[tuple[str, Ring]]) -> None:
    """Raises ``Invalid`` naming every polygon (by its place in the request) that encloses nothing."""
    items = [
        ProblemItem(where=where, why="the polygon encloses no area")
        for where, polygon in polygons
        if area(polygon) < _LEAST_AREA
    ]
    if items:
        raise Invalid(f"{items[0].where}: {items[0].why}", items=items)
