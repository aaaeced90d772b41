"""Scan matching one after the other, for comparison: ICP, and Intensity-ICP, the predecessor of the paper's filter.

Every key scan is laid onto the last few: each point to the nearest one, then the rigid motion of least squares, and so
on. Intensity-ICP takes light as a third coordinate when it looks for the nearest point. One pose is believed at a time
and no loop is ever closed.
"""

from __future__ import annotations

import math

import numpy as np
from scipy.spatial import cKDTree

from tms_agents.slam.geometry import Floats, between, compose, transform, wrapped

#: A scan is laid onto so many before it; pairs are nearer than this (m), in so many rounds at most.
_BEFORE, _REACH_M, _ROUNDS = 6, 0.3, 40
_SMALL = 1e-4


class Icp:
    """Feed it scans in order. ``alpha`` m^2 per squared light of a usual surface; 0 is plain ICP."""

    def __init__(self, alpha: float) -> None:
        self._weight = math.sqrt(alpha)
        self.poses: list[Floats] = []
        self._clouds: list[Floats] = []
        self._odometry: Floats | None = None

    def process(self, odometry: Floats, points: Floats, light: Floats) -> None:
        """One scan: ``odometry`` (3,), ``points`` (M, 2) with their ``light`` (M,), 1 for a usual surface."""
        pose = np.zeros(3)
        if self._odometry is not None:
            pose = compose(self.poses[-1], between(self._odometry, odometry))
            pose = self._matched(pose, points, self._weight * light)
        self._odometry = odometry
        self.poses.append(pose)
        self._clouds.append(np.column_stack([transform(pose, points), self._weight * light]))

    def _matched(self, pose: Floats, points: Floats, light: Floats) -> Floats:
        reference = np.concatenate(self._clouds[-_BEFORE:])
        if not len(points) or not len(reference):
            return pose
        tree = cKDTree(reference)
        for _ in range(_ROUNDS):
            placed = transform(pose, points)
            distances, nearest = tree.query(np.column_stack([placed, light]), distance_upper_bound=_REACH_M)
            paired = np.isfinite(distances)
            if paired.sum() < 3:
                return pose
            moved = _fitted(points[paired], reference[nearest[paired], :2])
            step = np.append(moved[:2] - pose[:2], wrapped(moved[2] - pose[2]))
            pose = moved
            if np.abs(step).max() < _SMALL:
                break
        return pose


def _fitted(points: Floats, targets: Floats) -> Floats:
    """The pose (3,) from which ``points`` (M, 2) are nearest to ``targets`` (M, 2), in the sense of least squares."""
    a, b = points.mean(axis=0), targets.mean(axis=0)
    p, q = points - a, targets - b
    turn = math.atan2(float((p[:, 0] * q[:, 1] - p[:, 1] * q[:, 0]).sum()), float((p * q).sum()))
    c, s = math.cos(turn), math.sin(turn)
    return np.array([b[0] - c * a[0] + s * a[1], b[1] - s * a[0] - c * a[1], turn])
