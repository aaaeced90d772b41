"""Methods that the mapper is compared with: the paper's particle filter and (Intensity-)ICP, from log to map."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from tms_agents.slam.backend import Closed
from tms_agents.slam.geometry import Floats
from tms_agents.slam.gridmap import grid_map, render
from tms_agents.slam.keyframes import key_scans, poses_of_all
from tms_agents.slam.light.gridlight import grid_light
from tms_agents.slam.light.icp import Icp
from tms_agents.slam.light.paper import PaperFilter, PaperSettings
from tms_agents.slam.light.scans import calibrated, contrast, light_scans
from tms_agents.slam.logs import Log
from tms_agents.slam.mapping import Progress, Result
from tms_agents.slam.settings import Settings

#: alpha of Intensity-ICP: m^2 for a difference of light as large as that of a usual surface.
ICP_ALPHA = 0.5


def build_compared(
    log: Log, settings: Settings, progress: Callable[[Progress], None] = lambda _: None, *, method: str, light: bool
) -> Result:
    """As `mapping.build_map`, by ``method`` "paper" (always with light) or "icp". No loop is closed afterwards.

    Raises:
        LightError: light is needed, and the log holds none.
    """
    keys = key_scans(log, settings.step_m, settings.step_rad)
    light = light or method == "paper"
    lights = light_scans(log, keys, calibrated(log)) if light else None
    # With light only the beams that have some: points without a surface around them have none that could be compared.
    scans = [log.points(int(n)) for n in keys]
    beams = scans if lights is None else [one.points for one in lights]
    brightness = [np.zeros(len(one)) for one in beams] if lights is None else [np.exp(one.light) for one in lights]
    began, began_cpu = time.perf_counter(), time.process_time()
    paper = PaperFilter(replace(PaperSettings(), particles=settings.particles, seed=settings.seed), settings.noise)
    icp = Icp(ICP_ALPHA if light else 0.0)
    for k, n in enumerate(keys):
        if method == "paper":
            paper.process(log.odometry[n], log.driven[n], beams[k], brightness[k])
        else:
            icp.process(log.odometry[n], beams[k], brightness[k])
        spent = max(1e-9, time.perf_counter() - began)
        effective, number = (paper.effective, settings.particles) if method == "paper" else (1.0, 1)
        progress(Progress(k + 1, len(keys), number, effective, float(log.t[n] - log.t[0]) / spent))
    path: Floats = paper.path() if method == "paper" else np.array(icp.poses)
    done_cpu = time.process_time()
    grid = grid_map(render(path, scans, log.laser[:2], settings.resolution, settings.reach_m), 0)
    return Result(
        poses_of_all(log, keys, path),
        keys,
        path,
        grid,
        Closed(path, 0, 0, 0.0),
        len(keys) - 1 if method == "paper" else 0,
        done_cpu - began_cpu,
        time.process_time() - done_cpu,
        None if lights is None else grid_light(grid, path, lights),
        None if lights is None else contrast(lights),
    )
