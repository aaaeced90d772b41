"""How well a trajectory agrees with known relations between poses (Kuemmerle et al. 2009), or with another
trajectory."""

from __future__ import annotations

import gzip
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from tms_agents.slam.geometry import Floats, between, compose

#: Relations between two trajectories: poses so many seconds apart at most are of the same moment; and so many m of way
#: between the two ends.
_SAME_S, _WAYS_M = 0.1, (1.0, 5.0, 20.0)


@dataclass(frozen=True, slots=True)
class Agreement:
    """Means and deviations over the relations: m and degrees."""

    relations: int
    translation: float
    translation_deviation: float
    translation_worst: float
    rotation: float
    rotation_deviation: float


def read_relations(path: Path) -> Floats:
    """(R, 5) t1, t2 and the pose x, y, theta at t2 seen from that at t1, of lines ``t1 t2 x y z roll pitch yaw``.

    Raises:
        ValueError: a line is no relation, or there is none.
    """
    return _rows(path, (0, 1, 2, 3, 7), "relations: lines of t1 t2 x y z roll pitch yaw")


def read_trajectory(path: Path) -> Floats:
    """(S, 4) of lines ``t x y theta``, what follows on a line is ignored.

    Raises:
        ValueError: a line holds no four numbers, or there is none.
    """
    return _rows(path, (0, 1, 2, 3), "trajectory: lines of t x y theta")


def _rows(path: Path, columns: tuple[int, ...], what: str) -> Floats:
    """Numbers of a text file, perhaps packed; lines that begin with # are left out."""
    opener = gzip.open if path.suffix == ".gz" else open
    with opener(path, "rt", encoding="ascii", errors="replace") as file:
        lines = [line.split() for line in file if line.strip() and not line.startswith("#")]
    try:
        rows = np.array([[float(words[column]) for column in columns] for words in lines])
    except (ValueError, IndexError) as error:
        raise ValueError(f"no {what}") from error
    if not len(rows) or not np.isfinite(rows).all():
        raise ValueError(f"no {what}")
    return rows


def relations_of(trajectory: Floats) -> Floats:
    """(R, 5) relations of a trajectory (S, 4) t, x, y, theta: between poses 1, 5 and 20 m of way apart."""
    way = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(trajectory[:, 1:3], axis=0).T))])
    rows = []
    for apart in _WAYS_M:
        second = np.searchsorted(way, way + apart)
        first = np.flatnonzero(second < len(way))
        second = second[first]
        seen = between(trajectory[first, 1:], trajectory[second, 1:])
        rows.append(np.column_stack([trajectory[first, 0], trajectory[second, 0], seen]))
    return np.concatenate(rows)


def agreement_with(relations: Floats, trajectory: Floats, odometry: Floats | None = None) -> Agreement:
    """Errors of ``trajectory`` (S, 4) against ``relations`` (R, 5).

    Where no pose is within 0.1 s, ``odometry`` (N, 4) leads there from the nearest one; without it, a straight line.

    Raises:
        ValueError: there is no relation.
    """
    if not len(relations):
        raise ValueError("there is no relation to compare with")
    seen = between(_at(relations[:, 0], trajectory, odometry), _at(relations[:, 1], trajectory, odometry))
    error = between(relations[:, 2:], seen)
    translation, rotation = np.hypot(error[:, 0], error[:, 1]), np.degrees(np.abs(error[:, 2]))
    return Agreement(
        len(relations),
        float(translation.mean()),
        float(translation.std()),
        float(translation.max()),
        float(rotation.mean()),
        float(rotation.std()),
    )


def _at(t: Floats, trajectory: Floats, odometry: Floats | None) -> Floats:
    """(R, 3) poses at times ``t``."""
    trajectory = trajectory[np.argsort(trajectory[:, 0], kind="stable")]
    nearest = _nearest(trajectory[:, 0], t)
    poses = trajectory[nearest, 1:4].copy()
    far = np.abs(trajectory[nearest, 0] - t) > _SAME_S
    if odometry is not None:
        odometry = odometry[np.argsort(odometry[:, 0], kind="stable")]
        left = odometry[_nearest(odometry[:, 0], trajectory[nearest[far], 0]), 1:4]
        arrived = odometry[_nearest(odometry[:, 0], t[far]), 1:4]
        poses[far] = compose(poses[far], between(left, arrived))
    else:
        columns = (trajectory[:, 1], trajectory[:, 2], np.unwrap(trajectory[:, 3]))
        poses[far] = np.stack([np.interp(t[far], trajectory[:, 0], column) for column in columns], axis=-1)
    return poses


def _nearest(times: Floats, t: Floats) -> np.ndarray[tuple[int], np.dtype[np.int64]]:
    after = np.clip(np.searchsorted(times, t), 1, max(1, len(times) - 1))
    after = np.minimum(after, len(times) - 1)
    before = np.maximum(after - 1, 0)
    nearer: np.ndarray[tuple[int], np.dtype[np.int64]] = np.where(
        np.abs(times[before] - t) <= np.abs(times[after] - t), before, after
    )
    return nearer
