"""How well a scan fits a known map at many poses: where its beams end, and whether walls were in their way.

The likelihood field of Thrun, Burgard, Fox 2005, section 6.4, with a kernel that strangers (people, moved things) pull
little. What it lacks is added: a beam that passes through a wall counts as one that misses. What ends where nobody
looked says little.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit, prange

from tms_agents.slam.geometry import Bytes, Floats
from tms_agents.slam.known import UNSEEN, KnownMap

#: Columns of the results: mean cost per beam, share of the beams that end near a surface, in known free space or
#: behind a wall, and where nobody looked.
MEAN, NEAR, WRONG, UNKNOWN = 0, 1, 2, 3
#: A wall that is nearer to the end of a beam than this is not passed (m).
_BEFORE_END_M = 0.4
#: What ends where nobody looked costs this share of what a miss costs.
_UNSEEN_SHARE = 0.6


class Fit:
    """Costs of scans in ``known``: log(1 + (distance / ``sigma_m``)^2) per beam, 0 at surfaces."""

    def __init__(self, known: KnownMap, sigma_m: float) -> None:
        self._known = known
        self._costs = np.log(1.0 + np.square(known.metres / sigma_m))
        self._costs[UNSEEN:] = _UNSEEN_SHARE * self._costs[UNSEEN - 1]
        #: Within this squared distance (cells) a beam ends near a surface.
        self._near = int((2.0 * sigma_m * known.frame[2]) ** 2)
        #: So many cells around a cell of each code are no surface for sure.
        self._strides = np.maximum(1.0, np.floor(np.sqrt(np.arange(256.0))) - 1.0)
        self._strides[UNSEEN:] = 1.0

    def __call__(self, poses: Floats, points: Floats, laser: Floats, *, through: bool = True) -> Floats:
        """(N, 4) of ``points`` (M, 2) that a laser at ``laser`` (2,) saw, both seen from each of ``poses`` (N, 3).

        ``through``: look for walls on the way, too (several times as much work).
        """
        results = np.zeros((len(poses), 4))
        known = self._known
        if len(points):
            _fit(
                known.codes, known.frame, self._costs, self._strides, self._near, points, laser, poses, through, results
            )
        return results


@njit(cache=True, parallel=True)
def _fit(
    codes: Bytes,
    frame: Floats,
    costs: Floats,
    strides: Floats,
    near: int,
    points: Floats,
    laser: Floats,
    poses: Floats,
    through: bool,
    results: Floats,
) -> None:
    height, width = codes.shape
    scale, count = frame[2], len(points)
    miss = costs[UNSEEN - 1]
    margin = _BEFORE_END_M * scale
    for n in prange(len(poses)):
        cosine, sine = math.cos(poses[n, 2]), math.sin(poses[n, 2])
        x0, y0 = (poses[n, 0] - frame[0]) * scale, (poses[n, 1] - frame[1]) * scale
        lx = x0 + (cosine * laser[0] - sine * laser[1]) * scale
        ly = y0 + (sine * laser[0] + cosine * laser[1]) * scale
        cost, at_surface, wrong, unknown = 0.0, 0, 0, 0
        for m in range(count):
            x = x0 + (cosine * points[m, 0] - sine * points[m, 1]) * scale
            y = y0 + (sine * points[m, 0] + cosine * points[m, 1]) * scale
            code = int(codes[int(y), int(x)]) if 0.0 <= x < width and 0.0 <= y < height else 255
            if through and _passes(codes, strides, lx, ly, x, y, margin):
                cost += miss
                wrong += 1
                continue
            cost += costs[code]
            if code >= UNSEEN:
                unknown += 1
            elif code <= near:
                at_surface += 1
            else:
                wrong += 1
        results[n, MEAN] = cost / count
        results[n, NEAR], results[n, WRONG], results[n, UNKNOWN] = at_surface / count, wrong / count, unknown / count


@njit(cache=True)
def _passes(codes: Bytes, strides: Floats, x0: float, y0: float, x1: float, y1: float, margin: float) -> bool:
    """Is there a surface between two places (cells), ``margin`` cells before the end or earlier?"""
    height, width = codes.shape
    dx, dy = x1 - x0, y1 - y0
    length = math.sqrt(dx * dx + dy * dy)
    if length <= margin:
        return False
    dx, dy = dx / length, dy / length
    way = 0.0
    while way < length - margin:
        x, y = x0 + way * dx, y0 + way * dy
        if not (0.0 <= x < width and 0.0 <= y < height):
            way += 1.0
            continue
        code = codes[int(y), int(x)]
        if code == 0:
            return True
        way += strides[code]
    return False
