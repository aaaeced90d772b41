"""Which way a surface runs where a beam met it, and how obliquely: lines through the neighbours of a point."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from tms_agents.slam.geometry import Floats

#: Neighbours within so many m, or this share of the range, on either side; two that follow each other are on different
#: surfaces if they are so far apart (the same way).
_REACH_M, _REACH_SHARE, _APART_M, _APART_SHARE = 0.12, 0.07, 0.12, 0.06
#: A line needs so many points, and may be so thick in comparison with its length.
_LEAST, _THICK = 5, 0.35


@njit(cache=True)
def surfaces(points: Floats, laser: Floats) -> tuple[Floats, Floats]:
    """(tangents (M, 2), incidence (M,) rad) of ``points`` (M, 2) in the order of their beams from ``laser`` (2,).

    Incidence is 0 where the beam meets the surface squarely. Both are NaN where neighbours make no line.
    """
    count = len(points)
    tangents, incidence = np.full((count, 2), np.nan), np.full(count, np.nan)
    for m in range(count):
        bx, by = points[m, 0] - laser[0], points[m, 1] - laser[1]
        r = math.hypot(bx, by)
        reach, apart = max(_REACH_M, _REACH_SHARE * r), max(_APART_M, _APART_SHARE * r)
        first, last = m, m
        while first > 0 and _near(points, first - 1, first, apart) and _near(points, first - 1, m, reach):
            first -= 1
        while last < count - 1 and _near(points, last + 1, last, apart) and _near(points, last + 1, m, reach):
            last += 1
        n = last - first + 1
        if n < _LEAST or first == m or last == m:
            continue
        mx, my = points[first : last + 1, 0].mean(), points[first : last + 1, 1].mean()
        xx, xy, yy = 0.0, 0.0, 0.0
        for k in range(first, last + 1):
            dx, dy = points[k, 0] - mx, points[k, 1] - my
            xx += dx * dx
            xy += dx * dy
            yy += dy * dy
        middle, radius = 0.5 * (xx + yy), math.hypot(0.5 * (xx - yy), xy)
        if middle - radius > _THICK * _THICK * (middle + radius):
            continue
        angle = 0.5 * math.atan2(2.0 * xy, xx - yy)
        tx, ty = math.cos(angle), math.sin(angle)
        tangents[m, 0], tangents[m, 1] = tx, ty
        incidence[m] = math.asin(min(1.0, abs(tx * bx + ty * by) / max(r, 1e-9)))
    return tangents, incidence


@njit(cache=True, inline="always")
def _near(points: Floats, a: int, b: int, apart: float) -> bool:
    return math.hypot(points[a, 0] - points[b, 0], points[a, 1] - points[b, 1]) < apart
