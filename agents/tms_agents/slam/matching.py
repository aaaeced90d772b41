"""Scan matching: the pose where a scan fits a distance field best, together with what odometry said, and how sure
that is.

Levenberg-Marquardt on the sum of log(1 + (distance / sigma)^2) over the beams (a Cauchy kernel: people and new rooms
pull little), divided by a temperature because neighbouring beams are no independent witnesses, plus the prior's squared
Mahalanobis distance / 2. Curvature of the sum at its minimum = inverse covariance of the improved proposal
(Grisetti, Stachniss, Burgard 2007, section III; the smooth field instead of sampled scores as in Pedrosa's LaMa).
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit, prange

from tms_agents.slam.agreement import agreement
from tms_agents.slam.correlative import search
from tms_agents.slam.distance import field_at
from tms_agents.slam.geometry import Bytes, Floats, Ints, wrap
from tms_agents.slam.sharing import queue, take

#: Columns of the results of a match beside the pose: cost of the scan alone (tempered), of scan and prior, share of
#: beams that end near a surface.
COST, TOTAL, SHARE = 0, 1, 2
_ITERATIONS = 15
_STEP_M, _STEP_RAD = 5e-4, 2e-4


#: Beside the odometry's noise, now and then a wheel slips: so far (m, rad), with this log probability per scan.
_SLIP_M, _SLIP_RAD, _SLIP_LOG = 0.2, 0.2, -5.0
#: The search after it: window and steps (m, rad), every so-manieth beam, and by how much its share must be better.
_WINDOW, _STEPS, _EVERY, _BETTER = (0.5, 0.5), (0.15, 0.07), 3, 0.05


@njit(cache=True, parallel=True)
def match_all(
    directory: Ints,
    squared: Bytes,
    metres: Floats,
    frame: Floats,
    points: Floats,
    starts: Floats,
    priors: Floats,
    precision: Floats,
    sigma: float,
    temperature: float,
    poor_share: float,
    occupancy_directory: Ints,
    occupancy: Bytes,
    poses: Floats,
    hessians: Floats,
    results: Floats,
) -> None:
    """Match ``points`` (M, 2) in each map n from ``starts[n]``; ``priors`` (N, 3) with ``precision`` (N, 3, 3), world
    frame.

    Writes ``poses`` (N, 3), ``hessians`` (N, 3, 3) of the total cost there and ``results`` (N, 3). Where a smaller
    share of the beams than ``poor_share`` fits what the map knows, it is tried whether the odometry jumped.
    """
    costs = np.log(1.0 + (metres / sigma) ** 2)
    line = queue(len(starts))
    for begin in prange(len(starts)):
        n = take(line, begin)
        while n < len(starts):
            match(
                directory[n], squared, metres, frame, points, starts[n], priors[n], precision[n], sigma, temperature,
                poses[n], hessians[n], results[n],
            )  # fmt: skip
            if results[n, SHARE] < poor_share:
                near, free = agreement(
                    occupancy_directory[n], occupancy, directory[n], squared, metres, frame, points, poses[n],
                    2.0 * sigma,
                )  # fmt: skip
                if near < poor_share * (near + free):
                    _match_after_slip(
                        directory[n], squared, metres, frame, points, priors[n], precision[n], sigma, temperature,
                        costs, poses[n], hessians[n], results[n],
                    )  # fmt: skip
            n = take(line, n)


@njit(cache=True)
def _match_after_slip(
    directory: Ints,
    squared: Bytes,
    metres: Floats,
    frame: Floats,
    points: Floats,
    prior: Floats,
    precision: Floats,
    sigma: float,
    temperature: float,
    costs: Floats,
    pose: Floats,
    hessian: Floats,
    result: Floats,
) -> None:
    found, slipped, curvature = np.empty(3), np.empty(3), np.empty((3, 3))
    outcome = np.empty(3)
    few = points[::_EVERY].copy()
    search(directory, squared, costs, frame, few, prior, np.array(_WINDOW), np.array(_STEPS), found)
    loose = np.linalg.inv(np.linalg.inv(precision) + np.diag(np.array([_SLIP_M**2, _SLIP_M**2, _SLIP_RAD**2])))
    match(
        directory, squared, metres, frame, points, found, prior, loose, sigma, temperature, slipped, curvature, outcome
    )
    if outcome[SHARE] > result[SHARE] + _BETTER:
        pose[:] = slipped
        hessian[:] = curvature
        result[:] = outcome
        result[TOTAL] -= _SLIP_LOG


@njit(cache=True)
def match(
    directory: Ints,
    squared: Bytes,
    metres: Floats,
    frame: Floats,
    points: Floats,
    start: Floats,
    prior: Floats,
    precision: Floats,
    sigma: float,
    temperature: float,
    pose: Floats,
    hessian: Floats,
    result: Floats,
) -> None:
    """One map of `match_all`."""
    gradient, tried_gradient = np.empty(3), np.empty(3)
    tried_hessian, tried = np.empty((3, 3)), np.empty(3)
    step = np.empty(3)
    pose[:] = start
    field = (directory, squared, metres, frame)
    total = linearise(*field, points, pose, prior, precision, sigma, temperature, hessian, gradient, result)
    damping = 1e-3
    for _ in range(_ITERATIONS):
        solve(hessian, gradient, damping, step)
        tried[0], tried[1], tried[2] = pose[0] - step[0], pose[1] - step[1], wrap(pose[2] - step[2])
        cost = linearise(
            *field, points, tried, prior, precision, sigma, temperature, tried_hessian, tried_gradient, result
        )
        if cost < total:
            total = cost
            pose[:] = tried
            hessian[:] = tried_hessian
            gradient[:] = tried_gradient
            damping = max(damping * 0.2, 1e-6)
            if math.hypot(step[0], step[1]) < _STEP_M and abs(step[2]) < _STEP_RAD:
                break
        else:
            damping = max(damping, 1e-3) * 10.0
            if math.hypot(step[0], step[1]) < _STEP_M and abs(step[2]) < _STEP_RAD:
                break
    linearise(*field, points, pose, prior, precision, sigma, temperature, hessian, gradient, result)


@njit(cache=True, parallel=True)
def curvatures(
    directory: Ints,
    squared: Bytes,
    metres: Floats,
    frame: Floats,
    which: Ints,
    points: Floats,
    lengths: Ints,
    poses: Floats,
    precision: Floats,
    sigma: float,
    hessians: Floats,
) -> None:
    """``hessians`` (A, 3, 3) of the cost of scans (A, M, 2), of which the first ``lengths`` (A,) points count, at
    ``poses`` (A, 3) in maps ``which`` (A,), with priors of ``precision`` (A, 3, 3) just there."""
    line = queue(len(which))
    for begin in prange(len(which)):
        a = take(line, begin)
        while a < len(which):
            gradient, result = np.empty(3), np.empty(3)
            linearise(
                directory[which[a]], squared, metres, frame, points[a, : lengths[a]], poses[a], poses[a], precision[a],
                sigma, 1.0, hessians[a], gradient, result,
            )  # fmt: skip
            a = take(line, a)


@njit(cache=True)
def linearise(
    directory: Ints,
    squared: Bytes,
    metres: Floats,
    frame: Floats,
    points: Floats,
    pose: Floats,
    prior: Floats,
    precision: Floats,
    sigma: float,
    temperature: float,
    hessian: Floats,
    gradient: Floats,
    result: Floats,
) -> float:
    """Total cost at ``pose``; its ``gradient`` (3,), Gauss-Newton ``hessian`` (3, 3) and ``result`` (3,) are
    written."""
    cosine, sine = math.cos(pose[2]), math.sin(pose[2])
    scale = frame[2]
    x0, y0 = (pose[0] - frame[0]) * scale, (pose[1] - frame[1]) * scale
    inverse = 1.0 / (sigma * sigma)
    cost, near = 0.0, 0
    hxx, hxy, hxt, hyy, hyt, htt = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    gx, gy, gt = 0.0, 0.0, 0.0
    product = 1.0
    for m in range(len(points)):
        px, py = points[m, 0], points[m, 1]
        rx, ry = cosine * px - sine * py, sine * px + cosine * py
        distance, jx, jy = field_at(directory, squared, metres, scale, x0 + rx * scale, y0 + ry * scale)
        spread = 1.0 + distance * distance * inverse
        product *= spread
        if product > 1e200:
            cost += math.log(product)
            product = 1.0
        near += distance < 2.0 * sigma
        if jx == 0.0 and jy == 0.0:
            continue
        weight = 2.0 * inverse / spread
        jt = jy * rx - jx * ry
        pull = weight * distance
        gx += pull * jx
        gy += pull * jy
        gt += pull * jt
        hxx += weight * jx * jx
        hxy += weight * jx * jy
        hxt += weight * jx * jt
        hyy += weight * jy * jy
        hyt += weight * jy * jt
        htt += weight * jt * jt
    cost += math.log(product)
    share = 1.0 / temperature
    cost *= share
    hessian[0, 0], hessian[0, 1], hessian[0, 2] = hxx * share, hxy * share, hxt * share
    hessian[1, 0], hessian[1, 1], hessian[1, 2] = hxy * share, hyy * share, hyt * share
    hessian[2, 0], hessian[2, 1], hessian[2, 2] = hxt * share, hyt * share, htt * share
    gradient[0], gradient[1], gradient[2] = gx * share, gy * share, gt * share
    dx, dy, dt = pose[0] - prior[0], pose[1] - prior[1], wrap(pose[2] - prior[2])
    total = cost
    for i in range(3):
        pulled = precision[i, 0] * dx + precision[i, 1] * dy + precision[i, 2] * dt
        total += 0.5 * pulled * (dx if i == 0 else dy if i == 1 else dt)
        gradient[i] += pulled
        for j in range(3):
            hessian[i, j] += precision[i, j]
    result[COST], result[TOTAL], result[SHARE] = cost, total, near / max(1, len(points))
    return total


@njit(cache=True)
def solve(matrix: Floats, right: Floats, damping: float, solution: Floats) -> None:
    """(matrix + damping * its diagonal) solution = right, 3 x 3, symmetric, by Cramer's rule."""
    a, b, c = matrix[0, 0] * (1.0 + damping), matrix[0, 1], matrix[0, 2]
    d, e = matrix[1, 1] * (1.0 + damping), matrix[1, 2]
    f = matrix[2, 2] * (1.0 + damping)
    ca, cb, cc = d * f - e * e, c * e - b * f, b * e - c * d
    determinant = a * ca + b * cb + c * cc
    if determinant <= 0.0:
        solution[:] = 0.0
        return
    cd, ce, cf = a * f - c * c, b * c - a * e, a * d - b * b
    solution[0] = (ca * right[0] + cb * right[1] + cc * right[2]) / determinant
    solution[1] = (cb * right[0] + cd * right[1] + ce * right[2]) / determinant
    solution[2] = (cc * right[0] + ce * right[1] + cf * right[2]) / determinant
