"""From a recording with tag reads to a path, a map and the poses of everything that is moved now and then (SLAM-SD)."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tms_agents.slam.geometry import Floats, between, transform
from tms_agents.slam.gridmap import GridMap
from tms_agents.slam.logs import Log, odometry_at
from tms_agents.slam.mapping import Progress, build_map
from tms_agents.slam.polishing import legs_of, polish
from tms_agents.slam.semidynamic.drawing import draw
from tms_agents.slam.semidynamic.models import Models
from tms_agents.slam.semidynamic.outlines import Outlines
from tms_agents.slam.semidynamic.paper import PaperSettings, follow
from tms_agents.slam.semidynamic.reads import Rounds
from tms_agents.slam.semidynamic.solving import Stay, solve
from tms_agents.slam.settings import Settings

#: Cells of the map (m).
RESOLUTION_M = 0.02
#: A path is pulled along where it is so far off (m).
_PULLED_M = 0.08
#: Round by round, points so near to an object are of what may be moved (m): at first it may be misplaced, too.
_MOVABLE_M = (0.7, 0.3, 0.2)


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
    poses, stays = steadied(log, poses, rounds, models, settings)
    return Semidynamic(poses, stays, draw(log, poses, stays, models, resolution))


def robot_path(log: Log, settings: Settings, progress: Callable[[Progress], None] = lambda _: None) -> Floats:
    """(S, 3) the mapper's path, polished, the first pose at the origin."""
    poses = polish(log, build_map(log, settings, progress).poses, settings.noise)
    return between(poses[:1], poses)


def steadied(
    log: Log, poses: Floats, rounds: Rounds, models: Models, settings: Settings
) -> tuple[Floats, dict[str, list[Stay]]]:
    """The path and the objects: where things that were all moved alike pulled ``poses`` (S, 3) along, both are found
    anew, by what cannot be moved."""

    def objects(path: Floats) -> dict[str, list[Stay]]:
        return solve(log, path, rounds, odometry_at(log.t, path, rounds.t), models, settings.seed)

    stays = objects(poses)
    if legs_of(log.t)[-1] == 0:
        # Never parked: of what pulled the path along nothing is known to be of another time.
        return poses, stays
    for within in _MOVABLE_M:
        again = _by_what_stays(log, poses, Outlines(log.t, stays, models), within, settings)
        if float(np.hypot(*(again - poses)[:, :2].T).max()) < _PULLED_M:
            break
        poses, stays = again, objects(again)
    return poses, stays


def _by_what_stays(log: Log, poses: Floats, outlines: Outlines, within: float, settings: Settings) -> Floats:
    def movable(n: int, points: Floats) -> NDArray[np.bool_]:
        return outlines.own(n, transform(poses[n], points), within)

    again = polish(log, poses, settings.noise, movable)
    return between(again[:1], again)
