"""Calibrations of an agent's boards in one TOML file beside its configuration."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from datetime import datetime
from pathlib import Path
from typing import Annotated

import numpy as np
from numpy.typing import NDArray
from pydantic import AwareDatetime, Field, model_validator

from tms_agents.cabinet.calibration import Solution
from tms_agents.calibration_tables import read_tables, write_tables
from tms_agents.config import Section
from tms_schemas.base import Xy

_Values = Annotated[list[float], Field(min_length=1, max_length=36)]


class BoardCalibration(Section):
    """``grams = gain * (counts - offset)`` per cell; ``cells`` in metres where they were measured, too."""

    gain: _Values
    offset: _Values
    cells: Annotated[list[Xy], Field(min_length=1, max_length=36)] | None = None
    noise_g: _Values | None = None
    rmse_weight_g: float | None = None
    rmse_position_m: float | None = None
    measured_at: AwareDatetime | None = None

    @model_validator(mode="after")
    def _same_cells(self) -> BoardCalibration:
        lengths = {len(one) for one in (self.gain, self.offset, self.cells, self.noise_g) if one is not None}
        if len(lengths) != 1:
            raise ValueError("gain, offset, cells and noise_g must have one value per cell")
        if not all(self.gain):
            raise ValueError("a gain of 0 means a cell that weighs nothing")
        return self

    @classmethod
    def of(cls, solution: Solution, measured_at: datetime, *, with_cells: bool) -> BoardCalibration:
        at = [(round(float(x), 5), round(float(y), 5)) for x, y in solution.cells]
        return cls(
            gain=_rounded(solution.gain),
            offset=_rounded(solution.offset),
            cells=at if with_cells else None,
            noise_g=_rounded(solution.noise_g),
            rmse_weight_g=round(solution.rmse_weight_g, 4),
            rmse_position_m=round(solution.rmse_position_m, 6),
            measured_at=measured_at,
        )

    def grams(self, counts: Sequence[float]) -> list[float]:
        """One per cell; NaN stays NaN."""
        return [(one - offset) * gain for one, offset, gain in zip(counts, self.offset, self.gain, strict=True)]


def read_calibration(path: Path) -> dict[str, BoardCalibration]:
    """Calibrations by board; none where there is no file.

    Raises:
        CommandError: the file cannot be read or says something impossible.
    """
    return read_tables(path, BoardCalibration)


def write_calibration(path: Path, boards: Mapping[str, BoardCalibration]) -> Path | None:
    """Replace the file in one step; the former one is kept beside it, as ``.old`` (returned where there was one).

    Raises:
        CommandError: the folder cannot be written.
    """
    return write_tables(path, boards, "grams = gain * (counts - offset) per cell; written by tms cabinet calibrate")


def _rounded(values: NDArray[np.float64]) -> list[float]:
    """Nine digits: more than any cell has, and readable."""
    return [float(f"{one:.9g}") for one in values]
