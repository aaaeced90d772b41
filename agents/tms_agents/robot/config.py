"""Configuration of ``tms agent robot``; an example is in ``examples`` beside this file."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from tms_agents.config import AgentConfig, LocalPath, Seconds, Section
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


class MapSection(Section):
    """The map that the robot makes, ``every_s`` sent to the server where it changed."""

    id: MapId
    #: Where the robot is in the room when the drive begins; without it the map is made, and no pose is told.
    start: Pose | None = None
    every_s: Seconds = 5.0
    resolution: Annotated[float, Field(ge=0.01, le=0.5)] = 0.05
    particles: Annotated[int, Field(ge=1, le=10_000)] = 30
    seed: Annotated[int, Field(ge=0)] = 0


class RobotConfig(AgentConfig):
    source: LogSource
    map: MapSection
    #: The state of the source is posted again this often, so that a robot that stands is not taken for a dead one.
    heartbeat_s: Heartbeat = 10.0
