"""When the estimate is made anew, and what it says: of a drive that goes on meanwhile."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime

import numpy as np

from tms_agents.robot.continuing import Before
from tms_agents.robot.estimating import Task, Update
from tms_agents.robot.records import Drive, Pose, Snapshot, placed
from tms_agents.slam.geometry import Floats, compose, inverse
from tms_agents.slam.semidynamic import Antenna, Models, ObjectModel, Rounds
from tms_agents.slam.semidynamic.shapes import surface
from tms_agents.slam.settings import Settings
from tms_schemas.maps import MapObject

#: There is nothing to estimate before the robot has driven so far, nor anew before it has driven that much on (m).
_LEAST_M, _MORE_M = 0.5, 0.2


@dataclass(frozen=True, slots=True, eq=False)
class Robot:
    """What is known of the robot itself: ``laser`` (3,) on it, antennas by number."""

    laser: Floats
    antennas: Mapping[int, Antenna]


@dataclass(frozen=True, slots=True, eq=False)
class Earlier:
    """A map of the server that goes on: its cells (see ``Before``), its objects; ``pose`` (3,) of the robot in it when
    this drive began, about; ``map_to_room`` as the server has it."""

    occupancy: Floats
    origin: tuple[float, float]
    resolution: float
    objects: Sequence[MapObject]
    pose: Floats
    map_to_room: Pose | None

    def before(self, shapes: Mapping[str, ObjectModel]) -> Before:
        """For the estimator, with the outlines of the objects whose shapes are known."""
        outlines = {
            one.tag: surface(shapes[one.tag], np.array([one.x, one.y, one.theta]))
            for one in self.objects
            if one.tag in shapes
        }
        return Before(self.occupancy, self.origin, self.resolution, outlines, self.pose)


class Online:
    """``drive`` takes the records; ``task`` is made where ``due`` says why, ``taken`` tells what came of it.

    Between updates the robot's pose goes on by odometry from the last one.
    """

    def __init__(self, robot: Robot, drive: Drive, settings: Settings, resolution: float, every_s: float) -> None:
        self.drive = drive
        #: The map that goes on.
        self.earlier: Earlier | None = None
        self._robot, self._settings, self._resolution, self._every_s = robot, settings, resolution, every_s
        self._anchor: Floats | None = None
        self._begun_at = -np.inf
        self._begun_m, self._begun = 0.0, (0, False)
        self.updates = 0

    def due(self, now: float) -> str:
        """Why an update should begin now (monotonic s); empty where none should."""
        drive = self.drive
        if drive.driven_m < _LEAST_M:
            return ""
        if drive.parked and self._begun != (drive.legs, True):
            return "parked"
        if drive.driven_m - self._begun_m < _MORE_M:
            return ""
        if drive.fresh:
            return "a tag came into sight"
        return "while driving" if now - self._begun_at >= self._every_s else ""

    def task(self, now: float, shapes: Mapping[str, ObjectModel]) -> tuple[Snapshot, Task] | None:
        """All that is known by now, with the shapes of tagged things; None where there is nothing yet."""
        snapshot = self.drive.snapshot()
        if snapshot is None:
            return None
        self._begun_at, self._begun_m = now, self.drive.driven_m
        self._begun = self.drive.legs, self.drive.parked
        self.drive.fresh.clear()
        rounds = _of_antennas(snapshot.rounds, self._robot.antennas)
        seen = frozenset().union(*rounds.tags)
        models = Models(
            self._robot.laser, self._robot.antennas, {tag: one for tag, one in shapes.items() if tag in seen}
        )
        before = None if self.earlier is None else self.earlier.before(shapes)
        return snapshot, Task(snapshot.log, rounds, models, self._settings, self._resolution, before)

    def taken(self, snapshot: Snapshot, update: Update) -> None:
        self.updates += 1
        self._anchor = compose(update.poses[-1], inverse(snapshot.log.odometry[-1]))

    def pose(self) -> Pose | None:
        """Of the robot in the map's frame now."""
        if self.drive.pose is None:
            return None
        if self._anchor is None:
            begun = np.zeros(3) if self.earlier is None else self.earlier.pose
            self._anchor = compose(begun, inverse(np.array(self.drive.pose)))
        return placed(self._anchor, self.drive.pose)


def map_objects(update: Update, times: Floats, ahead_s: float, earlier: Sequence[MapObject] = ()) -> list[MapObject]:
    """As the server keeps them; ``ahead_s`` is how far Unix time is ahead of the scans' ``times`` (S,). What was not
    seen in this drive stays as it was ``earlier``."""
    found = [one for one in earlier if one.tag not in update.objects]
    for tag, one in sorted(update.objects.items()):
        x, y, theta = (float(value) for value in one.pose)
        found.append(
            MapObject(
                tag=tag,
                x=x,
                y=y,
                theta=theta,
                state=None if one.door is None else one.door.state,
                angle=None if one.door is None else one.door.angle,
                seen_at=datetime.fromtimestamp(float(times[one.last]) + ahead_s, UTC),
            )
        )
    return found


def _of_antennas(rounds: Rounds, antennas: Mapping[int, Antenna]) -> Rounds:
    kept = np.isin(rounds.antenna, list(antennas))
    tags = tuple(tags for tags, keep in zip(rounds.tags, kept, strict=True) if keep)
    return Rounds(rounds.t[kept], rounds.antenna[kept], tags)
