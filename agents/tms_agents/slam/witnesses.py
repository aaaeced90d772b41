"""Scans that are asked whether a place was free: shortly before and after each key scan, keys or not."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from tms_agents.slam.geometry import Floats, Ints, compose, transform
from tms_agents.slam.keyframes import Indices, poses_of_all
from tms_agents.slam.logs import Log
from tms_agents.slam.motion import OdometryNoise
from tms_agents.slam.people import Mask, mark_people

#: Scans so long (s) before and after are asked, the nearest to each: by odometry alone, and by a path that is mapped.
_NEAR_S = (0.5, 1.0, 1.5, 2.0, 3.0, 4.0)
_FAR_S = (0.5, 1.0, 1.5, 2.0, 3.0, 4.0, 6.0, 8.0, 11.0, 15.0, 20.0, 30.0)
#: So many standard deviations of odometry may be wrong between two scans; those of the settings are wide.
_DEVIATIONS = 0.5


def people_by_odometry(log: Log, keys: Indices, scans: Sequence[Floats], noise: OdometryNoise) -> list[Mask]:
    """(M,) for each of ``scans`` ((M, 2) m, seen from the robot), those of ``keys`` (K,): which points are people.

    Before anything is mapped: sure where odometry can be trusted from scan to scan.
    """
    unsure = _DEVIATIONS * np.array([[noise.way_per_m, noise.way_per_rad], [noise.turn_per_m, noise.turn_per_rad]])
    return _people(log, keys, log.odometry, scans, _NEAR_S, unsure)


def people_by_path(log: Log, keys: Indices, scans: Sequence[Floats], path: Floats) -> list[Mask]:
    """The same, by the ``path`` (K, 3) of the robot at the keys, as it was found: it looks farther."""
    return _people(log, keys, poses_of_all(log, keys, path), scans, _FAR_S, np.zeros((2, 2)))


def _people(
    log: Log, keys: Indices, robot: Floats, scans: Sequence[Floats], lags: Sequence[float], unsure: Floats
) -> list[Mask]:
    falls = log.angles[0] > log.angles[-1]
    first = np.concatenate([[0], np.cumsum([len(points) for points in scans])])
    world = [transform(robot[key], points) for key, points in zip(keys, scans, strict=True)]
    beams = [log.ranges[key, log.returned(int(key))] for key in keys]
    found = np.zeros(first[-1], dtype=np.bool_)
    mark_people(
        np.concatenate(world), np.concatenate(beams), first, keys, compose(robot, log.laser[None]),
        np.ascontiguousarray(log.angles[::-1] if falls else log.angles),
        np.ascontiguousarray(log.ranges[:, ::-1] if falls else log.ranges),
        log.range_max, log.driven, unsure, _asked(log.t, keys, -1, lags), _asked(log.t, keys, 1, lags), found,
    )  # fmt: skip
    return np.split(found, first[1:-1])


def _asked(t: Floats, keys: Indices, side: int, lags: Sequence[float]) -> Ints:
    """(K, W) numbers of the scans before (``side`` -1) or after (1) ``keys``, each once, the nearest first, then -1."""
    wanted = t[keys, None] + side * np.array(lags)
    right = np.clip(np.searchsorted(t, wanted), 1, max(1, len(t) - 1))
    left = right - 1
    right = np.minimum(right, len(t) - 1)
    nearest = np.where(np.abs(t[left] - wanted) <= np.abs(t[right] - wanted), left, right)
    away = side * (nearest - keys[:, None])
    fresh = np.diff(away, axis=1, prepend=0) > 0
    timely = np.abs(t[nearest] - t[keys, None]) < 2 * lags[-1]
    chosen = np.where((away > 0) & fresh & timely, nearest, -1)
    order = np.argsort(chosen < 0, axis=1, kind="stable")
    return np.take_along_axis(chosen, order, axis=1).astype(np.int32)
