"""Configuration of ``tms agent robot``; examples are in ``examples`` beside this file."""

from __future__ import annotations

import math
from typing import Annotated, ClassVar, Literal

from pydantic import Field, model_validator

from tms_agents.config import AgentConfig, LocalPath, Seconds, Section
from tms_agents.floor.sources import LaserSource
from tms_agents.line_config import Line
from tms_agents.readers import ReaderSource, tells_rounds
from tms_agents.running import Heartbeat
from tms_schemas.base import Pose
from tms_schemas.maps import MapId


class LogSource(Section):
    """A recorded drive: a CARMEN log or a recording. ``speed`` 1 is as it was driven, 0 as fast as it can be mapped."""

    kind: Literal["log"] = "log"
    path: LocalPath
    #: File that tells the laser's pose on the robot (default: ``models.json`` beside a recording).
    models: LocalPath | None = None
    speed: Annotated[float, Field(ge=0, le=1000)] = 1.0


class BaseSource(Line):
    """A Pioneer (ARCOS, P2OS) that somebody else drives; only its odometry is listened to."""

    kind: Literal["arcos"] = "arcos"
    #: Millimetres per unit of position, where the robot's model is not known to the driver.
    unit_mm: Annotated[float, Field(gt=0, le=100)] | None = None

    default_port: ClassVar[int | None] = 8101


class AntennaSection(Section):
    """An antenna of the tag reader, with its range and half beam as the data sheet has them."""

    number: Annotated[int, Field(ge=0, le=65535)]
    #: On the robot: x ahead, y to the left (m), and where it looks (rad).
    pose: Pose
    range_m: Annotated[float, Field(gt=0, lt=50)] = 2.0
    half_beam_deg: Annotated[float, Field(gt=0, le=180)] = 60.0

    @property
    def half_beam_rad(self) -> float:
        return math.radians(self.half_beam_deg)


class LiveSource(Section):
    """The devices of a robot: laser, wheels, and a tag reader that tells the ends of its rounds."""

    laser: LaserSource
    #: On the robot: x ahead, y to the left of the middle of its axle (m), and where its 0 degrees look to (rad).
    laser_pose: Pose = (0.0, 0.0, 0.0)
    upside_down: bool = False
    #: What is farther than this is not used.
    range_max_m: Annotated[float, Field(gt=0, le=100)] | None = None
    base: BaseSource
    reader: ReaderSource
    antennas: Annotated[list[AntennaSection], Field(min_length=1, max_length=16)]
    #: A device is called silent when nothing came for this long.
    silent_after_s: Seconds = 2.0

    @model_validator(mode="after")
    def _rounds(self) -> LiveSource:
        if not tells_rounds(self.reader):
            raise ValueError("reader: what is not read is evidence, too; choose a reader and a mode that tell rounds")
        numbers = [one.number for one in self.antennas]
        if len(set(numbers)) != len(numbers):
            raise ValueError("antennas: a number occurs twice")
        return self


class MapSection(Section):
    """The map that the robot makes, ``every_s`` sent to the server where it changed."""

    id: MapId
    #: Where the robot is in the room when the drive begins; without it the map is made, and no pose is told.
    start: Pose | None = None
    every_s: Seconds = 5.0
    #: Default: 0.05, with objects 0.02.
    resolution: Annotated[float, Field(ge=0.01, le=0.5)] | None = None
    particles: Annotated[int, Field(ge=1, le=10_000)] = 30
    seed: Annotated[int, Field(ge=0)] = 0


class ObjectsSection(Section):
    """Tagged things that are moved now and then are mapped, too (SLAM-SD); their shapes come from the server."""

    #: A robot that has stood still for so long is parked: things may be moved then.
    parked_s: Seconds = 20.0
    #: The server's map goes on, from where the robot was when the agent ended (it must not be moved while it is off);
    #: without a map, or not knowing where it was, ``map.start`` counts. False: the map is made anew.
    continues: bool = False
    #: Everything since the beginning is estimated anew each time; more scans than these are not taken.
    most_scans: Annotated[int, Field(ge=100, le=200_000)] = 20_000


class RobotConfig(AgentConfig):
    source: LogSource | None = None
    live: LiveSource | None = None
    map: MapSection
    objects: ObjectsSection | None = None
    #: The state of the source is posted again this often, so that a robot that stands is not taken for a dead one.
    heartbeat_s: Heartbeat = 10.0

    @model_validator(mode="after")
    def _one_source(self) -> RobotConfig:
        if (self.source is None) == (self.live is None):
            raise ValueError("give either source (a recorded drive) or live (devices)")
        if self.live is not None and self.objects is None:
            raise ValueError("live: devices are mapped with objects; add an [objects] section")
        if self.source is not None and self.objects is not None:
            name = self.source.path.name.removesuffix(".gz")
            if not name.endswith(".jsonl"):
                raise ValueError("source.path: tag reads are in recordings only (.jsonl or .jsonl.gz)")
        return self

    @property
    def resolution(self) -> float:
        """Metres per cell."""
        return self.map.resolution or (0.05 if self.objects is None else 0.02)
