"""Where odometry jumped (a wheel that slipped, a robot that was pushed): look on a coarse lattice of poses around it.

The distance field is smooth over its reach, so steps of a third of that find every basin (Olson 2009 on the same idea).
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from tms_agents.slam.geometry import Bytes, Floats, Ints
from tms_agents.slam.tiles import MASK, SHIFT


@njit(cache=True)
def search(
    directory: Ints,
    squared: Bytes,
    costs: Floats,
    frame: Floats,
    points: Floats,
    centre: Floats,
    window: Floats,
    steps: Floats,
    best: Floats,
) -> float:
    """Least mean cost per beam on the lattice ``centre`` +- ``window`` (m, rad) in ``steps`` (m, rad); ``best`` gets
    the pose.

    ``costs`` (256,) of each squared distance in cells; ``points`` (M, 2) seen from the robot.
    """
    height, width = directory.shape[0] << SHIFT, directory.shape[1] << SHIFT
    scale, count = frame[2], len(points)
    across, around = math.ceil(window[0] / steps[0]), math.ceil(window[1] / steps[1])
    turned = np.empty((count, 2))
    least = np.inf
    for r in range(-around, around + 1):
        theta = centre[2] + r * steps[1]
        cosine, sine = math.cos(theta), math.sin(theta)
        for m in range(count):
            turned[m, 0] = (centre[0] - frame[0] + cosine * points[m, 0] - sine * points[m, 1]) * scale
            turned[m, 1] = (centre[1] - frame[1] + sine * points[m, 0] + cosine * points[m, 1]) * scale
        for i in range(-across, across + 1):
            for j in range(-across, across + 1):
                dx, dy = i * steps[0] * scale, j * steps[0] * scale
                # Of two that fit alike, the one nearer to where it should be.
                cost = 1e-3 * count * (i * i + j * j + r * r) / (across * across + 1.0)
                for m in range(count):
                    x, y = int(turned[m, 0] + dx), int(turned[m, 1] + dy)
                    if 0 <= x < width and 0 <= y < height:
                        cost += costs[squared[directory[y >> SHIFT, x >> SHIFT], ((y & MASK) << SHIFT) | (x & MASK)]]
                    else:
                        cost += costs[255]
                    if cost >= least:
                        break
                if cost < least:
                    least = cost
                    best[0] = centre[0] + i * steps[0]
                    best[1] = centre[1] + j * steps[0]
                    best[2] = theta
    return least / max(1, count)
