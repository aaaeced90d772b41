"""The outline of a robot in a scan: where a rectangle of known size stands, from its faces and from beams that pass it.

A point of a face tells how far off the face is; a beam that passes through where the rectangle should be tells that
the corner it passes is elsewhere. Gauss-Newton steps on (x, y, yaw), with where it should be as a third opinion.
(Faces: rectangle fitting of laser points, Zhang et al. 2017, "Efficient L-shape fitting for vehicle detection using
laser scanners"; beams that pass: free space, as in likelihood fields.)
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from tms_agents.floor.norm import norm
from tms_agents.floor.scan.background import FOREGROUND
from tms_agents.floor.scan.freespace import index_of

Array = NDArray[np.float64]

#: A point belongs to a face within this (m); what is so far (m) behind a face has passed through it.
_ON_M, _THROUGH_M = 0.06, 0.12
#: A point tells of a face as well as this (m), and of points alike so many count; a passing beam of a corner (m).
_FACE_M, _COUNT, _MORE, _CORNER_M = 0.03, 4.0, 10.0, 0.03
#: Points so far (m) from the outline are looked at.
_NEAR_M = 0.15
#: A beam of a cluster is no farther than this (m) from its nearest part; a chord so short (m) is a corner cut.
_DEEP_M, _CHORD_M = 0.6, 0.03
#: A step of the fit is so far at most (m, rad), and the last one if it is shorter than this.
_STEP_M, _TURN, _LITTLE_M, _LITTLE = 0.2, 0.3, 0.002, 0.003
#: Points so far off (m) count for little.
_OFF_M = 0.04
#: What is found without knowing its yaw lies within this (m, rad) of the guess, after so many steps at most, and its
#: middle this share of its shorter half farther away than what is seen of it.
_GUESS_M, _GUESS, _ROUNDS, _BEHIND = 0.3, 0.3, 10, 0.7
#: A robot is seen by so many points at least.
_LEAST = 3.0
#: How a fit went: points on the outline, close before it or beside it, inside it, beams that passed, beams something
#: nearer hides, and beams that should meet it.
ON, BESIDE, INSIDE, PASSED, HIDDEN, ALL = range(6)


@njit(cache=True)
def _enters(sx: float, sy: float, dx: float, dy: float, a: float, b: float) -> tuple[float, float]:
    """Where a ray from (sx, sy) along (dx, dy) enters and leaves the rectangle of half sizes a and b, m; inf: never."""
    near, far = -np.inf, np.inf
    for s, d, half in ((sx, dx, a), (sy, dy, b)):
        if abs(d) < 1e-9:
            if abs(s) > half:
                return np.inf, np.inf
            continue
        one, two = (-half - s) / d, (half - s) / d
        near, far = max(near, min(one, two)), min(far, max(one, two))
    if near > far or near < 0.0:
        return np.inf, np.inf
    return near, far


@njit(cache=True)
def _offset(u: float, v: float, su: float, sv: float, a: float, b: float) -> tuple[float, float]:
    """How far (m, along both axes) the point (u, v) is from the nearest face that is seen from (su, sv); inf: none."""
    best, eu, ev = np.inf, np.inf, np.inf
    if abs(su) > a:
        x = u - (a if su > 0.0 else -a)
        y = max(abs(v) - b, 0.0) * (1.0 if v > 0.0 else -1.0)
        if norm(x, y) < best:
            best, eu, ev = norm(x, y), x, y
    if abs(sv) > b:
        x = max(abs(u) - a, 0.0) * (1.0 if u > 0.0 else -1.0)
        y = v - (b if sv > 0.0 else -b)
        if norm(x, y) < best:
            best, eu, ev = norm(x, y), x, y
    return eu, ev


@njit(cache=True)
def _window(x: float, y: float, radius: float, pose: Array, first: float, step: float, n: int) -> tuple[int, int]:
    """The beams from and to (exclusive) that may meet a disc; none where the sensor is in it."""
    away = norm(x - pose[0], y - pose[1])
    if away <= radius:
        return 0, 0
    middle = index_of(math.atan2(y - pose[1], x - pose[0]) - pose[2], first, step, n)
    half = math.asin(radius / away) / abs(step)
    return max(0, math.ceil(middle - half)), min(n, math.floor(middle + half) + 1)


@njit(cache=True)
def fit(
    at: Array,
    a: float,
    b: float,
    spread_m: float,
    spread: float,
    rounds: int,
    how: Array,
    ranges: Array,
    states: NDArray[np.int8],
    rays: Array,
    pose: Array,
    first: float,
    step: float,
) -> None:
    """Move ``at`` (3,), x m, y m and yaw of a rectangle of half sizes a and b, to where a scan says it is.

    It was expected there by ``spread_m`` m and ``spread`` rad (standard deviations). ``how`` (6,) counts `ON` to `ALL`.
    """
    x0, y0, yaw0 = at
    lo, hi = _window(x0, y0, norm(a, b) + _NEAR_M, pose, first, step, ranges.size)
    matrix, right = np.empty((3, 3)), np.empty(3)
    for turn in range(rounds + 1):
        x, y, c, s = at[0], at[1], math.cos(at[2]), math.sin(at[2])
        su, sv = c * (pose[0] - x) + s * (pose[1] - y), c * (pose[1] - y) - s * (pose[0] - x)
        matrix[:] = 0.0
        right[:] = 0.0
        how[:] = 0.0
        for i in range(lo, hi):
            r = ranges[i]
            if np.isnan(r) or r > rays[i, 8]:
                continue
            du, dv = c * rays[i, 2] + s * rays[i, 3], c * rays[i, 3] - s * rays[i, 2]
            enters, leaves = _enters(su, sv, du, dv, a, b)
            how[ALL] += enters < np.inf
            if np.isinf(r):
                continue
            u, v = su + r * du, sv + r * dv
            eu, ev = _offset(u, v, su, sv, a, b)
            off = norm(eu, ev)
            new = states[i] == FOREGROUND
            if new and off < _NEAR_M and not (enters < np.inf and r > leaves):
                inside = abs(u) < a and abs(v) < b
                how[ON if off < _ON_M else INSIDE if inside else BESIDE] += 1.0
                weight = 1.0 / (1.0 + (off / _OFF_M) ** 2) ** 2
                _add(matrix, right, eu, ev, u, v, weight / _FACE_M**2)
            elif enters < np.inf and r < enters:
                how[HIDDEN] += 1.0
            elif enters < np.inf and r > enters + _THROUGH_M and leaves - enters > _CHORD_M:
                if r < leaves:
                    how[INSIDE] += 1.0
                    continue
                how[PASSED] += 1.0
                # The corner that is nearest to the beam should be on the other side of it.
                side, cu, cv = np.inf, 0.0, 0.0
                for pu, pv in ((a, b), (a, -b), (-a, b), (-a, -b)):
                    across = (pu - su) * dv - (pv - sv) * du
                    if _outermost(pu, pv, su, sv, a, b) and abs(across) < abs(side):
                        side, cu, cv = across, pu, pv
                if np.isfinite(side):
                    _add(matrix, right, -side * dv, side * du, cu, cv, 1.0 / _CORNER_M**2)
        if turn == rounds:
            return
        # Errors of neighbouring beams are alike.
        count = _COUNT + _MORE * how[ON] / max(how[ALL], how[ON], 1.0)
        share = min(1.0, count / max(how[ON] + how[BESIDE] + how[INSIDE] + how[PASSED], 1.0))
        matrix *= share
        right *= share
        # In the frame of the robot, as the matrix.
        gx, gy = x0 - x, y0 - y
        right[0] += (c * gx + s * gy) / spread_m**2
        right[1] += (c * gy - s * gx) / spread_m**2
        right[2] += math.atan2(math.sin(yaw0 - at[2]), math.cos(yaw0 - at[2])) / spread**2
        matrix[0, 0] += 1.0 / spread_m**2
        matrix[1, 1] += 1.0 / spread_m**2
        matrix[2, 2] += 1.0 / spread**2
        move = np.linalg.solve(matrix, right)
        far = norm(move[0], move[1])
        if far > _STEP_M:
            move[:2] *= _STEP_M / far
        move[2] = min(max(move[2], -_TURN), _TURN)
        at[0] += c * move[0] - s * move[1]
        at[1] += s * move[0] + c * move[1]
        at[2] += move[2]
        if far < _LITTLE_M and abs(move[2]) < _LITTLE and turn < rounds - 1:
            rounds = turn + 1


@njit(cache=True)
def _add(matrix: Array, right: Array, eu: float, ev: float, u: float, v: float, weight: float) -> None:
    """Add to the normal equations that the rectangle should move by (eu, ev) at (u, v), all in its frame."""
    away = norm(eu, ev)
    if away < 1e-9:
        nu, nv = 1.0, 0.0
        if abs(u) < abs(v):
            nu, nv = 0.0, 1.0
    else:
        nu, nv = eu / away, ev / away
    turns = nv * u - nu * v
    row = (nu, nv, turns)
    for i in range(3):
        right[i] += weight * row[i] * away
        for j in range(3):
            matrix[i, j] += weight * row[i] * row[j]


@njit(cache=True)
def _outermost(pu: float, pv: float, su: float, sv: float, a: float, b: float) -> bool:
    """Whether the corner is at the left or right end of what is seen of the rectangle from (su, sv)."""
    left = right = False
    for qu, qv in ((a, b), (a, -b), (-a, b), (-a, -b)):
        turn = (pu - su) * (qv - sv) - (pv - sv) * (qu - su)
        left, right = left or turn > 1e-9, right or turn < -1e-9
    return not (left and right)


@njit(cache=True)
def search(
    at: Array,
    a: float,
    b: float,
    yaws: int,
    how: Array,
    ranges: Array,
    states: NDArray[np.int8],
    rays: Array,
    pose: Array,
    first: float,
    step: float,
) -> float:
    """As `fit`, without knowing its yaw: the best of so many; how well it fits, 0 to 1 (`quality`)."""
    x, y = at[0], at[1]
    away = max(norm(x - pose[0], y - pose[1]), 1e-6)
    # What is seen is this side of its middle.
    x += _BEHIND * min(a, b) * (x - pose[0]) / away
    y += _BEHIND * min(a, b) * (y - pose[1]) / away
    best, best_at, best_how = -1.0, at.copy(), how.copy()
    for k in range(yaws):
        at[0], at[1], at[2] = x, y, k * math.pi / yaws
        fit(at, a, b, _GUESS_M, _GUESS, _ROUNDS, how, ranges, states, rays, pose, first, step)
        value = quality(how, how[BESIDE])
        if value > best:
            best, best_at[:], best_how[:] = value, at, how
    at[:], how[:] = best_at, best_how
    return best


@njit(cache=True)
def quality(how: Array, beside: float) -> float:
    """Which share of what can be seen of the rectangle is there, and nothing else; so much is ``beside`` it."""
    return float(how[ON] / max(how[ON] + beside + how[INSIDE] + how[PASSED], 1.0)) if how[ON] >= _LEAST else 0.0


@njit(cache=True)
def share_of(c: Any, at: Array, a: float, b: float, ranges: Array, rays: Array, pose: Array) -> float:
    """Which share of the beams of a cluster is on the outline."""
    x, y, co, s = at[0], at[1], math.cos(at[2]), math.sin(at[2])
    su, sv = co * (pose[0] - x) + s * (pose[1] - y), co * (pose[1] - y) - s * (pose[0] - x)
    on, n = 0, 0
    for i in range(c.first, c.last + 1):
        r = ranges[i]
        if not np.isfinite(r) or r > rays[i, 8] or abs(r - c.near) > _DEEP_M:
            continue
        n += 1
        px, py = pose[0] + r * rays[i, 2] - x, pose[1] + r * rays[i, 3] - y
        eu, ev = _offset(co * px + s * py, co * py - s * px, su, sv, a, b)
        on += norm(eu, ev) < _ON_M
    return on / max(n, 1)
