"""Whether what lies in a wall is a piece of it: past both its ends the wall goes on, and in the same plane.

A closed door looks like the wall it fills, but it stands a little deeper: a centimetre is less than a cell and less
than the noise of a beam, yet a visit has dozens of beams on either side of the edge.
"""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from tms_agents.slam.geometry import Floats

#: A wall that stands out less than the first (m) goes on in the same plane, more than the second: in another one.
_FLUSH_M, _STEP_M = 0.004, 0.008
#: An edge that lies so far along the panel (cosine).
_ALONG = 0.7


@njit(cache=True)
def goes_on(
    pose: Floats,
    outline: Floats,
    normals: Floats,
    beyond: Floats,
    hinged: bool,
    towards: Floats,
    wall: NDArray[np.bool_],
    surface: Floats,
    corner: Floats,
    cell: float,
) -> float:
    """Share of points past the ends of an object at ``pose`` (3,) where the wall goes on that it would be a piece of.

    Of a ``hinged`` panel (along x) only those past the side that is seen count, and not those that stand out from its
    plane: the line through where beams ended on it."""
    c, s = np.cos(pose[2]), np.sin(pose[2])
    left, low = pose[0] - corner[0], pose[1] - corner[1]
    height, width = wall.shape
    count, side, sx, sy, sxx, sxy = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    if hinged:
        for m in range(outline.shape[0]):
            if abs(normals[m, 1]) < _ALONG:
                continue
            x = int((left + c * outline[m, 0] - s * outline[m, 1]) / cell)
            y = int((low + s * outline[m, 0] + c * outline[m, 1]) / cell)
            if not (0 <= x < width and 0 <= y < height) or np.isnan(surface[y, x, 0]):
                continue
            facing = normals[m, 1] * (c * towards[y, x, 1] - s * towards[y, x, 0])
            if facing <= 0.0:
                continue
            met = c * (surface[y, x, 1] - low) - s * (surface[y, x, 0] - left)
            count += 1.0
            side += np.sign(normals[m, 1])
            sx += outline[m, 0]
            sy += met
            sxx += outline[m, 0] ** 2
            sxy += outline[m, 0] * met
    spread = count * sxx - sx * sx
    known = count >= 4.0 and side != 0.0 and spread > 1e-9
    slope = (count * sxy - sx * sy) / spread if known else 0.0
    level = (sy - slope * sx) / count if known else 0.0
    of, found = 0.0, 0.0
    for m in range(beyond.shape[0]):
        if known and beyond[m, 1] * side <= 0.0:
            continue
        x = int((left + c * beyond[m, 0] - s * beyond[m, 1]) / cell)
        y = int((low + s * beyond[m, 0] + c * beyond[m, 1]) / cell)
        there = 0 <= x < width and 0 <= y < height and wall[y, x]
        if not (there and known):
            of, found = of + 1.0, found + there
        elif not np.isnan(surface[y, x, 0]):
            # Where nothing was met in this plane, a wall is near but not in it, or beams are few.
            met = c * (surface[y, x, 1] - low) - s * (surface[y, x, 0] - left)
            step = np.sign(side) * (met - level - slope * beyond[m, 0])
            of, found = of + 1.0, found + min(max((_STEP_M - step) / (_STEP_M - _FLUSH_M), 0.0), 1.0)
    return found / max(of, 1.0)
