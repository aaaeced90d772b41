"""Which scans are worth processing, and where the robot was at the others."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tms_agents.slam.geometry import Floats, between, compose, wrapped
from tms_agents.slam.logs import Log

Indices = NDArray[np.int64]


@dataclass(frozen=True, slots=True, eq=False)
class KeyScans:
    """The K key scans of a drive: ``odometry`` (K, 3), ``driven`` (K, 2) as in `Log`, ``scans`` of (M, 2) points m seen
    from the robot, on which the ``laser`` is at (2,) m."""

    odometry: Floats
    driven: Floats
    scans: Sequence[Floats]
    laser: Floats

    def __len__(self) -> int:
        return len(self.scans)


def key_scans(log: Log, step_m: float, step_rad: float) -> Indices:
    """(K,) scans to process: one whenever the robot has driven ``step_m`` or turned ``step_rad``, to and fro added up.

    Of logs that hold key scans alone (most are at least half a step apart) all of them.
    """
    steps = np.diff(log.driven, axis=0) / np.array([step_m, step_rad])
    if len(steps) and np.median(steps.max(axis=1)) >= 0.5:
        return np.arange(len(log))
    return spaced(log, step_m, step_rad)


def spaced(log: Log, step_m: float, step_rad: float) -> Indices:
    """(K,) scans of which each is so far from the one before, in any log."""
    keys = [0]
    for n in range(1, len(log)):
        if ((log.driven[n] - log.driven[keys[-1]]) >= (step_m, step_rad)).any():
            keys.append(n)
    return np.array(keys)


def poses_of_all(log: Log, keys: Indices, path: Floats) -> Floats:
    """(S, 3) of every scan: from ``path`` (K, 3) at ``keys`` on by odometry, whose error until the next key is spread
    evenly."""
    scans = np.arange(len(log))
    last = np.searchsorted(keys, scans, side="right") - 1
    ahead = compose(path[last], between(log.odometry[keys[last]], log.odometry))
    after = np.minimum(last + 1, len(keys) - 1)
    back = compose(path[after], between(log.odometry[keys[after]], log.odometry))
    progress = log.driven.sum(axis=1)
    whole = progress[keys[after]] - progress[keys[last]]
    share = np.where(whole > 0, (progress - progress[keys[last]]) / np.where(whole > 0, whole, 1.0), 0.0)[:, None]
    gap = back - ahead
    gap[:, 2] = wrapped(gap[:, 2])
    poses: Floats = ahead + share * gap
    poses[:, 2] = wrapped(poses[:, 2])
    return poses
