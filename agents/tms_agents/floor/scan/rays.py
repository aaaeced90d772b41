"""The beams of a sensor in the room, directly and by way of mirrors: a mirror is a second sensor behind the glass."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from tms_agents.floor.settings import Point, Pose, Sensor

Array = NDArray[np.float64]


def rays(sensor: Sensor, pose: Pose, mirrors: Sequence[tuple[Point, Point]]) -> Array:
    """Each beam as a row of (n, 10): origin, direction, origin and direction behind the mirror, its range, its index.

    A point at range r is at origin + r * direction; past the mirror (r beyond its range, inf where there is none) it
    is at the second origin + r * second direction, which unfolds the reflection.
    """
    x, y, heading = pose
    angles = np.asarray(sensor.sweep.angles, dtype=float) + heading
    out = np.zeros((angles.size, 10))
    out[:, 0], out[:, 1] = x, y
    out[:, 2], out[:, 3] = np.cos(angles), np.sin(angles)
    out[:, 4:8] = out[:, 0:4]
    out[:, 8], out[:, 9] = np.inf, -1
    for index, (a, b) in enumerate(mirrors):
        reach = _reach(out, np.asarray(a), np.asarray(b))
        hit = reach < out[:, 8]
        matrix, offset = reflection((a, b))
        out[hit, 4:6] = (matrix @ np.array([x, y])) + offset
        out[hit, 6:8] = out[hit, 2:4] @ matrix.T
        # The glass itself and what stands right before it is seen directly.
        out[hit, 8], out[hit, 9] = reach[hit] + 0.03, index
    return out


def views(mirrors: Sequence[tuple[Point, Point]]) -> Array:
    """The ways in which a sensor sees a point: rows (m, 6) of the reflection (matrix, offset) to apply to it first."""
    direct = np.array([1.0, 0.0, 0.0, 1.0, 0.0, 0.0])
    rows = [direct]
    for mirror in mirrors:
        matrix, offset = reflection(mirror)
        rows.append(np.concatenate([matrix.ravel(), offset]))
    return np.array(rows)


def reflection(mirror: tuple[Point, Point]) -> tuple[Array, Array]:
    """Matrix (2, 2) and offset (2,) m that reflect a point at the line through ``mirror``."""
    (ax, ay), (bx, by) = mirror
    length = math.hypot(bx - ax, by - ay)
    normal = np.array([ay - by, bx - ax]) / length
    matrix = np.eye(2) - 2.0 * np.outer(normal, normal)
    return matrix, 2.0 * float(normal @ np.array([ax, ay])) * normal


def _reach(beams: Array, a: Array, b: Array) -> Array:
    """Range (n,) at which each beam meets the segment from a to b, inf where it does not."""
    along = b - a
    dx, dy = beams[:, 2], beams[:, 3]
    with np.errstate(divide="ignore", invalid="ignore"):
        cross = dx * along[1] - dy * along[0]
        wx, wy = a[0] - beams[:, 0], a[1] - beams[:, 1]
        reach = (wx * along[1] - wy * along[0]) / cross
        share = (wx * dy - wy * dx) / cross
        meets = (reach > 0.0) & (share >= 0.0) & (share <= 1.0)
    return np.where(meets, reach, np.inf)
