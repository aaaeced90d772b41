"""Configuration of ``tms agent cabinet``; examples for every device are in ``examples`` beside this file."""

from __future__ import annotations

from dataclasses import asdict, fields
from pathlib import Path
from typing import Annotated, Any

from pydantic import Field, ValidationInfo, create_model, field_validator, model_validator

from tms_agents.cabinet.calibration_file import BoardCalibration
from tms_agents.cabinet.frames import BoardPose
from tms_agents.cabinet.geometry import Geometry, Zone
from tms_agents.cabinet.settings import EstimatorSettings
from tms_agents.cabinet.sources import LoadSection
from tms_agents.config import AgentConfig, LocalPath, Seconds, Section, misplaced, need_names_of_their_own
from tms_agents.readers import CaptureSource, ReaderSource, can_pause
from tms_agents.running import Heartbeat
from tms_schemas.base import Metres, Name, Polygon, Xy

Length = Annotated[float, Field(gt=0, le=100)]
#: Names become parts of messages and tables.
Short = Annotated[str, Field(pattern=r"^[^\x00-\x1f\"]{1,64}$")]


class PoseSection(Section):
    """Where the board's corner (0, 0) is in the room, how the board is turned (radians), how high its surface is."""

    x: Metres
    y: Metres
    theta: Annotated[float, Field(ge=-6.2832, le=6.2832)] = 0.0
    z: Metres | None = None


class BoardSection(Section):
    """One shelf board: what weighs it, where its cells are (metres, board frame), where it is in the room.

    Without ``cells`` the board is one scale: what stands on it is known, where on it is not. ``surface`` is the name
    in the room's description (furniture/surface).
    """

    name: Short
    load: Annotated[list[LoadSection], Field(min_length=1, max_length=16)]
    width: Length
    depth: Length
    cells: Annotated[list[Xy], Field(min_length=3, max_length=36)] | None = None
    pose: PoseSection
    surface: Annotated[str, Field(max_length=129)] | None = None
    #: The device zeroes itself when it is switched on, whatever stands on it. Default: what its kind does.
    zero_at_power_on: bool | None = None
    estimator: dict[str, float] = {}

    @field_validator("load", mode="before")
    @classmethod
    def _one_is_a_list(cls, value: Any) -> Any:
        return [value] if isinstance(value, dict) else value

    @field_validator("estimator")
    @classmethod
    def _known(cls, value: dict[str, float]) -> dict[str, float]:
        _Settings.model_validate(value)
        return value

    @model_validator(mode="after")
    def _possible(self) -> BoardSection:
        delivered = sum(one.cell_count for one in self.load)
        if self.cells is not None and len(self.cells) != delivered:
            raise ValueError(f"{len(self.cells)} cell positions, but load delivers {delivered}")
        if self.cells is None and delivered != 1:
            raise ValueError(f"load delivers {delivered} cells: give their positions as cells")
        self.geometry()
        return self

    @property
    def cell_count(self) -> int:
        return sum(one.cell_count for one in self.load)

    @property
    def zeroes_itself(self) -> bool:
        known = self.zero_at_power_on
        return all(one.zeroes_itself for one in self.load) if known is None else known

    def geometry(self, calibration: BoardCalibration | None = None) -> Geometry:
        """Of the estimator. Raises ValueError where no board is like that."""
        if self.cells is None:
            from tms_agents.cabinet.single import single_geometry

            return single_geometry(self.width, self.depth)
        cells = (calibration and calibration.cells) or self.cells
        return Geometry(tuple((x, y) for x, y in cells), self.width, self.depth)

    def settings(self) -> EstimatorSettings:
        tuned = _Settings.model_validate(self.estimator).model_dump(exclude_unset=True)
        return EstimatorSettings(**tuned, knows_places=self.cells is not None)

    def frame(self) -> BoardPose:
        return BoardPose(self.pose.x, self.pose.y, self.pose.theta, self.pose.z, self.surface)


class ZoneSection(Section):
    """What antennas with this zone's name cover of a board: a polygon (board frame), or all of it."""

    name: Name
    board: Short
    polygon: Polygon | None = None


