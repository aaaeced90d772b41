"""Planar poses (x m, y m, theta rad) as rows of arrays: put together, seen from each other."""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]
Bytes = NDArray[np.uint8]


def wrapped(angle: Any) -> Any:
    """Angles into [-pi, pi)."""
    return (np.asarray(angle) + np.pi) % (2 * np.pi) - np.pi


def compose(poses: Floats, motions: Floats) -> Floats:
    """``motions`` (..., 3), seen from ``poses`` (..., 3), as poses in the frame of ``poses``."""
    cosine, sine = np.cos(poses[..., 2]), np.sin(poses[..., 2])
    x = poses[..., 0] + cosine * motions[..., 0] - sine * motions[..., 1]
    y = poses[..., 1] + sine * motions[..., 0] + cosine * motions[..., 1]
    return _rows(x, y, wrapped(poses[..., 2] + motions[..., 2]))


def between(poses: Floats, others: Floats) -> Floats:
    """``others`` (..., 3) seen from ``poses`` (..., 3)."""
    cosine, sine = np.cos(poses[..., 2]), np.sin(poses[..., 2])
    dx, dy = others[..., 0] - poses[..., 0], others[..., 1] - poses[..., 1]
    turn = wrapped(others[..., 2] - poses[..., 2])
    return _rows(cosine * dx + sine * dy, cosine * dy - sine * dx, turn)


def _rows(x: Floats, y: Floats, turn: Floats) -> Floats:
    """(..., 3); several times as fast as `numpy.stack` of a few."""
    found = np.empty((*np.shape(x), 3))
    found[..., 0], found[..., 1], found[..., 2] = x, y, turn
    return found


def inverse(poses: Floats) -> Floats:
    """The origin seen from ``poses`` (..., 3)."""
    return between(poses, np.zeros_like(poses))


def transform(pose: Floats, points: Floats) -> Floats:
    """``points`` (M, 2) m, seen from ``pose`` (3,), in the frame of ``pose``."""
    cosine, sine = np.cos(pose[2]), np.sin(pose[2])
    x, y = points[:, 0], points[:, 1]
    return np.stack([pose[0] + cosine * x - sine * y, pose[1] + sine * x + cosine * y], axis=-1)


@njit(cache=True)
def wrap(angle: float) -> float:
    """One angle into [-pi, pi)."""
    turned: float = (angle + np.pi) % (2.0 * np.pi) - np.pi
    return turned
