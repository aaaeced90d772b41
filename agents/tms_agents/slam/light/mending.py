"""Whether a jump of the path was right, by light: along a corridor geometry fits before and after it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from tms_agents.slam.geometry import Floats, wrapped
from tms_agents.slam.light.closures import correlation, tells
from tms_agents.slam.light.filtering import as_beams
from tms_agents.slam.light.layer import LightMaps
from tms_agents.slam.light.matching import match_light
from tms_agents.slam.light.scans import LightScan
from tms_agents.slam.maps import Maps
from tms_agents.slam.settings import Settings

#: The match near odometry may be so many deviations off, and has to correlate so much better than the jump.
_DEVIATIONS, _BETTER = 5.0, 0.1


def step_by_light(
    maps: Maps,
    poses: Floats,
    before: Sequence[LightScan],
    points: Floats,
    scan: LightScan,
    step: Floats,
    motion: Floats,
    precision: Floats,
    settings: Settings,
) -> Floats | None:
    """``step`` (3,) of the path, or the match near odometry's ``motion`` if the light of the scans ``before``, seen
    from ``poses``, bears that out clearly better; None where there are no colours to tell.

    ``maps`` holds the geometry of the scans before, ``points`` (M, 2) and ``scan`` are what was seen after the step.
    """
    if not tells(scan):
        return None
    light = LightMaps(1, settings.light_m)
    for pose, one in zip(poses, before, strict=True):
        light.integrate(pose[None], one)
    tiles, beams = light.tiles, as_beams(scan)
    found, hessian, result = motion.copy(), np.empty((3, 3)), np.empty(3)
    match_light(
        maps.distance.directory[0], maps.distance.cells, maps.metres, maps.frame, points, tiles.directory[0],
        tiles.cells, light.frame, beams, motion, precision, settings.sigma_m, 1.0, settings.light_temperature, found,
        hessian, result,
    )  # fmt: skip
    off = found - motion
    off[2] = wrapped(off[2])
    if off @ precision @ off > _DEVIATIONS**2:
        return None
    jumped, stayed = (correlation(tiles.directory[0], tiles.cells, light.frame, beams, one)[0] for one in (step, found))
    return found if stayed > jumped + _BETTER else step
