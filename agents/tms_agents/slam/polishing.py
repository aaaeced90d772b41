"""The last centimetres of a path whose loops are closed: scans matched with one another, point to line.

A grid of 5 cm cells keeps a filter within 2 to 4 cm; scans agree with one another within millimetres. Each scan is
matched with those just before it and with some that saw the same place at other times; a sparse pose graph joins all
of it (Lu and Milios 1997). What moved between the two scans is an outlier of a robust kernel. Where scans do not tell
how far the robot went, odometry does, whose metre is measured where they do.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from tms_agents.slam.geometry import Floats, between, compose
from tms_agents.slam.keyframes import Indices, poses_of_all, spaced
from tms_agents.slam.lines import Lines, lines_of, match_lines, without
from tms_agents.slam.logs import Log
from tms_agents.slam.motion import OdometryNoise
from tms_agents.slam.posegraph import Edges, joined, optimise
from tms_agents.slam.wheels import Wheels, wheels_of

#: Scans that are matched: one every so much (m, rad).
_STEP_M, _STEP_RAD = 0.1, 0.08
#: Each with those so many before it, and with at most so many of other times whose views have their middles, so far
#: ahead of the robot, near each other (m).
_BEFORE, _OTHERS = (1, 2, 4, 8), 4
_AHEAD_M, _NEAR_M, _LONG_AGO = 2.0, 1.2, 12
#: Steps of the reader of distances: how far lines are looked for (m), round by round.
_REACHES_M = (0.25, 0.12, 0.08)
#: Before them where things that were moved pulled the path along, which may be by half a metre and more.
_WIDELY_M = (0.9, 0.5)
#: One scan slides along another where it is so much less held than across.
_SLIDES = 0.2
#: A path is torn where from one scan to the next it is so far off odometry (m).
_TORN_M = 0.05
#: A match counts if so large a share of the points that should fit does.
_SHARE = 0.5
#: Errors of beams, m, of which so many are worth one witness; a match is never better than this (m, rad).
_SIGMA_M, _WITNESSES, _FLOOR = 0.02, 6.0, (0.002, 0.002, 0.0008)
_SWITCH = 12.0
#: The robot was parked where records are so far apart (s).
PARKED_S = 600.0


def polish(
    log: Log, poses: Floats, noise: OdometryNoise, movable: Callable[[int, Floats], NDArray[np.bool_]] | None = None
) -> Floats:
    """(S, 3) of every scan, from ``poses`` (S, 3) that are right within a decimetre or two.

    ``movable`` tells which of points (N, 2), seen from the robot at a scan, are of things that may have been moved
    while it was parked: scans before and after that are matched without them."""
    keys = spaced(log, _STEP_M, _STEP_RAD)
    path = poses[keys]
    lines = [lines_of(log, int(key)) for key in keys]
    static = lines if movable is None else [_static(one, int(k), movable) for one, k in zip(lines, keys, strict=True)]
    legs = legs_of(log.t)[keys]
    match = Matcher(lines, static, legs, movable is not None)
    steps = match.steps(path, log.odometry[keys])
    odometry = _odometry(log, keys, wheels_of(steps, log.odometry[keys], noise))
    if movable is not None:
        # Each time by itself at first: what was moved lets go of the path.
        within_legs = match.revisits(path, _REACHES_M[0], within_legs=True)
        path = optimise(path, odometry, joined(steps, within_legs))
    for reach in _REACHES_M if movable is None else (*_WIDELY_M, *_REACHES_M):
        matches = joined(steps, match.revisits(path, reach))
        # Torn far at first, all pull with full weight; who is alone against the others lets go then.
        path = optimise(path, odometry, matches, np.inf if reach in _WIDELY_M else _SWITCH)
    return poses_of_all(log, keys, path)


def legs_of(t: Floats) -> NDArray[np.int64]:
    """(S,) how often the robot was parked before each record."""
    numbers: NDArray[np.int64] = np.concatenate([[0], np.cumsum(np.diff(t) >= PARKED_S)]).astype(np.int64)
    return numbers


def _static(lines: Lines, n: int, movable: Callable[[int, Floats], NDArray[np.bool_]]) -> Lines:
    gone = np.zeros(len(lines.points), dtype=np.bool_)
    met = np.flatnonzero(~np.isnan(lines.points[:, 0]))
    gone[met] = movable(n, lines.points[met])
    return lines.without(gone)


def _odometry(log: Log, keys: Indices, wheels: Wheels) -> Edges:
    motions = between(log.odometry[keys[:-1]], log.odometry[keys[1:]])
    covariance = wheels.noise.covariance(motions, np.diff(log.driven[keys], axis=0))
    numbers = np.arange(len(keys))
    information: Floats = np.linalg.inv(covariance).astype(np.float64)
    return Edges(numbers[:-1], numbers[1:], wheels.driven(motions), information)


class Matcher:
    """Matches of key scans: ``lines`` of all that they saw, ``static`` of what cannot be moved; ``sliding`` matches
    along a corridor do not count."""

    def __init__(self, lines: list[Lines], static: list[Lines], legs: NDArray[np.int64], sliding: bool) -> None:
        self._lines, self._static, self._legs, self._sliding = lines, static, legs, sliding

    def steps(self, path: Floats, ways: Floats) -> Edges:
        """Each with those just before it, by ``path`` (K, 3), or by odometry ``ways`` (K, 3) where the path is torn."""
        numbers = range(len(ways))
        pairs = [(k - back, k) for k in numbers for back in _BEFORE if k >= back and self._same_leg(k - back, k)]
        return self._matched(path, pairs, _REACHES_M[0], ways)

    def revisits(self, path: Floats, reach: float, within_legs: bool = False) -> Edges:
        """Each with some of other times whose lines are within ``reach`` m, by ``path`` (K, 3)."""
        pairs = [pair for pair in _revisits(path) if not within_legs or self._same_leg(*pair)]
        return self._matched(path, pairs, reach)

    def _same_leg(self, a: int, b: int) -> bool:
        return bool(self._legs[a] == self._legs[b])

    def _matched(self, path: Floats, pairs: list[tuple[int, int]], reach: float, ways: Floats | None = None) -> Edges:
        kept, seen, information = [], [], []
        for earlier, later in pairs:
            start = between(path[earlier], path[later])
            if ways is not None:
                driven = between(ways[earlier], ways[later])
                start = driven if np.hypot(*(start - driven)[:2]) > _TORN_M else start
            same = self._same_leg(earlier, later)
            these, within = (self._lines, min(reach, _REACHES_M[0])) if same else (self._static, reach)
            pose, hessian, share = match_lines(these[earlier], these[later], start, within, _SIGMA_M)
            if share < _SHARE or np.hypot(*(pose - start)[:2]) > 2 * within:
                continue
            if self._sliding and (not same or np.cos(start[2]) < 0):
                hessian = _without_slide(hessian, _SLIDES if not same else 1.0)
            covariance = np.linalg.inv(hessian + np.diag([1e-2, 1e-2, 1e-2])) * _WITNESSES + np.diag(np.square(_FLOOR))
            kept.append((earlier, later))
            seen.append(pose)
            information.append(np.linalg.inv(covariance))
        ends = np.array(kept, dtype=np.int64).reshape(-1, 2)
        return Edges(ends[:, 0], ends[:, 1], np.array(seen).reshape(-1, 3), np.array(information).reshape(-1, 3, 3))


def _revisits(path: Floats) -> list[tuple[int, int]]:
    """(earlier, later) keys that saw the same at other times."""
    found = set()
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


def _without_slide(hessian: Floats, below: float) -> Floats:
    """(3, 3) without what it says of the direction in which one scan can slide along the other: along a corridor each
    match stays about where it began, and hundreds that do hold a path where it is."""
    values, vectors = np.linalg.eigh(hessian[:2, :2])
    if values[0] > below * values[1] or values[0] < 1.0:
        return hessian
    return without(hessian, np.array([*vectors[:, 0], 0.0]))
