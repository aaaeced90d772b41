"""Scans in metres out of measurements in a sensor's own numbers."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tms_agents.devices.scans import Array
from tms_agents.devices.scip.measurements import Measurement
from tms_agents.devices.scip.models import Coding, coding
from tms_agents.devices.scip.parameters import Parameters
from tms_agents.devices.scip.requests import Measure

_LARGEST_OF_TWO = 4095


def ranges(found: Measurement, parameters: Parameters, codes: Coding | None = None) -> Array:
    """(n,) m: +inf where the sensor saw nothing within its reach, NaN where it says that something went wrong."""
    codes = codes or coding(parameters.modl)
    raw = found.distances
    metres: Array = raw.astype(np.float64) * 0.001
    metres[raw < parameters.dmin] = np.nan
    metres[(raw == codes.far) | (raw > parameters.dmax)] = np.inf
    short = not isinstance(found.request, Measure) or found.request.width == 2
    if short and parameters.dmax > _LARGEST_OF_TWO:
        metres[raw == _LARGEST_OF_TWO] = np.inf  # that far or farther
    return metres


def raw_ranges(metres: Array, parameters: Parameters, codes: Coding | None = None) -> NDArray[np.int32]:
    """(n,) what a sensor sends for these ranges: the inverse of ``ranges`` to half a millimetre."""
    codes = codes or coding(parameters.modl)
    known = np.where(np.isfinite(metres), metres, 0.0)
    raw: NDArray[np.int32] = np.rint(np.clip(known * 1000, 0, 1 << 18)).astype(np.int32)
    raw[raw < parameters.dmin] = codes.near
    raw[raw > parameters.dmax] = codes.far
    raw[np.isposinf(metres)] = codes.far
    raw[np.isnan(metres)] = codes.error
    return raw
