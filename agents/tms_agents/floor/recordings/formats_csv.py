"""Scans in a CSV file, for whoever writes their own.

    # angle_min = -2.0862          of the first beam, radians; x forward, counter-clockwise
    # angle_increment = 0.0061359
    # range_max = 5.6              optional from here on: range_min, time_increment (between beams, seconds), period,
    # pose = 1.0 0.05 1.5708       x y yaw in the room; unit = mm where ranges are millimetres; model
    12.300,1.402,1.405,inf,,0.71   time of the first beam in seconds, then a range per beam

An empty cell is "no echo", as are inf, 0 and what is not below ``range_max``.
"""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np

from tms_agents.devices.scans import Sweep
from tms_agents.floor.recordings.recorded import Recorded, clean_ranges, rows_of

_NUMBERS = ("angle_min", "angle_increment", "range_min", "range_max", "time_increment", "period")
_WORDS = ("pose", "unit", "model")


def read_csv(path: Path) -> Recorded:
    """Raises ValueError naming the line, OSError where the file cannot be read."""
    told: dict[str, str] = {}
    rows: list[list[float]] = []
    try:
        with path.open(encoding="utf-8") as file:
            for number, line in enumerate(file, 1):
                text = line.strip()
                if text.startswith("#"):
                    _tell(told, text[1:], number)
                elif text:
                    rows.append(_row(text, number, len(rows[0]) if rows else 0))
    except UnicodeDecodeError as error:
        raise ValueError("it is no text") from error
    return _recorded(path.stem, told, rows)


def _tell(told: dict[str, str], text: str, number: int) -> None:
    name, equals, value = text.partition("=")
    name, value = name.strip(), value.strip()
    if not equals:
        return  # a remark
    if name not in (*_NUMBERS, *_WORDS):
        raise ValueError(f"line {number}: {name!r} is unknown (there are {', '.join((*_NUMBERS, *_WORDS))})")
    if name in _NUMBERS and not (_is_number(value) or (name == "range_max" and value == "inf")):
        raise ValueError(f"line {number}: {name} = {value!r} is no number")
    if name == "pose" and (len(_pose(value)) != 3 or not all(map(_is_number, _pose(value)))):
        raise ValueError(f"line {number}: pose = {value!r}: it is x y yaw")
    told[name] = value


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


def _recorded(name: str, told: dict[str, str], lines: list[list[float]]) -> Recorded:
    for needed in ("angle_min", "angle_increment"):
        if needed not in told:
            raise ValueError(f"a line '# {needed} = ...' is missing")
    if told.get("unit", "m") not in ("m", "mm"):
        raise ValueError(f"unit = {told['unit']!r}: it is m or mm")
    values = np.array(lines) if lines else np.empty((0, 2))
    t, ranges = values[:, 0], values[:, 1:] * (0.001 if told.get("unit") == "mm" else 1.0)
    range_min, range_max = float(told.get("range_min", 0.0)), float(told.get("range_max", "inf"))
    period = float(told.get("period", 0.0)) or (float(np.median(np.diff(t))) if len(t) > 1 else 0.1)
    sweep = Sweep(
        angles=float(told["angle_min"]) + float(told["angle_increment"]) * np.arange(ranges.shape[1], dtype=np.float64),
        time_increment_s=float(told.get("time_increment", 0.0)),
        period_s=period,
        range_min_m=range_min,
        range_max_m=range_max,
        model=told.get("model", ""),
    )
    rows = rows_of(clean_ranges(ranges, range_min, range_max))
    x, y, yaw = map(float, _pose(told.get("pose", "0 0 0")))
    return Recorded(name, sweep, (x, y, yaw), t, rows)


def _pose(text: str) -> list[str]:
    return text.replace(",", " ").split()


def _is_number(text: str) -> bool:
    try:
        return math.isfinite(float(text))
    except ValueError:
        return False
