"""Where a laser stands, found from the walls of a room whose outline is known. Pure: numbers in, a pose out."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tms_agents.devices.scans import Array, Sweep
from tms_agents.floor.settings import Pose

#: A point that fits a wall is this near to it.
MATCHED_M = 0.03
#: Between the first look and the last, what counts as near a wall shrinks so.
_REACH_M = (0.6, 0.3, 0.15, 0.08, 0.05)
_TURNS_PER_REACH = 5
#: Starts around the pose that was measured by ruler.
_SHIFTS_M, _TURNS = (-0.35, 0.0, 0.35), (-0.35, -0.17, 0.0, 0.17, 0.35)


@dataclass(frozen=True, slots=True)
class Fit:
    """A pose with its standard deviations (m, m, rad), the residual of the points that fit, and their share."""

    pose: Pose
    sd: tuple[float, float, float]
    rmse_m: float
    matched: float
    points: int


def static_points(sweep: Sweep, ranges: Array) -> Array:
    """(n, 2) m in the sensor's frame of what stands still in scans (T, B): beams that mostly echo, at their median."""
    found = np.isfinite(ranges)
    steady = found.mean(axis=0) >= 0.5
    if not steady.any():
        return np.empty((0, 2))
    middle = np.nanmedian(np.where(found, ranges, np.nan)[:, steady], axis=0)
    angles = sweep.angles[steady]
    return np.stack([middle * np.cos(angles), middle * np.sin(angles)], axis=1)


def fit_walls(points: Array, outline: Sequence[tuple[float, float]], start: Pose) -> Fit:
    """The pose near ``start`` (half a metre, 30 degrees) at which most points (n, 2) lie on the outline (a polygon).

    Furniture before the walls does no harm as long as every direction has some wall left.

    Raises:
        ValueError: too few points, or they leave the pose undetermined (walls of one direction only).
    """
    if len(points) < 20:
        raise ValueError(f"only {len(points)} beams see something that stands still")
    walls = _Walls(outline)
    spaced = _spaced(points)
    fits = [
        _descend(spaced, walls, np.array([start[0] + dx, start[1] + dy, start[2] + turn]))
        for dx, dy, turn in itertools.product(_SHIFTS_M, _SHIFTS_M, _TURNS)
    ]
    best = max(fits, key=lambda pose: (*_fits(spaced, walls, pose), -float(np.hypot(*(pose - start)[:2]))))
    gap, jacobian = _residuals(points, walls, best)
    near = np.abs(gap) < MATCHED_M
    if near.sum() < 20:
        raise ValueError("what the laser sees does not fit the outline of the room anywhere near")
    rmse = float(np.sqrt(np.mean(gap[near] ** 2)))
    information = jacobian[near].T @ jacobian[near] / max(rmse, 0.003) ** 2
    if np.linalg.eigvalsh(information)[0] < 1e4:
        raise ValueError("it sees walls of one direction only, along which it may stand anywhere")
    sd = np.sqrt(np.diag(np.linalg.inv(information)))
    x, y, theta = best
    return Fit((float(x), float(y), wrapped(theta)), (sd[0], sd[1], sd[2]), rmse, float(near.mean()), len(points))


def wrapped(angle: float) -> float:
    """The same angle between -pi and pi."""
    return float(np.arctan2(np.sin(angle), np.cos(angle)))


class _Walls:
    """The sides of a polygon."""

    def __init__(self, outline: Sequence[tuple[float, float]]) -> None:
        self.start = np.array(outline, dtype=np.float64)
        along = np.roll(self.start, -1, axis=0) - self.start
        length = np.hypot(along[:, 0], along[:, 1])
        if len(outline) < 3 or (length < 1e-6).any():
            raise ValueError("the outline needs at least three corners, each somewhere else")
        self.length, self.along = length, along / length[:, None]
        self.normal = np.stack([-self.along[:, 1], self.along[:, 0]], axis=1)

    def nearest(self, points: Array) -> tuple[Array, Array]:
        """Signed distance (n,) to the nearest side, and that side's normal (n, 2)."""
        offset = points[:, None, :] - self.start[None]
        along = np.einsum("nsk,sk->ns", offset, self.along)
        across = np.einsum("nsk,sk->ns", offset, self.normal)
        beyond = along - np.clip(along, 0.0, self.length[None])
        side = np.argmin(np.hypot(across, beyond), axis=1)
        rows = np.arange(len(points))
        # Beyond a side's end a point is as far away as that end.
        gap = np.where(beyond[rows, side] == 0.0, across[rows, side], np.inf)
        return gap, self.normal[side]


def _residuals(points: Array, walls: _Walls, pose: NDArray[np.float64]) -> tuple[Array, Array]:
    """Distances (n,) to the walls at this pose, inf for what is at none, and their derivatives (n, 3) by the pose."""
    cos, sin = np.cos(pose[2]), np.sin(pose[2])
    turned = points @ np.array([[cos, sin], [-sin, cos]])
    gap, normal = walls.nearest(turned + pose[:2])
    by_angle = normal[:, 1] * turned[:, 0] - normal[:, 0] * turned[:, 1]
    return gap, np.column_stack([normal, by_angle])


def _descend(points: Array, walls: _Walls, pose: NDArray[np.float64]) -> NDArray[np.float64]:
    for reach in _REACH_M:
        for _ in range(_TURNS_PER_REACH):
            gap, jacobian = _residuals(points, walls, pose)
            near = np.abs(gap) < reach
            if near.sum() < 10:
                return pose
            weight = (1 - (gap[near] / reach) ** 2) ** 2  # Tukey's
            rows = jacobian[near] * weight[:, None]
            step = np.linalg.solve(rows.T @ jacobian[near] + 1e-6 * np.eye(3), -rows.T @ gap[near])
            pose = pose + step
            if np.abs(step).max() < 1e-6:
                break
    return pose


def _fits(points: Array, walls: _Walls, pose: NDArray[np.float64]) -> tuple[float, float]:
    """The share of points at a wall, in hundredths, and minus how far they are off, in whole millimetres."""
    gap = _residuals(points, walls, pose)[0]
    near = np.abs(gap) < MATCHED_M
    off = float(np.sqrt(np.mean(gap[near] ** 2))) if near.any() else MATCHED_M
    return round(float(near.mean()), 2), -round(off, 3)


def _spaced(points: Array, step_m: float = 0.03) -> Array:
    """Of points that crowd together one per ``step_m``, so that a near wall counts as its length."""
    _, first = np.unique(np.floor(points / step_m).astype(np.int64), axis=0, return_index=True)
    spaced: Array = points[np.sort(first)]
    return spaced
