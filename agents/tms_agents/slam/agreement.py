"""How many points of a scan end where a map says that something is, and how many where it says that nothing is."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from tms_agents.slam.geometry import Bytes, Floats, Ints
from tms_agents.slam.occupancy import EVEN, UNKNOWN
from tms_agents.slam.tiles import MASK, SHIFT


@njit(cache=True)
def agreement(
    occupancy_directory: Ints,
    occupancy: Bytes,
    distance_directory: Ints,
    squared: Bytes,
    metres: Floats,
    frame: Floats,
    points: Floats,
    pose: Floats,
    near_m: float,
) -> tuple[int, int]:
    """(points within ``near_m`` of a surface, points well inside of free space), of ``points`` (M, 2) seen from
    ``pose``.

    What ends where nothing is known is neither.
    """
    height, width = occupancy_directory.shape[0] << SHIFT, occupancy_directory.shape[1] << SHIFT
    cosine, sine = math.cos(pose[2]), math.sin(pose[2])
    near, free = 0, 0
    for m in range(len(points)):
        x = int(np.floor((pose[0] + cosine * points[m, 0] - sine * points[m, 1] - frame[0]) * frame[2]))
        y = int(np.floor((pose[1] + sine * points[m, 0] + cosine * points[m, 1] - frame[1]) * frame[2]))
        if not (0 <= x < width and 0 <= y < height):
            continue
        place = ((y & MASK) << SHIFT) | (x & MASK)
        if metres[squared[distance_directory[y >> SHIFT, x >> SHIFT], place]] < near_m:
            near += 1
            continue
        value = occupancy[occupancy_directory[y >> SHIFT, x >> SHIFT], place]
        free += value != UNKNOWN and value <= EVEN
    return near, free
