"""What every laser range finder delivers."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class Sweep:
    """How a laser sweeps: ``angles`` (n,) rad in the sensor frame (x forward, counter-clockwise), the order of time.

    Beam i is measured ``i * time_increment_s`` after the first; a sweep begins every ``period_s`` seconds. What is
    nearer than ``range_min_m`` or farther than ``range_max_m`` is not measured.
    """

    angles: Array
    time_increment_s: float
    period_s: float
    range_min_m: float
    range_max_m: float
    model: str = ""

    def to_json(self) -> dict[str, Any]:
        """JSON values, exactly."""
        return {
            "angles": self.angles.tolist(),
            "time_increment_s": self.time_increment_s,
            "period_s": self.period_s,
            "range_min_m": self.range_min_m,
            "range_max_m": self.range_max_m if np.isfinite(self.range_max_m) else None,
            "model": self.model,
        }

    @classmethod
    def from_json(cls, told: Mapping[str, Any]) -> Self:
        """What `to_json` gave, whatever else is told. Raises KeyError, TypeError or ValueError where it is not that."""
        far = told["range_max_m"]
        return cls(
            np.array(told["angles"], dtype=np.float64),
            told["time_increment_s"],
            told["period_s"],
            told["range_min_m"],
            np.inf if far is None else far,
            told["model"],
        )


@dataclass(frozen=True, slots=True, eq=False)
class Scan:
    """One sweep. ``ranges`` (n,) m: +inf where nothing echoed within reach, NaN where the device reports an error.

    ``intensities`` (n,) in the device's own unit, None where the model or mode has none. ``device_time_s`` is the
    device's own clock at the first beam, unwrapped, None where it has none. Scans of one configuration share ``sweep``.
    """

    sweep: Sweep
    ranges: Array
    intensities: Array | None = None
    device_time_s: float | None = None
