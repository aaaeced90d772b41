"""Scans in a CSV file, for whoever writes their own.

    # angle_min = -2.0862          of the first beam, radians; x forward, counter-clockwise
    # angle_increment = 0.0061359
    # range_max = 5.6              optional from here on: range_min, time_increment (between beams, seconds), period,
    # pose = 1.0 0.05 1.5708       x y yaw in the room; model; unit = mm where ranges are millimetres, and range_min
                                   and range_max, too
    12.300,1.402,1.405,inf,,0.71   time of the first beam in seconds, then a range per beam

An empty cell is "no echo", as are inf, 0 and what is not below ``range_max``.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import NamedTuple

import numpy as np

from tms_agents.devices.scans import Sweep
from tms_agents.floor.recordings.checks import check_ranges, check_times, period_of
from tms_agents.floor.recordings.recorded import Recorded, clean_ranges, rows_of

_NUMBERS = ("angle_min", "angle_increment", "range_min", "range_max", "time_increment", "period")
_WORDS = ("pose", "unit", "model")
_UNITS = {"m": 1.0, "mm": 0.001}
#: No laser reaches less far: who says so has written metres among millimetres.
_LEAST_REACH_M = 0.1


class _Told(NamedTuple):
    value: str
    line: int


def read_csv(path: Path) -> Recorded:
    """Raises ValueError naming the line, OSError where the file cannot be read."""
    told: dict[str, _Told] = {}
    rows: list[list[float]] = []
    try:
        with path.open(encoding="utf-8-sig") as file:
            for number, line in enumerate(file, 1):
                text = line.strip()
                if text.startswith("#"):
                    _tell(told, text[1:], number)
                elif text:
                    rows.append(_row(text, number, len(rows[0]) if rows else 0))
    except UnicodeDecodeError as error:
        raise ValueError("it is no text") from error
    return _recorded(path.stem, told, rows)


def _tell(told: dict[str, _Told], text: str, number: int) -> None:
    name, equals, value = text.partition("=")
    name, value = name.strip(), value.strip()
    if not equals:
        return  # a remark
    if name not in (*_NUMBERS, *_WORDS):
        raise ValueError(f"line {number}: {name!r} is unknown (there are {', '.join((*_NUMBERS, *_WORDS))})")
    if name in _NUMBERS and not _is_number(value, endless=name == "range_max"):
        raise ValueError(f"line {number}: {name} = {value!r} is no number")
    if name == "pose" and (len(_pose(value)) != 3 or not all(map(_is_number, _pose(value)))):
        raise ValueError(f"line {number}: pose = {value!r}: it is x y yaw")
    if name == "unit" and value not in _UNITS:
        raise ValueError(f"line {number}: unit = {value!r}: it is m or mm")
    told[name] = _Told(value, number)


def _row(text: str, number: int, expected: int) -> list[float]:
    cells = text.split(",")
    if len(cells) < 2 or (expected and len(cells) != expected):
        raise ValueError(f"line {number}: {len(cells)} cells{f', the first scan has {expected}' if expected else ''}")
    try:
        row = [float(cell) if cell.strip() else math.inf for cell in cells]
    except ValueError as error:
        raise ValueError(f"line {number}: {error}") from None
    if not math.isfinite(row[0]):
        raise ValueError(f"line {number}: it begins with no time")
    return row


def _recorded(name: str, told: dict[str, _Told], lines: list[list[float]]) -> Recorded:
    for needed in ("angle_min", "angle_increment"):
        if needed not in told:
            raise ValueError(f"a line '# {needed} = ...' is missing")
    values = np.array(lines) if lines else np.empty((0, 2))
    unit = _UNITS[told["unit"].value] if "unit" in told else 1.0
    t, ranges = values[:, 0], values[:, 1:] * unit
    check_ranges(ranges)
    range_min, range_max = _reach(told, unit)
    sweep = Sweep(
        angles=_number(told, "angle_min")
        + _number(told, "angle_increment") * np.arange(ranges.shape[1], dtype=np.float64),
        time_increment_s=_number(told, "time_increment"),
        period_s=_number(told, "period") or period_of(t),
        range_min_m=range_min,
        range_max_m=range_max,
        model=told["model"].value if "model" in told else "",
    )
    check_times(sweep)
    rows = rows_of(clean_ranges(ranges, range_min, range_max))
    x, y, yaw = map(float, _pose(told["pose"].value)) if "pose" in told else (0.0, 0.0, 0.0)
    return Recorded(name, sweep, (x, y, yaw), t, rows)


def _reach(told: dict[str, _Told], unit: float) -> tuple[float, float]:
    """The least and the largest range in metres; they are told in the unit of the ranges."""
    least, most = _number(told, "range_min") * unit, _number(told, "range_max", math.inf) * unit
    if least < 0:
        raise ValueError(f"line {told['range_min'].line}: range_min = {told['range_min'].value}: it is 0 or more")
    if most < _LEAST_REACH_M:
        given = f"line {told['range_max'].line}: range_max = {told['range_max'].value}"
        raise ValueError(f"{given}: no laser reaches {most * 1000:g} mm only (it is told in the unit of the ranges)")
    if most <= least:
        line = max(told["range_min"].line, told["range_max"].line)
        raise ValueError(f"line {line}: range_max is not more than range_min")
    return least, most


def _number(told: dict[str, _Told], name: str, otherwise: float = 0.0) -> float:
    return float(told[name].value) if name in told else otherwise


def _pose(text: str) -> list[str]:
    return text.replace(",", " ").split()


def _is_number(text: str, *, endless: bool = False) -> bool:
    try:
        return math.isfinite(float(text)) or (endless and float(text) == math.inf)
    except ValueError:
        return False
