"""A room with an open door, and robots of known size that drive in it."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np
from floor_rooms import WALLS, Segment

from tms_agents.floor import Scene

LENGTH, WIDTH = 0.55, 0.42
GATE = [(4.9, 1.2), (5.6, 1.2), (5.6, 2.8), (4.9, 2.8)]
ROOM = [(0.0, 0.0), (5.0, 0.0), (5.0, 4.0), (0.0, 4.0)]
SCENE = Scene(region=ROOM, gates=[GATE], robots=[(WIDTH, LENGTH)])
#: A door is open in the wall on the right.
OPEN: tuple[Segment, ...] = (
    *(wall for wall in WALLS if wall != (5, 0, 5, 4)),
    (5.0, 0.0, 5.0, 1.2),
    (5.0, 2.8, 5.0, 4.0),
    (7.0, 0.0, 7.0, 4.0),
)
Way = Sequence[tuple[float, float, float]]


def robot(way: Way) -> Callable[[float], tuple[Segment, ...]]:
    """A rectangle that drives along ``way``, rows (t, x, y); nothing before it."""
    times, xs, ys = (np.array(column, dtype=float) for column in zip(*way, strict=True))

    def at(t: float) -> tuple[float, float]:
        return float(np.interp(t, times, xs)), float(np.interp(t, times, ys))

    def sides(t: float) -> tuple[Segment, ...]:
        if t < times[0]:
            return ()
        x, y = at(t)
        k = int(np.clip(np.searchsorted(times, t), 1, len(times) - 1))
        while k > 1 and math.hypot(xs[k] - xs[k - 1], ys[k] - ys[k - 1]) < 0.05:
            k -= 1
        yaw = math.atan2(ys[k] - ys[k - 1], xs[k] - xs[k - 1])
        c, s = math.cos(yaw), math.sin(yaw)
        a, b = LENGTH / 2, WIDTH / 2
        corners = [(x + c * u - s * v, y + s * u + c * v) for u, v in ((a, b), (-a, b), (-a, -b), (a, -b))]
        return tuple((*one, *two) for one, two in zip(corners, corners[1:] + corners[:1], strict=True))

    return sides
