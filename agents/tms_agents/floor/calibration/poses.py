"""Poses that ``tms floor calibrate`` found, in one TOML file beside the configuration of the agent."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Literal

from pydantic import AwareDatetime, Field

from tms_agents.calibration_tables import read_tables, write_tables
from tms_agents.config import Section
from tms_agents.floor.config import FloorConfig
from tms_agents.floor.settings import Pose
from tms_schemas.base import Metres


class LaserCalibration(Section):
    """Where a laser is in the room (m, m, rad) and how its ruler errs, how that was found and how well it fitted."""

    x: Metres
    y: Metres
    theta: Annotated[float, Field(ge=-6.2832, le=6.2832)]
    method: Literal["walls", "walkers"]
    rmse_m: float
    #: What it measures times this is how far it is, where that was found.
    range_scale: Annotated[float, Field(gt=0.9, lt=1.1)] | None = None
    measured_at: AwareDatetime | None = None

    @property
    def pose(self) -> Pose:
        return (self.x, self.y, self.theta)


def read_poses(path: Path) -> dict[str, LaserCalibration]:
    """By laser; none where there is no file. Raises CommandError."""
    return read_tables(path, LaserCalibration)


def calibrated(config: FloorConfig, path: Path) -> tuple[FloorConfig, dict[str, Pose]]:
    """The configuration read from ``path`` with what was found of its lasers, and where each of them is.

    Raises:
        CommandError: the calibration cannot be read.
    """
    found = read_poses(config.calibration_path(path))
    lasers = [
        one.model_copy(update={"range_scale": found[one.name].range_scale})
        if one.range_scale is None and one.name in found
        else one
        for one in config.lasers
    ]
    poses = {one.name: found[one.name].pose if one.name in found else one.pose.pose for one in lasers}
    return config.model_copy(update={"lasers": lasers}), poses


def write_poses(path: Path, lasers: Mapping[str, LaserCalibration]) -> Path | None:
    """Replace the file; the name of the former one. Raises CommandError."""
    return write_tables(path, lasers, "where the lasers are: metres, radians; written by tms floor calibrate")
