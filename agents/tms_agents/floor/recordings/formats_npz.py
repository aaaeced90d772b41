"""Scans in an npz file: ``ranges`` (T, B) and ``t`` (T,), and how the sensor sweeps, in either of two spellings.

``angles`` (B,), ``sensor_pose`` (3,) and ``scan_rate`` as simulators write them, or ``angle_min``, ``angle_increment``
and ``scan_time`` as ROS has them; then the sensor stands at the origin. Other arrays are ignored.
"""

from __future__ import annotations

import zipfile
import zlib
from pathlib import Path
from typing import Any

import numpy as np

from tms_agents.devices.scans import Array, Sweep
from tms_agents.floor.recordings.checks import check_ranges, check_times, period_of
from tms_agents.floor.recordings.recorded import Recorded, clean_ranges, rows_of

_MOST_BEAMS = 100_000


def read_npz(path: Path) -> Recorded:
    """Raises ValueError saying what is missing or impossible, OSError where the file cannot be read."""
    with path.open("rb") as opened:
        if not zipfile.is_zipfile(opened):
            raise ValueError("it is no npz file")
        opened.seek(0)
        try:
            with np.load(opened, allow_pickle=False) as file:
                values: dict[str, Any] = {name: file[name] for name in file.files}
        except (zipfile.BadZipFile, zlib.error, EOFError, KeyError) as error:
            raise ValueError(f"it is no npz file: {error}") from error
    ranges, t = _array(values, "ranges", 2), _array(values, "t", 1)
    if len(t) != len(ranges):
        raise ValueError(f"{len(t)} times for {len(ranges)} scans")
    if not np.isfinite(t).all():
        raise ValueError("a time is no number")
    beams = ranges.shape[1]
    if not 1 <= beams <= _MOST_BEAMS:
        raise ValueError(f"a scan has {beams} beams")
    range_min, range_max = _number(values, "range_min", 0.02), _number(values, "range_max", np.inf)
    if not 0 <= range_min < range_max:
        raise ValueError(f"range_min {range_min:g} and range_max {range_max:g} are no reach")
    check_ranges(ranges)
    sweep = Sweep(
        angles=_angles(values, beams),
        time_increment_s=_number(values, "time_increment", 0.0),
        period_s=_period(values, t),
        range_min_m=range_min,
        range_max_m=range_max,
        model=str(values["model"]) if "model" in values else "",
    )
    check_times(sweep)
    # Some drivers announce intensities and send none.
    bright = "intensities" in values and np.shape(values["intensities"]) == ranges.shape
    intensities = _array(values, "intensities", 2) if bright else None
    rows = rows_of(clean_ranges(ranges, range_min, range_max), intensities)
    return Recorded(path.stem, sweep, _pose(values), t, rows)


def _array(values: dict[str, Any], name: str, dimensions: int) -> Array:
    if name not in values:
        raise ValueError(f"it has no {name!r}")
    given = np.asarray(values[name])
    if given.dtype.kind not in "iufb":
        raise ValueError(f"{name!r} is not made of numbers, but of {given.dtype}")
    with np.errstate(over="ignore"):  # of more digits than usual: what is beyond them is endless
        array = given.astype(np.float64)
    if array.ndim != dimensions:
        raise ValueError(f"{name!r} has {array.ndim} dimensions instead of {dimensions}")
    return array


def _number(values: dict[str, Any], name: str, otherwise: float) -> float:
    if name not in values:
        return otherwise
    number = float(_array(values, name, 0))
    if np.isnan(number):
        raise ValueError(f"{name!r} is no number")
    return number


def _angles(values: dict[str, Any], beams: int) -> Array:
    if "angles" in values:
        angles = _array(values, "angles", 1)
    elif "angle_min" in values and "angle_increment" in values:
        step = _number(values, "angle_increment", 0.0)
        angles = _number(values, "angle_min", 0.0) + step * np.arange(beams, dtype=np.float64)
    else:
        raise ValueError("it has neither 'angles' nor 'angle_min' and 'angle_increment'")
    if len(angles) != beams or not np.isfinite(angles).all():
        raise ValueError(f"{len(angles)} angles for {beams} beams, or one that is no number")
    return angles


def _pose(values: dict[str, Any]) -> tuple[float, float, float]:
    if "sensor_pose" not in values:
        return (0.0, 0.0, 0.0)
    pose = _array(values, "sensor_pose", 1)
    if pose.shape != (3,) or not np.isfinite(pose).all():
        raise ValueError("'sensor_pose' must be x, y, yaw")
    return (float(pose[0]), float(pose[1]), float(pose[2]))


def _period(values: dict[str, Any], t: Array) -> float:
    """Seconds from scan to scan: as it is told, else as it is."""
    if (period := _number(values, "scan_time", 0.0)) > 0:
        return period
    if (rate := _number(values, "scan_rate", 0.0)) > 0:
        return 1.0 / rate
    return period_of(t)
