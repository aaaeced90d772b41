"""Places where the filter's path tore: a particle that came back to a known corridor a little off jumped onto its map.

Each jump that odometry does not bear out is measured anew against the scans just before it: either the wheels slipped,
then the filter was right, or it was lured by an older part of the map, then the step of the odometry fits better.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from tms_agents.slam.agreement import agreement
from tms_agents.slam.geometry import Floats, between, compose, wrapped
from tms_agents.slam.gridmap import render
from tms_agents.slam.keyframes import KeyScans
from tms_agents.slam.light.mending import step_by_light
from tms_agents.slam.light.scans import LightScan
from tms_agents.slam.matching import match
from tms_agents.slam.settings import Settings

#: A step is a jump if it is so many standard deviations of the odometry off.
_DEVIATIONS = 5.0
#: It is measured against so many key scans before it; the odometry has to explain so much more of the points.
_BEFORE, _CLEARLY = 8, 0.05


def mended(path: Floats, keys: KeyScans, settings: Settings, lights: Sequence[LightScan] | None = None) -> Floats:
    """``path`` (K, 3) with its jumps taken back where the scans before contradict them; what follows moves along."""
    steps, motions = between(path[:-1], path[1:]), between(keys.odometry[:-1], keys.odometry[1:])
    off = steps - motions
    off[:, 2] = wrapped(off[:, 2])
    noise = settings.noise.covariance(motions, np.diff(keys.driven, axis=0))
    deviations = np.sqrt(np.einsum("ki,kij,kj->k", off, np.linalg.inv(noise), off))
    if not (deviations > _DEVIATIONS).any():
        return path
    found = path[:1]
    for k, step in enumerate(steps):
        if deviations[k] > _DEVIATIONS:
            first = max(0, k - _BEFORE + 1)
            step = _better_step(
                between(found[k][None], found[first : k + 1]), keys.scans[first : k + 1], keys.scans[k + 1], keys.laser,
                settings, step, motions[k], np.linalg.inv(noise[k]), None if lights is None else lights[first : k + 2],
            )  # fmt: skip
        found = np.concatenate([found, compose(found[-1], step)[None]])
    return found


def _better_step(
    poses: Floats,
    before: Sequence[Floats],
    points: Floats,
    laser: Floats,
    settings: Settings,
    step: Floats,
    motion: Floats,
    precision: Floats,
    lights: Sequence[LightScan] | None,
) -> Floats:
    """``step`` (3,), or the match near odometry's ``motion`` if the scans ``before`` bear that out clearly better."""
    maps = render(poses, before, laser, settings.resolution, settings.reach_m)
    if lights is not None:
        decided = step_by_light(maps, poses, lights[:-1], points, lights[-1], step, motion, precision, settings)
        if decided is not None:
            return decided
    pose, hessian, result = np.empty(3), np.empty((3, 3)), np.empty(3)
    match(
        maps.distance.directory[0], maps.distance.cells, maps.metres, maps.frame, points, motion, motion, precision,
        settings.sigma_m, 1.0, pose, hessian, result,
    )  # fmt: skip
    off = pose - motion
    if off @ precision @ off > _DEVIATIONS**2:
        return step
    agreed = []
    for one in (step, pose):
        near, free = agreement(
            maps.occupancy.directory[0], maps.occupancy.cells, maps.distance.directory[0], maps.distance.cells,
            maps.metres, maps.frame, points, one, 2.0 * settings.sigma_m,
        )  # fmt: skip
        agreed.append(near - free)
    return pose if agreed[1] > agreed[0] + _CLEARLY * len(points) else step
