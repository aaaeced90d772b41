"""From a recording with tag reads to a path, a map and the poses of everything that is moved now and then (SLAM-SD)."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from tms_agents.slam.geometry import Floats, between
from tms_agents.slam.gridmap import GridMap
from tms_agents.slam.logs import Log, odometry_at
from tms_agents.slam.mapping import Progress, build_map
from tms_agents.slam.polishing import polish
from tms_agents.slam.semidynamic.drawing import draw
from tms_agents.slam.semidynamic.models import Models
from tms_agents.slam.semidynamic.paper import PaperSettings, follow
from tms_agents.slam.semidynamic.reads import Rounds
from tms_agents.slam.semidynamic.solving import Stay, solve
from tms_agents.slam.settings import Settings

#: Cells of the map (m).
RESOLUTION_M = 0.02


@dataclass(frozen=True, slots=True, eq=False)
class Semidynamic:
    """``poses`` (S, 3) of the robot at all scans, the first one at the origin; stays by tag, in order of time; the
    map as it is at the end, objects drawn where they stand."""

    poses: Floats
    stays: Mapping[str, Sequence[Stay]]
    grid: GridMap


def map_with_objects(
    log: Log,
    rounds: Rounds,
    models: Models,
    settings: Settings,
    resolution: float = RESOLUTION_M,
    progress: Callable[[Progress], None] = lambda _: None,
    paper: PaperSettings | None = None,
) -> Semidynamic:
    """The mapper's path, polished; the objects, given that path; the map without what has gone.

    With ``paper`` objects and map as the paper has them: particles per detected tag, a grid that is rewritten."""
    poses = robot_path(log, settings, progress)
    if paper is not None:
        found = follow(log, poses, rounds, models, paper, settings.seed, resolution)
        return Semidynamic(poses, found.stays, found.grid)
    stays = solve(log, poses, rounds, odometry_at(log.t, poses, rounds.t), models, settings.seed)
    return Semidynamic(poses, stays, draw(log, poses, stays, models, resolution))


def robot_path(log: Log, settings: Settings, progress: Callable[[Progress], None] = lambda _: None) -> Floats:
    """(S, 3) the mapper's path, polished, the first pose at the origin."""
    poses = polish(log, build_map(log, settings, progress).poses, settings.noise)
    return between(poses[:1], poses)
