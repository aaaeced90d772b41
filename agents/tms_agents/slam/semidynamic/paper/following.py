"""A whole drive through the paper's filters: detections in order of time, the grid rewritten as they converge."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from tms_agents.slam.geometry import Floats, compose, transform, wrapped
from tms_agents.slam.gridmap import GridMap
from tms_agents.slam.keyframes import key_scans
from tms_agents.slam.logs import Log, odometry_at
from tms_agents.slam.semidynamic.choosing import SAME_M, SAME_RAD
from tms_agents.slam.semidynamic.models import Models, ObjectModel
from tms_agents.slam.semidynamic.paper.grid import RewrittenGrid
from tms_agents.slam.semidynamic.paper.tagfilter import PaperSettings, TagFilter
from tms_agents.slam.semidynamic.reads import Rounds
from tms_agents.slam.semidynamic.shapes import surface
from tms_agents.slam.semidynamic.solving import Stay
from tms_agents.slam.semidynamic.visits import visits_of

#: Scans that are written: one every so much (m, rad).
_STEP_M, _STEP_RAD = 0.1, 0.1


@dataclass(frozen=True, slots=True, eq=False)
class Followed:
    """``stays`` by tag of the visits at whose end the particles had converged; ``seconds`` (U,) each update took, the
    rewriting of the grid included."""

    stays: Mapping[str, Sequence[Stay]]
    grid: GridMap
    seconds: Floats


def follow(
    log: Log,
    poses: Floats,
    rounds: Rounds,
    models: Models,
    settings: PaperSettings,
    seed: int,
    resolution: float,
    clock: Callable[[], float] = time.process_time,
) -> Followed:
    """Objects and grid, given the path (S, 3) at the scans."""
    round_poses = odometry_at(log.t, poses, rounds.t)
    visits = {tag: visits_of(tag, rounds, round_poses, log.t, poses) for tag in sorted(models.objects)}
    due = sorted(
        (int(number), rank, tag, k)
        for rank, (tag, found) in enumerate(visits.items())
        for k, visit in enumerate(found)
        for number in visit.rounds[rounds.read(tag)[visit.rounds]]
    )
    grid, seconds = RewrittenGrid(resolution), list[float]()
    filters, drawn = dict[tuple[str, int], TagFilter](), dict[str, Floats]()
    written = iter([*key_scans(log, _STEP_M, _STEP_RAD), len(log)])
    waiting = next(written)
    for number, rank, tag, k in due:
        n = max(int(np.searchsorted(log.t, rounds.t[number], side="right")) - 1, 0)
        while waiting <= n:
            grid.write(poses[waiting], log.points(waiting), log.laser[:2])
            waiting = next(written)
        began = clock()
        if (tag, k) not in filters:
            random = np.random.default_rng([seed, rank, k])
            filters[tag, k] = TagFilter(models.objects[tag], settings, random)
        one, antenna = filters[tag, k], models.antennas[int(rounds.antenna[number])]
        one.update(antenna, compose(round_poses[number], antenna.pose), poses[n], log.laser, _beams(log, n), grid)
        if one.pose is not None:
            _redraw(grid, drawn, tag, models.objects[tag], one.pose)
        seconds.append(clock() - began)
    while waiting < len(log):
        grid.write(poses[waiting], log.points(waiting), log.laser[:2])
        waiting = next(written)
    stays: dict[str, list[Stay]] = {}
    for (tag, k), one in sorted(filters.items(), key=lambda item: item[0]):
        if one.pose is not None:
            stays.setdefault(tag, []).append(Stay(visits[tag][k], object_pose(models.objects[tag], one.pose)))
    return Followed(stays, grid.finished(), np.array(seconds))


def object_pose(model: ObjectModel, tag: Floats) -> Floats:
    """(3,) of the object whose tag is at ``tag`` (3,)."""
    turn = wrapped(tag[2] - model.tag[2])
    return np.array([*transform(np.array([tag[0], tag[1], turn]), -model.tag[None, :2])[0], turn])


def _beams(log: Log, n: int) -> Floats:
    """(B, 2) angle, and range or 0 where nothing came back."""
    return np.column_stack([log.angles, np.where(log.returned(n), log.ranges[n], 0.0)])


def _redraw(grid: RewrittenGrid, drawn: dict[str, Floats], tag: str, model: ObjectModel, tag_pose: Floats) -> None:
    pose = object_pose(model, tag_pose)
    before = drawn.get(tag)
    if before is not None:
        off = pose - before
        if np.hypot(off[0], off[1]) < SAME_M and abs(wrapped(off[2])) < SAME_RAD:
            return
    grid.move(None if before is None else surface(model, before), surface(model, pose))
    drawn[tag] = pose
