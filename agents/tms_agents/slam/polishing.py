"""The last centimetres of a path whose loops are closed: scans matched with one another, point to line.

A grid of 5 cm cells keeps a filter within 2 to 4 cm; scans agree with one another within millimetres. Each scan is
matched with those just before it and with some that saw the same place at other times; a sparse pose graph joins all
of it (Lu and Milios 1997). What moved between the two scans is an outlier of a robust kernel.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.spatial import cKDTree

from tms_agents.slam.geometry import Floats, between, compose
from tms_agents.slam.keyframes import Indices, key_scans, poses_of_all
from tms_agents.slam.lines import Lines, lines_of, match_lines
from tms_agents.slam.logs import Log
from tms_agents.slam.motion import OdometryNoise
from tms_agents.slam.posegraph import Edges, optimise

#: Scans that are matched: one every so much (m, rad).
_STEP_M, _STEP_RAD = 0.15, 0.12
#: Each with those so many before it, and with at most so many of other times whose views have their middles, so far
#: ahead of the robot, near each other (m).
_BEFORE, _OTHERS = (1, 2, 4), 4
_AHEAD_M, _NEAR_M, _LONG_AGO = 2.0, 1.2, 12
#: Steps of the reader of distances: how far lines are looked for (m), round by round.
_REACHES_M = (0.25, 0.12, 0.08)
#: A match counts if so large a share of the points that should fit does.
_SHARE = 0.5
#: Errors of beams, m, of which so many are worth one witness; a match is never better than this (m, rad).
_SIGMA_M, _WITNESSES, _FLOOR = 0.02, 6.0, (0.002, 0.002, 0.0008)
_SWITCH = 12.0


def polish(log: Log, poses: Floats, noise: OdometryNoise, progress: Callable[[float], None] = lambda _: None) -> Floats:
    """(S, 3) of every scan, from ``poses`` (S, 3) that are right within a decimetre or two."""
    keys = key_scans(log, _STEP_M, _STEP_RAD)
    path = poses[keys]
    lines = [lines_of(log, int(key)) for key in keys]
    chain = _odometry(log, keys, noise)
    for number, reach in enumerate(_REACHES_M):
        pairs = _pairs(path)
        loops = _matched(path, pairs, lines, reach)
        path = optimise(path, chain, loops, _SWITCH)
        progress((number + 1) / len(_REACHES_M))
    return poses_of_all(log, keys, path)


def _odometry(log: Log, keys: Indices, noise: OdometryNoise) -> Edges:
    motions = between(log.odometry[keys[:-1]], log.odometry[keys[1:]])
    covariance = noise.covariance(motions, np.diff(log.driven[keys], axis=0))
    numbers = np.arange(len(keys))
    information: Floats = np.linalg.inv(covariance).astype(np.float64)
    return Edges(numbers[:-1], numbers[1:], motions, information)


def _pairs(path: Floats) -> list[tuple[int, int]]:
    """(earlier, later) keys that saw the same."""
    found = {(k - back, k) for k in range(len(path)) for back in _BEFORE if k >= back}
    ahead = compose(path, np.broadcast_to([_AHEAD_M, 0.0, 0.0], path.shape))[:, :2]
    tree = cKDTree(ahead)
    for k, near in enumerate(tree.query_ball_point(ahead, _NEAR_M)):
        other = np.array([j for j in near if j < k - _LONG_AGO], dtype=np.int64)
        if not len(other):
            continue
        apart = np.hypot(*(ahead[other] - ahead[k]).T)
        # Not several from one moment: the nearest of each time.
        kept: list[int] = []
        for j in other[np.argsort(apart, kind="stable")]:
            if len(kept) < _OTHERS and all(abs(int(j) - i) > _LONG_AGO // 2 for i in kept):
                kept.append(int(j))
        found |= {(j, k) for j in kept}
    return sorted(found)


def _matched(path: Floats, pairs: list[tuple[int, int]], lines: list[Lines], reach: float) -> Edges:
    kept, seen, information = [], [], []
    for earlier, later in pairs:
        start = between(path[earlier], path[later])
        pose, hessian, share = match_lines(lines[earlier], lines[later], start, reach, _SIGMA_M)
        if share < _SHARE or np.hypot(*(pose - start)[:2]) > 2 * reach:
            continue
        covariance = np.linalg.inv(hessian + np.diag([1e-2, 1e-2, 1e-2])) * _WITNESSES + np.diag(np.square(_FLOOR))
        kept.append((earlier, later))
        seen.append(pose)
        information.append(np.linalg.inv(covariance))
    ends = np.array(kept, dtype=np.int64).reshape(-1, 2)
    return Edges(ends[:, 0], ends[:, 1], np.array(seen).reshape(-1, 3), np.array(information).reshape(-1, 3, 3))
