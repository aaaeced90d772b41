"""Poses that ``tms floor calibrate`` found, in one TOML file beside the configuration of the agent."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Literal

from pydantic import AwareDatetime, Field

from tms_agents.calibration_tables import read_tables, write_tables
from tms_agents.config import Section
from tms_agents.floor.settings import Pose
from tms_schemas.base import Metres


class LaserCalibration(Section):
    """Where a laser is in the room (m, m, rad), how that was found and how well it fitted."""

    x: Metres
    y: Metres
    theta: Annotated[float, Field(ge=-6.2832, le=6.2832)]
    method: Literal["walls", "walkers"]
    rmse_m: float
    measured_at: AwareDatetime | None = None

    @property
    def pose(self) -> Pose:
        return (self.x, self.y, self.theta)


def read_poses(path: Path) -> dict[str, LaserCalibration]:
    """By laser; none where there is no file. Raises CommandError."""
    return read_tables(path, LaserCalibration)


def write_poses(path: Path, lasers: Mapping[str, LaserCalibration]) -> Path | None:
    """Replace the file; the name of the former one. Raises CommandError."""
    return write_tables(path, lasers, "where the lasers are: metres, radians; written by tms floor calibrate")
