"""Polygons of the room: where labels are wanted, what is ignored, where people sit."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from tms_agents.floor.norm import norm
from tms_agents.floor.scan.segmentation import keep
from tms_agents.floor.settings import Polygon

Array = NDArray[np.float64]


@njit(cache=True)
def inside(polygon: Array, x: float, y: float) -> bool:
    """Whether (x, y) lies in the polygon (n, 2)."""
    n = polygon.shape[0]
    odd = False
    j = n - 1
    for i in range(n):
        if (polygon[i, 1] > y) != (polygon[j, 1] > y):
            share = (y - polygon[i, 1]) / (polygon[j, 1] - polygon[i, 1])
            if x < polygon[i, 0] + share * (polygon[j, 0] - polygon[i, 0]):
                odd = not odd
        j = i
    return odd


@njit(cache=True)
def distance(polygon: Array, x: float, y: float) -> float:
    """How far (x, y) is from the polygon (n, 2), m; 0 inside."""
    return 0.0 if inside(polygon, x, y) else border(polygon, x, y)


@njit(cache=True)
def border(polygon: Array, x: float, y: float) -> float:
    """How far (x, y) is from the outline of the polygon (n, 2), m."""
    edge_x, edge_y = edge(polygon, x, y)
    return float(norm(edge_x - x, edge_y - y))


@njit(cache=True)
def edge(polygon: Array, x: float, y: float) -> tuple[float, float]:
    """The place on the outline of the polygon (n, 2) that is nearest to (x, y), m."""
    n = polygon.shape[0]
    best, edge_x, edge_y = np.inf, np.inf, np.inf
    for i in range(n):
        j = (i + 1) % n
        near_x, near_y = on_segment(polygon[i, 0], polygon[i, 1], polygon[j, 0], polygon[j, 1], x, y)
        away = norm(near_x - x, near_y - y)
        if away < best:
            best, edge_x, edge_y = away, near_x, near_y
    return edge_x, edge_y


@njit(cache=True)
def on_segment(ax: float, ay: float, bx: float, by: float, x: float, y: float) -> tuple[float, float]:
    """The place on the segment from a to b that is nearest to (x, y), m."""
    dx, dy = bx - ax, by - ay
    share = min(1.0, max(0.0, ((x - ax) * dx + (y - ay) * dy) / max(dx * dx + dy * dy, 1e-12)))
    return ax + share * dx, ay + share * dy


@njit(cache=True)
def _among(corners: Array, sizes: NDArray[np.int64], x: float, y: float) -> bool:
    """Whether (x, y) is in one of the polygons of so many ``corners`` each."""
    start = 0
    for m in range(sizes.size):
        if inside(corners[start : start + sizes[m]], x, y):
            return True
        start += sizes[m]
    return False


@njit(cache=True)
def _wanted(
    clusters: Any,
    region: Array,
    margin: float,
    gates: Array,
    gate_sizes: NDArray[np.int64],
    masks: Array,
    mask_sizes: NDArray[np.int64],
) -> int:
    """Move the clusters (m,) that count to the front; how many there are."""
    kept = 0
    for k in range(clusters.size):
        c = clusters[k]
        outside = 0.0 if region.shape[0] == 0 else distance(region, c.x, c.y)
        good = outside <= margin or (outside <= 2.0 * margin and _among(gates, gate_sizes, c.x, c.y))
        good = good and not _among(masks, mask_sizes, c.x, c.y)
        if good:
            kept = keep(clusters, kept, k)
    return kept


class Area:
    """Several polygons as arrays for the kernels."""

    def __init__(self, polygons: Sequence[Polygon]) -> None:
        self.polygons = [np.asarray(polygon, dtype=float) for polygon in polygons]

    def distance(self, x: float, y: float) -> float:
        """How far (x, y) is from the nearest polygon, m; inf where there is none."""
        return min((float(distance(polygon, x, y)) for polygon in self.polygons), default=np.inf)

    def depth(self, x: float, y: float) -> float:
        """How far (x, y) is inside, from the outline of a polygon, m; 0 outside of all."""
        within = (polygon for polygon in self.polygons if inside(polygon, x, y))
        return max((float(border(polygon, x, y)) for polygon in within), default=0.0)

    def into(self, x: float, y: float, deep: float) -> tuple[float, float]:
        """Where one is who has gone from (x, y) straight across the nearest edge of a polygon, so deep (m) if it is.

        ``(x, y)`` itself in a polygon, and where there is none.
        """
        away = self.distance(x, y)
        if not np.inf > away > 0.0:
            return x, y
        polygon = min(self.polygons, key=lambda one: float(distance(one, x, y)))
        edge_x, edge_y = edge(polygon, x, y)
        there = float(edge_x + (edge_x - x) * deep / away), float(edge_y + (edge_y - y) * deep / away)
        return there if inside(polygon, *there) else (float(edge_x), float(edge_y))


class Masks:
    """Which clusters count."""

    #: What is a little outside (m) still counts: a foot on the threshold.
    MARGIN_M = 0.15

    def __init__(self, region: Polygon | None, masks: Sequence[Polygon], gates: Sequence[Polygon] = ()) -> None:
        self._region = np.zeros((0, 2)) if region is None else np.asarray(region, dtype=float)
        # Who comes in is met in the door.
        self._gates, self._masks = joined(gates), joined(masks)
        self._any = region is not None or bool(masks)

    def __call__(self, clusters: Any) -> Any:
        """The clusters (m,) in the region or a gate and in no mask; they are moved to the front of the array."""
        if not self._any:
            return clusters
        return clusters[: _wanted(clusters, self._region, self.MARGIN_M, *self._gates, *self._masks)]

    def outside(self, x: float, y: float) -> bool:
        """Whether (x, y) is not in the region: nothing lies there that concerns anybody."""
        return self._region.size > 0 and not inside(self._region, x, y)


def joined(polygons: Sequence[Polygon]) -> tuple[Array, NDArray[np.int64]]:
    """The corners (n, 2) of all ``polygons``, one after the other, and how many each has: what kernels take."""
    corners = [np.zeros((0, 2)), *(np.asarray(polygon, dtype=float) for polygon in polygons)]
    return np.concatenate(corners), np.array([len(polygon) for polygon in polygons], dtype=np.int64)
