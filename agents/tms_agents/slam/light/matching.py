"""Scan matching with geometry and light together.

To the cost of `slam.matching` comes that of light: the difference between what a beam brought back and the light of the
map at its end, in its deviations, through a Cauchy kernel. Its slope counts ALONG the surface alone: across it light
says nothing that geometry does not say better. Slopes that noise could have made count nothing, so where all is of one
colour the match is that of geometry.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit, prange

from tms_agents.slam.geometry import Bytes, Floats, Ints, wrap
from tms_agents.slam.light.layer import Singles, light_at
from tms_agents.slam.matching import COST, TOTAL, linearise, solve
from tms_agents.slam.occupancy import UNKNOWN
from tms_agents.slam.sharing import queue, take
from tms_agents.slam.tiles import MASK, SHIFT

_ITERATIONS = 20
_STEP_M, _STEP_RAD = 5e-4, 2e-4
#: Errors of the calibration and of places between cells, beside the noise of a beam (log intensity).
_FLOOR = 0.06
#: Residuals beyond so many deviations pull less.
_WIDTH = 2.0
#: A place is known if its precision is that of so many beams; a slope has to be so many deviations of its noise.
_KNOWN, _CLEARLY = 0.5, 1.5
#: And steeper than this, log intensity per m: the rest of what the calibration did not explain changes slowly.
_STEEP = 0.6
#: So many cells from a surface on, what lies behind it is another one if the map knows nothing there.
_BEHIND = 1.6
#: Where geometry found the robot farther from the odometry than so many deviations, the wheels slipped.
_SLIPPED = 25.0


@njit(cache=True, parallel=True)
def match_light_all(
    directory: Ints,
    squared: Bytes,
    metres: Floats,
    frame: Floats,
    points: Floats,
    occupancy_directory: Ints,
    occupancy: Bytes,
    light_directory: Ints,
    light_cells: Singles,
    light_frame: Floats,
    beams: Floats,
    priors: Floats,
    precision: Floats,
    sigma: float,
    temperature: float,
    light_temperature: float,
    poses: Floats,
    hessians: Floats,
    results: Floats,
) -> None:
    """Refine ``poses`` (N, 3), found by geometry, in each map n; as `matching.match_all` else.

    ``beams`` (M, 6) is x, y, the tangent's x, y, light and deviation of the beams with light.
    """
    line = queue(len(poses))
    for begin in prange(len(poses)):
        n = take(line, begin)
        while n < len(poses):
            prior, sure = priors[n].copy(), precision[n].copy()
            off = poses[n] - prior
            off[2] = wrap(off[2])
            if off @ sure @ off > _SLIPPED:
                prior, sure = poses[n].copy(), sure / _SLIPPED
            known = _ending_in_the_known(
                directory[n], squared, metres, frame, points, occupancy_directory[n], occupancy, poses[n]
            )
            match_light(
                directory[n], squared, metres, frame, known, light_directory[n], light_cells, light_frame, beams, prior,
                sure, sigma, temperature, light_temperature, poses[n], hessians[n], results[n],
            )  # fmt: skip
            usual = results[n, COST] / max(1, len(known))
            results[n, TOTAL] += usual * (len(points) - len(known))
            n = take(line, n)


@njit(cache=True)
def _ending_in_the_known(
    directory: Ints,
    squared: Bytes,
    metres: Floats,
    frame: Floats,
    points: Floats,
    occupancy_directory: Ints,
    occupancy: Bytes,
    pose: Floats,
) -> Floats:
    """Those of ``points`` (M, 2) about which the map says something, be it that nothing is there.

    The others would pull towards what is known: along a corridor always back to where the robot came from.
    """
    height, width = directory.shape[0] << SHIFT, directory.shape[1] << SHIFT
    cosine, sine = math.cos(pose[2]), math.sin(pose[2])
    kept = np.zeros(len(points), dtype=np.bool_)
    for m in range(len(points)):
        x = math.floor((pose[0] + cosine * points[m, 0] - sine * points[m, 1] - frame[0]) * frame[2])
        y = math.floor((pose[1] + sine * points[m, 0] + cosine * points[m, 1] - frame[1]) * frame[2])
        if not (0 <= x < width and 0 <= y < height):
            continue
        place = ((y & MASK) << SHIFT) | (x & MASK)
        near = metres[squared[directory[y >> SHIFT, x >> SHIFT], place]] * frame[2] < _BEHIND
        kept[m] = near or occupancy[occupancy_directory[y >> SHIFT, x >> SHIFT], place] != UNKNOWN
    return points[kept]


@njit(cache=True)
def match_light(
    directory: Ints,
    squared: Bytes,
    metres: Floats,
    frame: Floats,
    points: Floats,
    light_directory: Ints,
    light_cells: Singles,
    light_frame: Floats,
    beams: Floats,
    prior: Floats,
    precision: Floats,
    sigma: float,
    temperature: float,
    light_temperature: float,
    pose: Floats,
    hessian: Floats,
    result: Floats,
) -> None:
    """One map: ``pose`` (3,) is where it begins and what it finds."""
    field = (directory, squared, metres, frame, points)
    light = (light_directory, light_cells, light_frame, beams, light_temperature)
    gradient, step, tried = np.empty(3), np.empty(3), pose.copy()
    curvature, slope = np.empty((3, 3)), np.empty(3)
    # A beam that ends where no light is known costs as much as another, so that none is drawn to where more is known.
    usual = usual_cost(*light, pose)
    least, damping = np.inf, 1e-3
    for iteration in range(_ITERATIONS + 1):
        total = linearise(*field, tried, prior, precision, sigma, temperature, curvature, slope, result)
        total += linearise_light(*light, usual, tried, curvature, slope)
        if total < least:
            least = total
            pose[:], hessian[:], gradient[:] = tried, curvature, slope
            damping = max(damping * 0.2, 1e-6)
        else:
            damping = max(damping, 1e-3) * 10.0
        if iteration > 0 and math.hypot(step[0], step[1]) < _STEP_M and abs(step[2]) < _STEP_RAD:
            break
        solve(hessian, gradient, damping, step)
        tried[0], tried[1], tried[2] = pose[0] - step[0], pose[1] - step[1], wrap(pose[2] - step[2])
    linearise(*field, pose, prior, precision, sigma, temperature, curvature, slope, result)
    shone = linearise_light(*light, usual, pose, curvature, slope)
    result[COST] += shone
    result[TOTAL] += shone


@njit(cache=True)
def usual_cost(
    directory: Ints, cells: Singles, frame: Floats, beams: Floats, temperature: float, pose: Floats
) -> float:
    """Mean cost of the beams whose light is known at ``pose`` (3,); 0 if there is none."""
    curvature, slope = np.zeros((3, 3)), np.zeros(3)
    without = linearise_light(directory, cells, frame, beams, temperature, 0.0, pose, curvature, slope)
    # What one more per beam costs tells how many beams are unknown.
    unknown = linearise_light(directory, cells, frame, beams, 1.0, 1.0, pose, curvature, slope) - without * temperature
    return without * temperature / max(1.0, len(beams) - unknown)


@njit(cache=True)
def linearise_light(
    directory: Ints,
    cells: Singles,
    frame: Floats,
    beams: Floats,
    temperature: float,
    usual: float,
    pose: Floats,
    hessian: Floats,
    gradient: Floats,
) -> float:
    """Cost of the light at ``pose``; its part is added to ``gradient`` (3,) and ``hessian`` (3, 3).

    A beam costs ``usual`` where no light is known.
    """
    cosine, sine = math.cos(pose[2]), math.sin(pose[2])
    scale = frame[2]
    found = np.empty(3)
    cost = 0.0
    share, width = 1.0 / temperature, 1.0 / (_WIDTH * _WIDTH)
    jacobian = np.empty(3)
    for m in range(len(beams)):
        rx = cosine * beams[m, 0] - sine * beams[m, 1]
        ry = sine * beams[m, 0] + cosine * beams[m, 1]
        known = light_at(directory, cells, (pose[0] + rx - frame[0]) * scale, (pose[1] + ry - frame[1]) * scale, found)
        own = beams[m, 5] * beams[m, 5]
        if known * own < _KNOWN:
            cost += usual
            continue
        variance = own + 1.0 / known + _FLOOR * _FLOOR
        residual = beams[m, 4] - found[0]
        spread = 1.0 + residual * residual / variance * width
        cost += 0.5 * math.log(spread) / width
        tx, ty = cosine * beams[m, 2] - sine * beams[m, 3], sine * beams[m, 2] + cosine * beams[m, 3]
        along = (found[1] * tx + found[2] * ty) * scale
        least = max(_STEEP * _STEEP, _CLEARLY * _CLEARLY * scale * scale / known)
        if along * along < least:
            continue
        weight = share / (variance * spread) * (1.0 - least / (along * along))
        jacobian[0], jacobian[1] = along * tx, along * ty
        jacobian[2] = along * (ty * rx - tx * ry)
        for i in range(3):
            gradient[i] -= weight * residual * jacobian[i]
            for j in range(3):
                hessian[i, j] += weight * jacobian[i] * jacobian[j]
    return cost * share
