"""Scans as short lines, and how one scan fits another: point to line with a robust kernel (Censi 2008)."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from tms_agents.slam.geometry import Floats
from tms_agents.slam.logs import Log

#: A line is laid through the beams on either side as far as they belong to one surface (m), at least so many in all.
_SIDE, _LEAST = 3, 4
_GAP_M, _FLAT_M = 0.25, 0.02
#: Beams are at least so noisy (m).
_NOISE_M = 0.01
#: What is known of a direction is so many times what errors of lines alone would seem to tell.
_REAL = 2.0
#: The nearest line is looked for among so many beams on either side.
_WINDOW, _ITERATIONS = 14, 12


@dataclass(frozen=True, slots=True, eq=False)
class Lines:
    """Of one scan: ``points`` (B, 2) m seen from the robot (NaN: no return), unit ``normals`` (B, 2) there (0: no
    line), whose directions have variances ``turns`` (B,) rad^2."""

    points: Floats
    normals: Floats
    turns: Floats
    laser: Floats
    first: float
    step: float

    def without(self, beams: NDArray[np.bool_]) -> Lines:
        """As if ``beams`` (B,) had not returned."""
        points = np.where(beams[:, None], np.nan, self.points)
        normals = np.where(beams[:, None], 0.0, self.normals)
        return Lines(points, normals, self.turns, self.laser, self.first, self.step)


def lines_of(log: Log, n: int) -> Lines:
    """Of scan ``n``, whose beams are evenly spread."""
    angles = log.angles + log.laser[2]
    r = np.where(log.returned(n), log.ranges[n], np.nan)
    points = np.stack([log.laser[0] + r * np.cos(angles), log.laser[1] + r * np.sin(angles)], axis=-1)
    normals = np.zeros_like(points)
    turns = np.zeros(len(points))
    _fit(points, normals, turns)
    return Lines(points, normals, turns, log.laser, float(angles[0]), float(angles[1] - angles[0]))


def match_lines(fixed: Lines, moving: Lines, start: Floats, reach: float, sigma: float) -> tuple[Floats, Floats, float]:
    """Pose (3,) of ``moving`` seen from ``fixed``, its information (3, 3), and the share of those points that ought to
    be near a line that are nearer than ``reach`` m.

    Nothing is known of a direction in which one scan slides along the other, as in a bare corridor (Zhang, Kaess and
    Singh 2016): there a match stays where it began."""
    pose, hessian, imagined = start.copy(), np.zeros((3, 3)), np.zeros((3, 3))
    share = _match(
        fixed.points, fixed.normals, fixed.turns, fixed.laser, fixed.first, fixed.step, moving.points, reach, sigma,
        pose, hessian, imagined,
    )  # fmt: skip
    return pose, _known(hessian, imagined), share


def without(hessian: Floats, direction: Floats) -> Floats:
    """(3, 3) without what it says of ``direction`` (3,)."""
    told = hessian @ direction
    left: Floats = hessian - np.outer(told, told) / (direction @ told)
    return left


def _known(hessian: Floats, imagined: Floats) -> Floats:
    """``hessian`` (3, 3) less what the errors of the lines' directions make up: a wall whose lines are laid through
    noise seems to have edges. Where there is hardly more than that, there is nothing."""
    _, vectors = np.linalg.eigh(hessian[:2, :2])
    slide = np.array([*vectors[:, 0], 0.0])
    if slide @ hessian @ slide > _REAL * (slide @ imagined @ slide):
        values, vectors = np.linalg.eigh(hessian - imagined)
        left: Floats = (vectors * np.maximum(values, 0.0)) @ vectors.T
        return left
    return without(hessian, slide) if slide @ hessian @ slide > 0.0 else hessian


@njit(cache=True)
def _fit(points: Floats, normals: Floats, turns: Floats) -> None:
    count = points.shape[0]
    for b in range(count):
        if math.isnan(points[b, 0]):
            continue
        n, sx, sy, sxx, sxy, syy = 1, 0.0, 0.0, 0.0, 0.0, 0.0
        for direction in (-1, 1):
            last = b
            for k in range(1, _SIDE + 1):
                i = b + direction * k
                if i < 0 or i >= count or math.isnan(points[i, 0]):
                    break
                if math.hypot(points[i, 0] - points[last, 0], points[i, 1] - points[last, 1]) > _GAP_M:
                    break
                x, y = points[i, 0] - points[b, 0], points[i, 1] - points[b, 1]
                n, sx, sy, sxx, sxy, syy = n + 1, sx + x, sy + y, sxx + x * x, sxy + x * y, syy + y * y
                last = i
        if n < _LEAST:
            continue
        mx, my = sx / n, sy / n
        a, h, d = sxx / n - mx * mx, sxy / n - mx * my, syy / n - my * my
        root = math.sqrt(0.25 * (a - d) ** 2 + h * h)
        small = max(0.5 * (a + d) - root, 0.0)
        if math.sqrt(small) > _FLAT_M or root == 0.0:
            continue
        angle = 0.5 * math.atan2(2.0 * h, a - d)
        normals[b, 0], normals[b, 1] = -math.sin(angle), math.cos(angle)
        turns[b] = (small + _NOISE_M**2) / (n * (a + d - small))


@njit(cache=True)
def _match(
    points: Floats,
    normals: Floats,
    turns: Floats,
    laser: Floats,
    first: float,
    step: float,
    moving: Floats,
    reach: float,
    sigma: float,
    pose: Floats,
    hessian: Floats,
    imagined: Floats,
) -> float:
    count = points.shape[0]
    gradient = np.zeros(3)
    share = 0.0
    for _ in range(_ITERATIONS):
        hessian[:] = 0.0
        imagined[:] = 0.0
        gradient[:] = 0.0
        near, expected = 0, 0
        c, s = math.cos(pose[2]), math.sin(pose[2])
        for m in range(moving.shape[0]):
            if math.isnan(moving[m, 0]):
                continue
            rx, ry = c * moving[m, 0] - s * moving[m, 1], s * moving[m, 0] + c * moving[m, 1]
            x, y = pose[0] + rx, pose[1] + ry
            beam = round((math.atan2(y - laser[1], x - laser[0]) - first) / step)
            if beam < -_WINDOW or beam >= count + _WINDOW:
                continue
            best, found = reach * reach, -1
            hidden = True
            for i in range(max(beam - _WINDOW, 0), min(beam + _WINDOW + 1, count)):
                if math.isnan(points[i, 0]):
                    continue
                apart = (points[i, 0] - x) ** 2 + (points[i, 1] - y) ** 2
                if apart < best:
                    best, found = apart, i
            if 0 <= beam < count and not math.isnan(points[beam, 0]):
                # What lies behind the other scan's surface was hidden from it.
                hidden = math.hypot(x - laser[0], y - laser[1]) > reach + math.hypot(
                    points[beam, 0] - laser[0], points[beam, 1] - laser[1]
                )
            if found >= 0 or not hidden:
                expected += 1
            if found < 0 or (normals[found, 0] == 0.0 and normals[found, 1] == 0.0):
                continue
            near += 1
            nx, ny = normals[found, 0], normals[found, 1]
            error = nx * (x - points[found, 0]) + ny * (y - points[found, 1])
            turn = ny * rx - nx * ry
            weight = 1.0 / (sigma * sigma * (1.0 + (error / sigma) ** 2))
            gradient[0] += weight * error * nx
            gradient[1] += weight * error * ny
            gradient[2] += weight * error * turn
            hessian[0, 0] += weight * nx * nx
            hessian[0, 1] += weight * nx * ny
            hessian[0, 2] += weight * nx * turn
            hessian[1, 1] += weight * ny * ny
            hessian[1, 2] += weight * ny * turn
            hessian[2, 2] += weight * turn * turn
            # What the line's error of direction adds of nothing.
            along = nx * rx + ny * ry
            weight *= turns[found]
            imagined[0, 0] += weight * ny * ny
            imagined[0, 1] -= weight * nx * ny
            imagined[0, 2] += weight * ny * along
            imagined[1, 1] += weight * nx * nx
            imagined[1, 2] -= weight * nx * along
            imagined[2, 2] += weight * along * along
        for each in (hessian, imagined):
            each[1, 0], each[2, 0], each[2, 1] = each[0, 1], each[0, 2], each[1, 2]
        share = near / max(expected, 1)
        if near < 10:
            return 0.0
        # Along a corridor nothing pulls; odometry, or another scan, knows better.
        move = np.linalg.solve(hessian + 1e-3 * np.trace(hessian) / 3.0 * np.eye(3), -gradient)
        pose += move
        if math.hypot(move[0], move[1]) < 5e-4 and abs(move[2]) < 5e-5:
            break
    return share
