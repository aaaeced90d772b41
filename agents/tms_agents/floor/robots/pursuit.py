"""All robots of known size in one scan: each is followed, found again where it comes out, and takes what is its own."""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from tms_agents.floor.norm import norm
from tms_agents.floor.robots.footprint import accompany, drive, follow, take

Array = NDArray[np.float64]

#: So many beams make a candidate; one not seen for so long (s) is none.
_BEAMS, _LOST_S = 5, 1.0
#: It goes like a robot after so many scans and such a way (m), if it fits so well in the mean and a person was beside
#: it for less than this share of the way.
_HITS, _WAY_M, _WELL, _PUSHED = 12, 0.25, 0.9, 0.4
#: A robot lost for so long (s) at least and at most is found in a candidate that was not there so long (s) before and
#: was seen so often: so near (m), and as far as it may have gone (m/s) for so long (s), or all the time if it must have
#: gone: its place looks so little like it, or the candidate has gone so far (m) by itself.
_ANEW_S, _FORGET_S, _BEFORE_S, _AGAIN = 0.3, 60.0, 0.5, 8
_NEAR_M, _SPEED, _HIDES_S, _LEFT, _OFF_M = 0.6, 0.8, 4.0, 0.5, 0.5
#: What is so near (m) is the same.
SAME_M = 0.35


@njit(cache=True)
def pursue(
    footprints: Any,
    spare: Any,
    bodies: Any,
    t: float,
    order: NDArray[np.int64],
    seen: NDArray[np.bool_],
    at: Array,
    how: Array,
    ranges: Array,
    states: NDArray[np.int8],
    rays: Array,
    pose: Array,
    first: float,
    step: float,
) -> int:
    """Follow all ``footprints`` (n,) in a scan, in the ``order`` (n,) that this fills: how many; who is ``seen`` (n,).

    Robots first, and of these who was seen last. ``spare`` (1,), ``at`` (3,) and ``how`` (6,) are scratch.
    """
    count = _sort(footprints, order)
    seen[:] = False
    for index in order[:count]:
        q = footprints[index]
        if not q.used:
            continue
        if q.body >= 0 and not (bodies[q.body].used and bodies[q.body].footprint == index + 1):
            q.body = -1
        spare[0] = footprints[index]
        before = q.at
        found = follow(q, t, at, how, ranges, states, rays, pose, first, step)
        if found and _is_taken(footprints, index, t):
            footprints[index] = spare[0]
            q.at, found = t, False
        if not found and q.sure and t - q.seen > _ANEW_S:
            found = _find_again(footprints, index, t)
        if found:
            accompany(q, bodies, t, t - before)
        elif t - q.seen > _LOST_S and q.body < 0:
            q.used = 0
        seen[index] = found
    return count


@njit(cache=True)
def _sort(footprints: Any, order: NDArray[np.int64]) -> int:
    """Fill ``order`` (n,) with those in use, robots first, and who was seen last of each: how many."""
    count = 0
    for index in range(footprints.size):
        q = footprints[index]
        if not q.used:
            continue
        k = count
        while k > 0:
            p = footprints[order[k - 1]]
            if (p.sure, p.seen) >= (q.sure, q.seen):
                break
            order[k] = order[k - 1]
            k -= 1
        order[k] = index
        count += 1
    return count


@njit(cache=True)
def _is_taken(footprints: Any, index: int, t: float) -> bool:
    """Whether another robot that is seen in this scan already is there."""
    q = footprints[index]
    reach = q.b if q.sure else SAME_M
    for o in range(footprints.size):
        p = footprints[o]
        if o != index and p.used and p.sure and p.seen == t and norm(p.x - q.x, p.y - q.y) < reach:
            return True
    return False


@njit(cache=True)
def _find_again(footprints: Any, index: int, t: float) -> bool:
    """Whether what seemed to be another robot, met since this one was lost, is it: then it is where that is."""
    q = footprints[index]
    lost_s, left = t - q.seen, q.fits < _LEFT
    if lost_s > _FORGET_S:
        return False
    best, best_m = -1, np.inf
    for o in range(footprints.size):
        p = footprints[o]
        new = p.used and not p.sure and p.hits >= _AGAIN and p.first > q.seen - _BEFORE_S and t - p.seen < _ANEW_S
        if not new or p.a != q.a or p.b != q.b or not (left or p.pushed < _PUSHED):
            continue
        going_s = min(lost_s, _HIDES_S) if q.going else 0.0
        away = norm(p.x - q.x, p.y - q.y)
        reach = _NEAR_M + _SPEED * (lost_s if left or p.alone > _OFF_M else going_s)
        if away < min(reach, best_m):
            best, best_m = o, away
    if best < 0:
        return False
    p = footprints[best]
    q.x, q.y, q.yaw, q.vx, q.vy, q.seen, q.at, q.fits = p.x, p.y, p.yaw, p.vx, p.vy, p.seen, p.at, p.fits
    p.used = 0
    return True


@njit(cache=True)
def goes(footprints: Any, seen: NDArray[np.bool_]) -> int:
    """A candidate that was ``seen`` (n,) and goes like a robot, alone and always looking like one; -1: none."""
    for index in range(footprints.size):
        q = footprints[index]
        alike = q.hits >= _HITS and q.fits >= _WELL and q.pushed <= _PUSHED
        if seen[index] and q.used and not q.sure and alike and norm(q.x - q.x0, q.y - q.y0) >= _WAY_M:
            return index
    return -1


@njit(cache=True)
def bodiless(footprints: Any, seen: NDArray[np.bool_], start: int) -> int:
    """The first from ``start`` on that was ``seen`` (n,), is a robot, and is none of the bodies yet; -1: none."""
    for index in range(start, footprints.size):
        q = footprints[index]
        if seen[index] and q.used and q.sure and q.body < 0:
            return index
    return -1


@njit(cache=True)
def own(
    footprints: Any,
    order: NDArray[np.int64],
    seen: NDArray[np.bool_],
    clusters: Any,
    hypotheses: Any,
    t: float,
    claimed: NDArray[np.bool_],
    at: Array,
    ranges: Array,
    rays: Array,
    pose: Array,
) -> int:
    """Robots that were ``seen`` (n,) take what is theirs out of ``clusters`` (m,), and move: how many are left."""
    m: int = clusters.size
    for index in order:
        q = footprints[index]
        if q.used and q.sure and seen[index]:
            m = take(q, clusters[:m], ranges, rays, pose, claimed, at)
            if q.body >= 0:
                drive(hypotheses, q.body, q, t)
    return m


@njit(cache=True)
def wide(clusters: Any, start: int, footprints: Any, least_m: float, t: float) -> int:
    """The first of ``clusters`` (m,) from ``start`` on that is wide and where no footprint is; m if there is none."""
    for k in range(start, clusters.size):
        c = clusters[k]
        broad = c.width > least_m and c.n >= _BEAMS and c.mirror < 0 and not c.attached
        if broad and not is_near(footprints, c.x, c.y, t):
            return k
    return int(clusters.size)


@njit(cache=True)
def is_near(footprints: Any, x: float, y: float, t: float) -> bool:
    """Whether a footprint is there and seen."""
    for index in range(footprints.size):
        q = footprints[index]
        if q.used and t - q.seen < _ANEW_S and norm(q.x - x, q.y - y) < SAME_M:
            return True
    return False
