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
    towards: Floats,
    wall: NDArray[np.bool_],
    surface: Floats,
    corner: Floats,
    cell: float,
) -> float:
    """Share of points ``beyond`` (E, 2, P, 2) the ends of a panel (along x) at ``pose`` (3,) where the wall goes on of
    which it would be a piece.

    Only those past the side that is seen count, and not those that stand out from its plane: the line through where
    beams ended on it."""
    c, s = np.cos(pose[2]), np.sin(pose[2])
    left, low = pose[0] - corner[0], pose[1] - corner[1]
    height, width = wall.shape
    side, level, slope = _met(pose, outline, normals, towards, surface, corner, cell)
    known = side != 0.0
    of, found = 0.0, 0.0
    past = beyond.reshape(-1, 2)
    for m in range(past.shape[0]):
        if known and past[m, 1] * side <= 0.0:
            continue
        aside = level + slope * past[m, 0] if known else past[m, 1]
        x = int((left + c * past[m, 0] - s * aside) / cell)
        y = int((low + s * past[m, 0] + c * aside) / cell)
        there = 0 <= x < width and 0 <= y < height and wall[y, x]
        if not (there and known):
            of, found = of + 1.0, found + there
            continue
        # Where nothing was met in this plane, a wall is near but not in it, or beams are few.
        off_x, off_y = surface[y, x, 0] - left, surface[y, x, 1] - low
        step = np.sign(side) * (c * off_y - s * off_x - aside)
        if np.hypot(step, c * off_x + s * off_y - past[m, 0]) <= 1.5 * cell:
            of, found = of + 1.0, found + min(max((_STEP_M - step) / (_STEP_M - _FLUSH_M), 0.0), 1.0)
    return found / max(of, 1.0)


@njit(cache=True)
def flanked(pose: Floats, ends: Floats, wall: NDArray[np.bool_], corner: Floats, cell: float) -> float:
    """How far the wall goes on past both ``ends`` (2, P, 2) of a side of an object at ``pose`` (3,): 0 to 1. What is
    near a wall has one past one end of the sides that stand on it."""
    c, s = np.cos(pose[2]), np.sin(pose[2])
    least = 1.0
    for end in range(2):
        share = 0.0
        for m in range(ends.shape[1]):
            x = int((pose[0] - corner[0] + c * ends[end, m, 0] - s * ends[end, m, 1]) / cell)
            y = int((pose[1] - corner[1] + s * ends[end, m, 0] + c * ends[end, m, 1]) / cell)
            if 0 <= x < wall.shape[1] and 0 <= y < wall.shape[0] and wall[y, x]:
                share += 1.0 / ends.shape[1]
        least = min(least, share)
    return least


@njit(cache=True)
def _met(
    pose: Floats, outline: Floats, normals: Floats, towards: Floats, surface: Floats, corner: Floats, cell: float
) -> tuple[float, float, float]:
    """The line through where beams ended on the side of a panel at ``pose`` (3,) that is seen: which side (0: too few
    did), where it begins (m), its slope. Of medians (Theil and Sen), for at a corner they meet something else."""
    c, s = np.cos(pose[2]), np.sin(pose[2])
    left, low = pose[0] - corner[0], pose[1] - corner[1]
    height, width = surface.shape[:2]
    along, met = np.empty(len(outline)), np.empty(len(outline))
    count, side = 0, 0.0
    for m in range(outline.shape[0]):
        if abs(normals[m, 1]) < _ALONG:
            continue
        x = int((left + c * outline[m, 0] - s * outline[m, 1]) / cell)
        y = int((low + s * outline[m, 0] + c * outline[m, 1]) / cell)
        if not (0 <= x < width and 0 <= y < height) or np.isnan(surface[y, x, 0]):
            continue
        if normals[m, 1] * (c * towards[y, x, 1] - s * towards[y, x, 0]) <= 0.0:
            continue
        along[count] = outline[m, 0]
        met[count] = c * (surface[y, x, 1] - low) - s * (surface[y, x, 0] - left)
        count += 1
        side += np.sign(normals[m, 1])
    if count < 4 or side == 0.0:
        return 0.0, 0.0, 0.0
    order = np.argsort(along[:count], kind="mergesort")
    far, near = order[count - count // 2 :], order[: count // 2]
    slope = float(np.median((met[far] - met[near]) / (along[far] - along[near] + 1e-9)))
    return side, float(np.median(met[:count] - slope * along[:count])), slope
