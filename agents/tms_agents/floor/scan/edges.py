"""Where somebody could go out of sight of a laser: behind what is nearer, where its reach ends, or its sweep."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from tms_agents.floor.norm import norm
from tms_agents.floor.scan.masks import on_segment

Array = NDArray[np.float64]

#: What is seen ends so much (m) farther off than beside it: somebody can go behind what is nearer.
_STEP_M = 0.5
#: Where nothing echoes feet are hardly seen so far (m) before the end of the reach.
_FAINT_M = 0.3
#: Edges are drawn in straight pieces so long (m); what another laser sees so far (m) beyond is none.
_PIECE_M, _BEYOND_M = 0.5, 0.3


def edges_of_sight(ranges: Array, reach: float, angles: Array, pose: Array) -> Array:
    """The segments (k, 4), x, y, x, y m, beyond which nothing is seen of the empty room.

    ``ranges`` (n,) m: how far each beam looks then (inf: nothing echoes); ``reach`` m; ``angles`` (n,) rad of the beams
    from the heading of ``pose`` (3,).
    """
    nothing = ranges >= reach
    far = np.where(nothing, reach - _FAINT_M, ranges)
    turned = angles + pose[2]
    xy = pose[:2] + far[:, None] * np.stack([np.cos(turned), np.sin(turned)], axis=1)
    steps = np.flatnonzero(np.abs(np.diff(far)) > _STEP_M)
    ways = [(xy[i], xy[i + 1]) for i in steps]
    if abs(angles[-1] - angles[0]) < 2.0 * np.pi - 0.1:
        ways += [(pose[:2], xy[0]), (pose[:2], xy[-1])]
    return np.vstack([_chain(xy, nothing), *(_pieces(a, b) for a, b in ways)])


def looks_past(edges: Array, ranges: Array, reach: float, angles: Array, pose: Array) -> NDArray[np.bool_]:
    """Which of another laser's ``edges`` (k, 4) are none, since this one looks past them (k,); the rest as above."""
    middle = 0.5 * (edges[:, :2] + edges[:, 2:]) - pose[:2]
    order = np.argsort(angles)
    off = np.arctan2(middle[:, 1], middle[:, 0]) - pose[2] - angles[order].mean()
    bearing = angles[order].mean() + off - 2.0 * np.pi * np.round(off / (2.0 * np.pi))
    far = np.interp(bearing, angles[order], np.minimum(ranges, reach - _FAINT_M)[order], left=0.0, right=0.0)
    return np.asarray(far > np.hypot(*middle.T) + _BEYOND_M)


def beams(ranges: Array, reach: float, angles: Array, pose: Array) -> Array:
    """The segments (n, 4), x, y, x, y m, on which the laser sees feet in the empty room; all as above."""
    far, turned = np.minimum(ranges, reach - _FAINT_M), angles + pose[2]
    ends = pose[:2] + far[:, None] * np.stack([np.cos(turned), np.sin(turned)], axis=1)
    return np.hstack([np.broadcast_to(pose[:2], ends.shape), ends])


def _pieces(a: Array, b: Array) -> Array:
    """The way from a to b (2,) in pieces (k, 4)."""
    count = max(1, round(norm(*(b - a)) / _PIECE_M))
    ends = a + np.linspace(0.0, 1.0, count + 1)[:, None] * (b - a)
    return np.hstack([ends[:-1], ends[1:]])


def _chain(xy: Array, wanted: NDArray[np.bool_]) -> Array:
    """Segments (k, 4) from one of the points (n, 2) to another, as long as all between are ``wanted`` (n,)."""
    segments, start = [], 0
    for i in range(1, len(xy) + 1):
        goes_on = i < len(xy) and bool(wanted[start] and wanted[i])
        if not goes_on or norm(*(xy[i] - xy[start])) > _PIECE_M:
            if wanted[start]:
                segments.append(np.hstack([xy[start], xy[i if goes_on else i - 1]]))
            start = i
    return np.array(segments).reshape(-1, 4)


@njit(cache=True)
def from_edge(edges: Array, x: float, y: float) -> float:
    """How far (x, y) is from the nearest of the ``edges`` (k, 4), m; inf where there are none."""
    best = np.inf
    for i in range(edges.shape[0]):
        near_x, near_y = on_segment(edges[i, 0], edges[i, 1], edges[i, 2], edges[i, 3], x, y)
        best = min(best, norm(near_x - x, near_y - y))
    return float(best)
