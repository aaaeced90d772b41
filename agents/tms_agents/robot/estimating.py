"""One update of SLAM-SD: the estimate over all that was driven so far, for a process of its own."""

from __future__ import annotations

import signal
import time
from dataclasses import dataclass, replace

import numpy as np

from tms_agents.robot.continuing import Before, aligned, merged
from tms_agents.robot.door_states import DoorAngle, door_angle
from tms_agents.slam.geometry import Floats, compose, transform
from tms_agents.slam.logs import Log
from tms_agents.slam.semidynamic import Models, Rounds, Semidynamic, Stay, map_with_objects
from tms_agents.slam.semidynamic.drawing import draw
from tms_agents.slam.semidynamic.outlines import Outlines
from tms_agents.slam.semidynamic.shapes import surface
from tms_agents.slam.settings import Settings

#: Beams that end so near to an object (m) are no wall; of every so many scans they are looked at.
_OWN_M, _EVERY = 0.15, 3


@dataclass(frozen=True, slots=True, eq=False)
class Standing:
    """``pose`` (3,) of an object at its last visit, which ended with scan ``last``; how far a door is open."""

    pose: Floats
    last: int
    door: DoorAngle | None


@dataclass(frozen=True, slots=True, eq=False)
class Update:
    """``poses`` (S, 3) of the robot at the scans; objects by tag; ``occupancy`` (H, W), NaN unknown, and the lower
    left corner of its lowest row (m); seconds of wall and processor time it took."""

    poses: Floats
    objects: dict[str, Standing]
    occupancy: Floats
    origin: tuple[float, float]
    seconds: float
    cpu_seconds: float


@dataclass(frozen=True, slots=True, eq=False)
class Task:
    """What an update is made of; cells of ``resolution`` m; ``before``: the earlier map that goes on."""

    log: Log
    rounds: Rounds
    models: Models
    settings: Settings
    resolution: float
    before: Before | None = None


def prepare() -> None:
    """For the process that estimates: Ctrl-C is for the agent, which ends it."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)


def estimate(task: Task) -> Update:
    """In the frame of the first scan, or of the earlier map. Deterministic by the seed of its settings."""
    began, cpu = time.perf_counter(), time.process_time()
    found = map_with_objects(task.log, task.rounds, task.models, task.settings, task.resolution)
    wall = walls(task.log, found, task.models)
    if task.before is not None:
        base = aligned(task.before, wall)
        found, wall = _seen_from(base, found, task), transform(base, wall)
    objects = {tag: _standing(task, tag, stays[-1], wall) for tag, stays in found.stays.items()}
    occupancy, origin = found.grid.probabilities(), found.grid.origin
    if task.before is not None:
        outlines = {tag: surface(task.models.objects[tag], one.pose) for tag, one in objects.items()}
        occupancy, origin = merged(task.before, found.grid, outlines)
    return Update(found.poses, objects, occupancy, origin, time.perf_counter() - began, time.process_time() - cpu)


def _seen_from(base: Floats, found: Semidynamic, task: Task) -> Semidynamic:
    """``base`` (3,) is where the frame of ``found`` lies; the map is drawn anew, for cells do not turn."""
    poses = compose(base, found.poses)
    stays = {tag: [replace(one, pose=compose(base, one.pose)) for one in all_] for tag, all_ in found.stays.items()}
    return Semidynamic(poses, stays, draw(task.log, poses, stays, task.models, task.resolution))


def _standing(task: Task, tag: str, last: Stay, wall: Floats) -> Standing:
    model = task.models.objects[tag]
    width = float(np.concatenate(model.parts)[:, 0].max())
    scan = int(last.visit.scans[-1]) if len(last.visit.scans) else len(task.log) - 1
    return Standing(last.pose, scan, door_angle(last.pose, width, wall) if model.hinged else None)


def walls(log: Log, found: Semidynamic, models: Models) -> Floats:
    """(M, 2) m where beams ended that met no object."""
    outlines = Outlines(log.t, found.stays, models)
    points = []
    for n in range(0, len(log), _EVERY):
        there = transform(found.poses[n], log.points(n))
        points.append(there[~outlines.own(n, there, _OWN_M)])
    return np.concatenate(points) if points else np.zeros((0, 2))
