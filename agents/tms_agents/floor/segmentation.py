"""From beams to clusters: what belongs together on one surface (adaptive breakpoints)."""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from tms_agents.floor.background import FOREGROUND

Array = NDArray[np.float64]

#: A cluster in the room frame: (x, y) m of the middle of the thing, (width m) across the beams, (n) beams, (near) its
#: range, (first, last) beam, (cut) partly hidden behind something nearer, (mirror) seen in a mirror (-1: directly).
CLUSTER = np.dtype(
    [
        ("x", "f8"),
        ("y", "f8"),
        ("width", "f8"),
        ("near", "f8"),
        ("spacing", "f8"),
        ("n", "i8"),
        ("first", "i8"),
        ("last", "i8"),
        ("cut", "i8"),
        ("mirror", "i8"),
    ]
)
#: The middle of a thing lies behind the surface seen by this share of its width (discs 0.39, boxes 0.3 to 0.5).
_DEPTH = 0.37


@njit(cache=True)
def _segment(
    ranges: Array,
    states: NDArray[np.int8],
    claimed: NDArray[np.bool_],
    rays: Array,
    step: Array,
    grazing: float,
    clusters: Any,
) -> int:
    """Join neighbouring foreground beams to ``clusters`` (max,); how many there are.

    rays: (n, 10), see `tms_agents.floor.rays`; step: (n,) rad
    to the next beam. Two points belong together if they are nearer than a surface at the angle ``grazing`` could be
    (Borges and Aldon, "Line extraction in 2D range images", 2004); one beam between may be missing.
    """
    n = ranges.size
    count = 0
    last = -10
    for i in range(n):
        if states[i] != FOREGROUND or claimed[i]:
            continue
        r = ranges[i]
        mirrored = r > rays[i, 8]
        joined = False
        if count > 0 and i - last <= 2 and (clusters[count - 1].mirror >= 0) == mirrored:
            before = ranges[last]
            angle = step[last] * (i - last)
            reach = min(r, before) * np.sin(angle) / np.sin(max(grazing - angle, 0.02)) + 0.012 + 0.004 * r
            gap = np.sqrt(r * r + before * before - 2.0 * r * before * np.cos(angle))
            joined = gap < reach
        if not joined:
            if count == clusters.size:
                break
            clusters[count].first = i
            clusters[count].n = 0
            clusters[count].x = 0.0
            clusters[count].y = 0.0
            clusters[count].near = 0.0
            clusters[count].mirror = int(rays[i, 9]) if mirrored else -1
            count += 1
        c = clusters[count - 1]
        o = 4 if mirrored else 0
        c.x += rays[i, o] + r * rays[i, o + 2]
        c.y += rays[i, o + 1] + r * rays[i, o + 3]
        c.near += r
        c.n += 1
        c.last = i
        last = i
    for k in range(count):
        c = clusters[k]
        c.x /= c.n
        c.y /= c.n
        c.near /= c.n
        a, b = c.first, c.last
        o = 4 if c.mirror >= 0 else 0
        ax = rays[a, o] + ranges[a] * rays[a, o + 2]
        ay = rays[a, o + 1] + ranges[a] * rays[a, o + 3]
        bx = rays[b, o] + ranges[b] * rays[b, o + 2]
        by = rays[b, o + 1] + ranges[b] * rays[b, o + 3]
        c.spacing = c.near * step[min(a, n - 1)]
        c.width = np.hypot(ax - bx, ay - by) + c.spacing
        c.cut = 0
        for side in (a - 1, a - 2, b + 1, b + 2):
            if 0 <= side < n and ranges[side] < c.near - 0.1 and not np.isnan(ranges[side]):
                c.cut = 1
        middle = (a + b) // 2
        shift = _DEPTH * min(c.width, 0.5)
        c.x += shift * rays[middle, o + 2]
        c.y += shift * rays[middle, o + 3]
    return count


class Segmenter:
    """Clusters of one sensor's scans; the array of clusters is reused."""

    def __init__(self, step: Array, grazing_rad: float, most: int = 128) -> None:
        self._step, self._grazing = step, grazing_rad
        self._clusters = np.zeros(most, CLUSTER)

    def __call__(self, ranges: Array, states: NDArray[np.int8], claimed: NDArray[np.bool_], rays: Array) -> Any:
        """The clusters of one scan (m,) of ``CLUSTER``: ranges, states, claimed (n,), rays (n, 10)."""
        count = _segment(ranges, states, claimed, rays, self._step, self._grazing, self._clusters)
        return self._clusters[:count]
