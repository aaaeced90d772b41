"""From a log to a trajectory and a map: the stages in their order."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from tms_agents.slam.backend import Closed, close_loops
from tms_agents.slam.filter import ParticleFilter
from tms_agents.slam.geometry import Floats
from tms_agents.slam.gridmap import GridMap, grid_map, render
from tms_agents.slam.keyframes import Indices, KeyScans, key_scans, poses_of_all
from tms_agents.slam.light.gridlight import GridLight, grid_light
from tms_agents.slam.light.scans import calibrated, contrast, light_scans
from tms_agents.slam.logs import Log
from tms_agents.slam.people import Mask
from tms_agents.slam.settings import Settings
from tms_agents.slam.witnesses import people_by_odometry, people_by_path


@dataclass(frozen=True, slots=True)
class Progress:
    """After scan ``done`` of ``of`` scans to process; ``real_time`` is time driven over time worked."""

    done: int
    of: int
    particles: int
    effective: float
    real_time: float


@dataclass(frozen=True, slots=True, eq=False)
class Result:
    """``poses`` (S, 3) of all scans, the first one at the origin; ``keys`` (K,) are those that were processed,
    ``filtered`` (K, 3) is the path of the filter's best particle there, before loops were closed.

    ``light`` is that of the grid's cells, if the drive was mapped with it, and ``contrast`` how far it scattered in
    comparison with its noise. ``filter_seconds`` and ``backend_seconds`` are CPU time of this process.
    """

    poses: Floats
    keys: Indices
    filtered: Floats
    grid: GridMap
    closed: Closed
    resamplings: int
    filter_seconds: float
    backend_seconds: float
    light: GridLight | None = None
    contrast: float | None = None


def build_map(
    log: Log,
    settings: Settings,
    progress: Callable[[Progress], None] = lambda _: None,
    watch: Callable[[ParticleFilter], None] = lambda _: None,
    *,
    light: bool = False,
) -> Result:
    """The filter over all key scans, then loop closing over the best path, then the map of the final path.

    ``watch`` may look at the filter after each scan.

    Raises:
        LightError: with ``light``, if the log holds none.
    """
    keys = key_scans(log, settings.step_m, settings.step_rad)
    lights = light_scans(log, keys, calibrated(log)) if light else None
    scans = [log.points(int(n)) for n in keys]
    began, began_cpu = time.perf_counter(), time.process_time()
    still = _others(scans, people_by_odometry(log, keys, scans, settings.noise)) if settings.people else scans
    particles = ParticleFilter(settings, log.laser, light=light)
    for k, n in enumerate(keys):
        particles.process(log.odometry[n], log.driven[n], still[k], None if lights is None else lights[k])
        spent = max(1e-9, time.perf_counter() - began)
        real_time = float(log.t[n] - log.t[0]) / spent
        progress(Progress(k + 1, len(keys), len(particles.poses), particles.effective, real_time))
        watch(particles)
    filtered_cpu = time.process_time()
    path, resamplings = particles.path(), particles.resamplings
    del particles  # its maps are as large as what follows
    if settings.people:
        still = _others(scans, people_by_path(log, keys, scans, path))
    processed = KeyScans(log.odometry[keys], log.driven[keys], still, log.laser[:2])
    closed = close_loops(path, processed, settings, lights)
    maps = render(closed.path, still, log.laser[:2], settings.resolution, settings.reach_m, fields=False)
    poses = poses_of_all(log, keys, closed.path)
    grid = grid_map(maps, 0)
    done_cpu = time.process_time()
    return Result(
        poses,
        keys,
        path,
        grid,
        closed,
        resamplings,
        filtered_cpu - began_cpu,
        done_cpu - filtered_cpu,
        None if lights is None else grid_light(grid, closed.path, lights),
        None if lights is None else contrast(lights),
    )


def _others(scans: Sequence[Floats], people: Sequence[Mask]) -> list[Floats]:
    """``scans`` without the points that are people."""
    return [points[~gone] for points, gone in zip(scans, people, strict=True)]
