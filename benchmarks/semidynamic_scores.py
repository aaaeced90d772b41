"""Paths and objects whose truth is known, with the paths laid on one another as well as possible."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from tms_agents.slam import Log
from tms_agents.slam.geometry import Floats, compose, inverse, transform, wrapped
from tms_agents.slam.logs import odometry_at
from tms_agents.slam.semidynamic import Semidynamic

#: Right within (m, degrees); a door is open from (degrees) on; fewer reads are no visit.
_RIGHT_M, _RIGHT_DEG, _OPEN_DEG, _READS = 0.2, 20.0, 15.0, 3


@dataclass(frozen=True, slots=True)
class Scores:
    """``path_m``: root mean square error of the path. Intervals of time in which an object stood still and was read:
    how many were there, found at all, and right (round things may be turned), seen from where the robot truly was when
    it was nearest; those of ``doors``, and ``doors_wrong``: open or closed."""

    path_m: float
    expected: int
    found: int
    right: int
    doors: int
    doors_wrong: int


def scores(log: Log, truth: Mapping[str, Any], result: Semidynamic) -> Scores:
    """``truth`` is the document of the simulation."""
    path = np.array(truth["trajectory"])
    robot = odometry_at(path[:, 0], path[:, 1:], log.t)
    off = transform(best_fit(log, truth, result.poses), result.poses[:, :2]) - robot[:, :2]
    expected = found = right = doors = doors_wrong = 0
    for tag, thing in truth["objects"].items():
        stays = [(float(log.t[stay.visit.scans[0]]), stay.pose) for stay in result.stays.get(tag, ())]
        for reads, interval in zip(thing["reads"], thing["poses"], strict=True):
            if reads < _READS:
                continue
            expected += 1
            before = [pose for t, pose in stays if t < interval["t1"]]
            if not before:
                continue
            found += 1
            during = np.flatnonzero((log.t >= interval["t0"]) & (log.t < interval["t1"]))
            apart = np.hypot(robot[during, 0] - interval["x"], robot[during, 1] - interval["y"])
            nearest = during[np.argmin(apart)]
            there = compose(robot[nearest], compose(inverse(result.poses[nearest]), before[-1]))
            distance = np.hypot(there[0] - interval["x"], there[1] - interval["y"])
            turned = np.degrees(abs(wrapped(there[2] - interval["theta"])))
            right += bool(distance < _RIGHT_M and (turned < _RIGHT_DEG or thing["class"] == "bin_round"))
            if thing["door"]:
                closed = thing["door"]["closed_theta"]
                doors += 1
                doors_wrong += _open(there[2], closed) != _open(interval["theta"], closed)
    return Scores(float(np.sqrt(np.mean(off**2) * 2)), expected, found, right, doors, doors_wrong)


def _open(theta: float, closed: float) -> bool:
    return bool(np.degrees(abs(wrapped(theta - closed))) > _OPEN_DEG)


def best_fit(log: Log, truth: Mapping[str, Any], path: Floats) -> Floats:
    """(3,) that brings ``path`` (S, 3) at the scans onto the true one with the least squares."""
    known = np.array(truth["trajectory"])
    there = odometry_at(known[:, 0], known[:, 1:], log.t)[:, :2]
    a, b = path[:, :2] - path[:, :2].mean(axis=0), there - there.mean(axis=0)
    turn = float(np.arctan2((a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]).sum(), (a * b).sum()))
    shift = there.mean(axis=0) - transform(np.array([0.0, 0.0, turn]), path[:, :2]).mean(axis=0)
    return np.array([*shift, turn])
