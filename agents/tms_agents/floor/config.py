"""Configuration of ``tms agent floor``; examples for every device are in ``examples`` beside this file."""

from __future__ import annotations

import contextlib
from dataclasses import fields
from pathlib import Path
from typing import Annotated, Any

from pydantic import Field, ValidationInfo, create_model, field_validator

from tms_agents.config import AgentConfig, LocalPath, Seconds, Section, misplaced, need_names_of_their_own
from tms_agents.floor.polygons import fault_of
from tms_agents.floor.settings import FloorSettings, Pose, Scene
from tms_agents.floor.sources import LaserSource
from tms_agents.running import Heartbeat
from tms_schemas.base import Metres, Polygon, Xy

#: Names become parts of messages and tables.
Short = Annotated[str, Field(pattern=r"^[^\x00-\x1f\"]{1,64}$")]
_Length = Annotated[float, Field(gt=0, le=100)]
#: A robot that is larger was measured in centimetres.
_Footprint = Annotated[float, Field(gt=0, le=5)]


class PoseSection(Section):
    """Where a laser is in the room, metres, and where its 0 degrees look to, radians counter-clockwise from x."""

    x: Metres
    y: Metres
    theta: Annotated[float, Field(ge=-6.2832, le=6.2832)] = 0.0

    @property
    def pose(self) -> Pose:
        return (self.x, self.y, self.theta)


class LaserSection(Section):
    """A laser range finder; ``pose`` by ruler, which ``tms floor calibrate`` makes better.

    ``upside_down``: mounted with its top to the floor, so that it sweeps clockwise.
    """

    name: Short = "laser"
    source: LaserSource
    pose: PoseSection
    upside_down: bool = False
    #: What is farther than this is not used.
    range_max_m: _Length | None = None
    #: What it measures times this is how far it is; default: as calibrated, or as the walls of the region tell.
    range_scale: Annotated[float, Field(gt=0.9, lt=1.1)] | None = None


class SceneSection(Section):
    """What is known of the room (``Scene``), in metres; everything may be left out."""

    region: Polygon | None = None
    #: Where people come in and go out.
    gates: Annotated[list[Polygon], Field(max_length=50)] = []
    #: Known furniture that is ignored, and what moves without being anybody.
    masks: Annotated[list[Polygon], Field(max_length=200)] = []
    #: Bed, chair: people are out of sight there without having left.
    seats: Annotated[list[Polygon], Field(max_length=50)] = []
    mirrors: Annotated[list[tuple[Xy, Xy]], Field(max_length=10)] = []

    @field_validator("gates", "masks", "seats", "mirrors", mode="before")
    @classmethod
    def _several(cls, value: Any, info: ValidationInfo) -> Any:
        """One where a list of them is wanted is a slip with a bewildering message."""
        with contextlib.suppress(TypeError, LookupError):
            if isinstance(value[0][0], int | float):
                raise ValueError(f"a list of {info.field_name} is wanted, this is a single one: put [ ] around it")
        return value

    @field_validator("*", mode="after")
    @classmethod
    def _possible(cls, value: Any, info: ValidationInfo) -> Any:
        polygons = [] if info.field_name == "mirrors" else [value] if info.field_name == "region" else value
        for number, one in enumerate(polygons):
            if one is not None and (fault := fault_of(one)):
                raise ValueError(fault) if info.field_name == "region" else misplaced((number,), fault)
        Scene(**{str(info.field_name): value})
        return value


class RobotSection(Section):
    """A robot's footprint as the laser sees it, metres. Robots report themselves; ``report``: this agent does, too."""

    width: _Footprint
    length: _Footprint
    report: bool = False


class RecordingSection(Section):
    """Record every scan into ``path`` (NAME.scans); full, it becomes NAME.scans.old and a new one begins."""

    path: LocalPath
    max_mb: Annotated[float, Field(ge=1, le=1e6)] = 1000.0

    @field_validator("path")
    @classmethod
    def _named(cls, value: Path) -> Path:
        if value.suffix != ".scans":
            raise ValueError("the name of a recording ends in .scans")
        return value


class FloorConfig(AgentConfig):
    lasers: Annotated[list[LaserSection], Field(min_length=1, max_length=16)]
    scene: SceneSection = SceneSection()
    robots: Annotated[list[RobotSection], Field(max_length=16)] = []
    estimator: dict[str, float] = {}
    #: A mover's place is told after this way or this time, whichever is first, and where it came to rest.
    report_m: Annotated[float, Field(ge=0.02, le=10)] = 0.25
    report_s: Seconds = 0.5
    recording: RecordingSection | None = None
    #: Where ``tms floor calibrate`` writes; default: NAME.calibration.toml beside the configuration NAME.toml.
    calibration: LocalPath | None = None
    #: A laser is called silent when no scan came for this long.
    silent_after_s: Seconds = 1.0
    #: The state of the devices is posted again this often, so that a quiet agent is not taken for a dead one.
    heartbeat_s: Heartbeat = 10.0

    @field_validator("lasers")
    @classmethod
    def _named(cls, value: list[LaserSection]) -> list[LaserSection]:
        need_names_of_their_own("laser", [one.name for one in value])
        for number, one in enumerate(value):
            for other in value[:number]:
                if one.source.place == other.source.place:
                    raise misplaced((number, "source"), f"laser {other.name!r} is at {one.source.place} already")
        return value

    @field_validator("estimator")
    @classmethod
    def _known(cls, value: dict[str, float]) -> dict[str, float]:
        _Settings.model_validate(value)
        return value

    def room_scene(self) -> Scene:
        one = self.scene
        return Scene(
            region=one.region,
            gates=tuple(one.gates),
            masks=tuple(one.masks),
            seats=tuple(one.seats),
            mirrors=tuple(one.mirrors),
            robots=tuple((robot.width, robot.length) for robot in self.robots),
        )

    def settings(self) -> FloorSettings:
        tuned = _Settings.model_validate(self.estimator).model_dump(exclude_unset=True)
        return FloorSettings(**tuned)

    @property
    def upside_down(self) -> frozenset[str]:
        """The lasers that are mounted so."""
        return frozenset(one.name for one in self.lasers if one.upside_down)

    @property
    def tells_robots(self) -> bool:
        return any(robot.report for robot in self.robots)

    def calibration_path(self, config: Path) -> Path:
        return self.calibration or config.resolve().with_name(f"{config.stem}.calibration.toml")


#: Of ``[estimator]``: the numbers among FloorSettings.
_Settings: type[Section] = create_model(  # type: ignore[call-overload]
    "_Settings",
    __base__=Section,
    **{one.name: (Annotated[float, Field(gt=0)], getattr(FloorSettings(), one.name)) for one in fields(FloorSettings)},
)
