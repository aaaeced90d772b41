"""People who walk by: pieces of a scan, as small as a person, that end where shortly before or after one saw through.

A place that another scan saw *through* (beams on all sides of it went well past it) was free then; unknown places are
not free, and no return says nothing. Who walks leaves a place that was free before and after; who stands for a while
leaves one that was free before he came or after he went. What is now seen and now not is a thin thing, a chair's leg;
what is longer than a person is a door, or a wrong pose. Things moved while nobody looked are none of this: the scans
that are asked are from the same minute. (Visibility as in Pomerleau et al. 2014, "Long-term 3D map maintenance".)
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

from tms_agents.slam.geometry import Floats, Ints
from tms_agents.slam.keyframes import Indices
from tms_agents.slam.sharing import queue, take

Mask = NDArray[np.bool_]

#: What a few scans on one side in time say of a place: nothing, that it was free, or now this and now that.
UNKNOWN, FREE, MIXED = 0, 1, 2
#: A place is seen through if the beams within this angle or half width (rad, m) went on past it by so much, and
#: so much more per m; something was there if a beam ended so near (m, and per m).
_ANGLE, _HALF_M, _PAST_M, _PAST_PER_M, _NEAR_M, _NEAR_PER_M = 0.02, 0.1, 0.2, 0.02, 0.15, 0.015
#: A place that was free has at most this share of scans that saw something there.
_THIN = 0.34
#: Pieces of a scan end where neighbours are farther apart than this (m, and per m of range).
_GAP_M, _GAP_PER_M = 0.15, 0.03
#: The longest piece that may be a person, and the share of it that was free at other times.
_PERSON_M, _SHARE = 0.9, 0.5
#: Beyond this range beams are too far apart for people.
_FARTHEST_M = 20.0
#: Where so much of a scan seems to be people, it is the pose that is wrong.
_CROWD = 0.5


@njit(cache=True, parallel=True)
def mark_people(
    points: Floats,
    beams: Floats,
    first: Indices,
    keys: Indices,
    poses: Floats,
    bearings: Floats,
    ranges: Floats,
    range_max: float,
    driven: Floats,
    unsure: Floats,
    before: Ints,
    after: Ints,
    found: Mask,
) -> None:
    """Which ``points`` (P, 2) m, world frame, are people: into ``found`` (P,).

    Points ``first[k]`` up to ``first[k + 1]`` (not included), in the order of their beams, whose ranges are ``beams``
    (P,) m, are those of scan ``keys[k]``; ``before`` and ``after`` (K, W) number scans to ask, the nearest in time
    first, -1 past the end.

    S scans saw ``ranges`` (S, B) m, which count above 0 and below ``range_max``, at rising ``bearings`` (B,) rad from
    ``poses`` (S, 3) of the laser. ``driven`` (S, 2) m and rad until each; two poses may be wrong against each other by
    ``unsure`` (2, 2) times what was driven between: m per m and per rad, rad per m and per rad. What holds only if the
    poses are right is not said.
    """
    line = queue(len(keys))
    for begin in prange(len(keys)):
        k = take(line, begin)
        while k < len(keys):
            mine = slice(first[k], first[k + 1])
            wrong = np.zeros((2, before.shape[1], 2))
            for side in range(2):
                for w in range(before.shape[1]):
                    scan = before[k, w] if side == 0 else after[k, w]
                    for i in range(2):
                        apart = abs(driven[scan, i] - driven[keys[k], i])
                        wrong[side, w, 0] += unsure[0, i] * apart
                        wrong[side, w, 1] += unsure[1, i] * apart
            moving = np.zeros(first[k + 1] - first[k], dtype=np.bool_)
            for m in range(len(moving)):
                x, y = points[first[k] + m]
                if beams[first[k] + m] > _FARTHEST_M:
                    continue
                earlier = _told(x, y, poses, bearings, ranges, range_max, before[k], wrong[0])
                if earlier == MIXED:
                    continue
                later = _told(x, y, poses, bearings, ranges, range_max, after[k], wrong[1])
                moving[m] = later != MIXED and (earlier == FREE or later == FREE)
            _whole(points[mine], beams[mine], moving, found[mine])
            if np.count_nonzero(found[mine]) > _CROWD * len(moving):
                found[mine] = False
            k = take(line, k)


@njit(cache=True)
def _told(
    x: float,
    y: float,
    poses: Floats,
    bearings: Floats,
    ranges: Floats,
    range_max: float,
    scans: Ints,
    wrong: Floats,
) -> int:
    """`UNKNOWN`, `FREE` or `MIXED`: what ``scans`` say of a place, beyond those to which the thing was still there."""
    free, hits = 0, 0
    for w in range(len(scans)):
        if scans[w] < 0:
            break
        seen = _seen(x, y, poses[scans[w]], bearings, ranges[scans[w]], range_max, wrong[w])
        free += seen == FREE
        hits += seen == MIXED and free > 0
    if free == 0:
        return UNKNOWN
    return FREE if hits <= _THIN * free else MIXED


@njit(cache=True)
def _seen(x: float, y: float, pose: Floats, bearings: Floats, ranges: Floats, range_max: float, wrong: Floats) -> int:
    """One scan, whose pose may be ``wrong`` (m, rad), of one place: `FREE`, `MIXED` if something is there, else
    `UNKNOWN`."""
    dx, dy = x - pose[0], y - pose[1]
    away = math.hypot(dx, dy)
    if away < 1e-6:
        return UNKNOWN
    bearing = math.atan2(dy, dx) - pose[2]
    shift = wrong[0] + wrong[1] * away
    near = _NEAR_M + _NEAR_PER_M * away + shift
    half = max(_ANGLE, _HALF_M / away) + shift / away
    wide = max(half, near / away)
    past = away * (1.0 + _PAST_PER_M) + _PAST_M + shift
    bearing -= 2 * math.pi * math.floor((bearing - bearings[0] + wide) / (2 * math.pi))
    through, left, right = True, False, False
    for b in range(np.searchsorted(bearings, bearing - wide), len(bearings)):
        off, r = bearings[b] - bearing, ranges[b]
        if off > wide:
            break
        if not 0.0 < r < range_max:
            continue
        if r * r + away * away - 2.0 * r * away * math.cos(off) < near * near:
            return MIXED
        if abs(off) <= half:
            through = through and r > past
            left, right = left or off >= 0.0, right or off <= 0.0
    return FREE if through and left and right else UNKNOWN


@njit(cache=True)
def _whole(points: Floats, ranges: Floats, moving: Mask, found: Mask) -> None:
    """Pieces of a person's size that moved for the most part; of longer ones, runs that did and are no longer."""
    first = 0
    for m in range(1, len(points) + 1):
        if m < len(points) and _joined(points, ranges, m):
            continue
        moved = np.count_nonzero(moving[first:m])
        if moved > 0:
            if _extent(points, first, m) <= _PERSON_M:
                if moved >= _SHARE * (m - first):
                    found[first:m] = True
            else:
                start = first
                for k in range(first, m + 1):
                    if k == m or not moving[k]:
                        if k > start and _extent(points, start, k) <= _PERSON_M:
                            found[start:k] = True
                        start = k + 1
        first = m


@njit(cache=True)
def _joined(points: Floats, ranges: Floats, m: int) -> bool:
    gap = math.hypot(points[m, 0] - points[m - 1, 0], points[m, 1] - points[m - 1, 1])
    joined: bool = gap < _GAP_M + _GAP_PER_M * min(ranges[m], ranges[m - 1])
    return joined


@njit(cache=True)
def _extent(points: Floats, first: int, end: int) -> float:
    return math.hypot(points[end - 1, 0] - points[first, 0], points[end - 1, 1] - points[first, 1])