class ReaderSection(Section):
    """A tag reader; ``zones`` names the zone of each antenna, ``zone`` that of the others (none: ignored).

    ``weigh_s``: the boards in its zones are weighed while the field is off, that long at a time; a reader that cannot
    switch its field off says so. None: the field does not disturb the cells.
    """

    name: Short = "reader"
    source: ReaderSource
    zone: Name | None = None
    zones: dict[Annotated[str, Field(pattern=r"^\d{1,5}$")], Name] = {}
    silent_after_s: Seconds = 3.0
    #: Of a reader that does not tell the end of its rounds: what it reports in this time is one.
    window_s: Seconds = 0.5
    weigh_s: Annotated[float, Field(ge=0.1, le=60)] | None = None

    @field_validator("source")
    @classmethod
    def _alive(cls, value: Any) -> Any:
        if isinstance(value, CaptureSource):
            raise ValueError("a cabinet needs a live reader, not a capture")
        return value

    @model_validator(mode="after")
    def _field(self) -> ReaderSection:
        if self.weigh_s is not None and not can_pause(self.source):
            raise ValueError(f"a {self.source.kind} reader cannot switch its field off for weighing: leave weigh_s out")
        return self

    @property
    def antennas(self) -> dict[int, str]:
        return {int(antenna): zone for antenna, zone in self.zones.items()}

    @property
    def antenna_count(self) -> int:
        """Antennas that take turns, whether they are named here or not."""
        return len(getattr(self.source, "antennas", ())) or 1

    @property
    def zone_names(self) -> set[str]:
        return {*self.zones.values(), *([self.zone] if self.zone else [])}


class WeightsSection(Section):
    """Known weights come from the objects of the room; the last copy is kept beside the spool."""

    refresh_s: Seconds = 60.0
    #: Standard deviation of a weight that has none in the database: the larger of these.
    sd_g: Annotated[float, Field(gt=0, le=1000)] = 3.0
    sd_share: Annotated[float, Field(ge=0, le=1)] = 0.02


class CabinetConfig(AgentConfig):
    boards: Annotated[list[BoardSection], Field(min_length=1, max_length=16)]
    readers: Annotated[list[ReaderSection], Field(max_length=16)] = []
    zones: Annotated[list[ZoneSection], Field(max_length=64)] = []
    #: Where ``tms cabinet calibrate`` writes; default: NAME.calibration.toml beside the configuration NAME.toml.
    calibration: LocalPath | None = None
    weights: WeightsSection = WeightsSection()
    #: A board is called silent when nothing valid came for this long.
    silent_after_s: Seconds = 2.0
    #: The state of the devices is posted again this often, so that a quiet agent is not taken for a dead one.
    heartbeat_s: Heartbeat = 10.0

    @field_validator("boards", "readers")
    @classmethod
    def _named(cls, value: list[Any], info: ValidationInfo) -> list[Any]:
        need_names_of_their_own(str(info.field_name).removesuffix("s"), [one.name for one in value])
        return value

    @model_validator(mode="after")
    def _names_fit(self) -> CabinetConfig:
        boards = {one.name for one in self.boards}
        for number, zone in enumerate(self.zones):
            if zone.board not in boards:
                why = f"there is no board {zone.board!r} (there are {_list(boards)})"
                raise misplaced(("zones", number, "board"), why)
        known = {zone.name for zone in self.zones}
        for number, reader in enumerate(self.readers):
            place = ("readers", number)
            if not reader.zone_names:
                raise misplaced(place, f"reader {reader.name!r} needs zone or zones: what do its antennas cover?")
            if missing := sorted(reader.zone_names - known):
                raise misplaced(place, f"there is no zone {missing[0]!r} (there are {_list(known)})")
        return self

    def board_zones(self, board: str) -> dict[str, Zone]:
        """The zones on a board, for its estimator."""
        return {
            zone.name: Zone(zone.name, None if zone.polygon is None else tuple(zone.polygon))
            for zone in self.zones
            if zone.board == board
        }

    def calibration_path(self, config: Path) -> Path:
        return self.calibration or config.resolve().with_name(f"{config.stem}.calibration.toml")


class _SettingsBase(Section):
    """Of ``[boards.estimator]``: the fields of EstimatorSettings, all of them positive numbers."""


_Settings: type[Section] = create_model(  # type: ignore[call-overload]
    "_Settings",
    __base__=_SettingsBase,
    **{
        one.name: (Annotated[float, Field(ge=0)], asdict(EstimatorSettings())[one.name])
        for one in fields(EstimatorSettings)
        if one.name != "knows_places"
    },
)


def _list(names: set[str]) -> str:
    return ", ".join(sorted(names)) or "none"


__all__ = ["BoardSection", "CabinetConfig", "PoseSection", "ReaderSection", "WeightsSection", "ZoneSection"]
