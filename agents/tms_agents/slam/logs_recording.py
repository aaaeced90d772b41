"""Our recordings: a JSON record per line, ``odom`` and ``scan`` on clocks of their own (and ``rfid``, not read
here)."""

from __future__ import annotations

import json
import math
from collections import Counter
from collections.abc import Iterable
from typing import Any

import numpy as np

from tms_agents.slam.geometry import Floats
from tms_agents.slam.logs import Log, LogError, driven_at, odometry_at, parse_laser

#: t s; beams, first angle, step, longest range; ranges (B,), light (B,) or none.
Scan = tuple[float, tuple[int, float, float, float], Floats, Floats | None]


def parse_recording(lines: Iterable[str], models: str | None = None) -> Log:
    """Scans with the odometry between the records around them; ``models`` (JSON) tells the pose of the laser.

    Records that cannot be read, or scans of another shape than most, are counted as bad lines.

    Raises:
        LogError: no scan, no odometry, or ``models`` cannot be read.
    """
    scans: list[Scan] = []
    odometry: list[tuple[float, float, float, float]] = []
    bad = 0
    for line in lines:
        if not line.strip():
            continue
        try:
            record = json.loads(line)
            if record["type"] == "odom":
                odometry.append(_finite(record["t"], record["x"], record["y"], record["theta"]))
            elif record["type"] == "scan":
                scans.append(scan_of(record))
        except (ValueError, KeyError, TypeError, RecursionError, OverflowError):
            bad += 1
    return put_together(scans, odometry, np.zeros(3) if models is None else parse_laser(models), bad)


def put_together(scans: list[Scan], odometry: list[tuple[float, float, float, float]], laser: Floats, bad: int) -> Log:
    """A log of ``scans`` and records t, x, y, theta of ``odometry``, each on a clock of its own; ``bad`` were left out.

    Raises:
        LogError: no scan, or no odometry.
    """
    if not scans or not odometry:
        raise LogError(
            f"it holds {len(scans)} scans and {len(odometry)} records of odometry" + f", {bad} bad lines" * (bad > 0)
        )
    shape, _ = Counter(one[1] for one in scans).most_common(1)[0]
    alike = sorted((one for one in scans if one[1] == shape), key=lambda one: one[0])
    records = np.array(sorted(odometry))
    t = np.array([one[0] for one in alike])
    lights = [one[3] for one in alike]
    return Log(
        t,
        odometry_at(records[:, 0], records[:, 1:], t),
        driven_at(records[:, 0], records[:, 1:], t),
        np.array([one[2] for one in alike]),
        shape[1] + shape[2] * np.arange(float(shape[0])),
        shape[3],
        laser,
        None if any(light is None for light in lights) else np.array(lights, dtype=np.float64),
        bad + len(scans) - len(alike),
    )


def scan_of(record: dict[str, Any]) -> Scan:
    """Of a record of type ``scan``. Raises ``ValueError``, ``KeyError`` or ``TypeError`` where it is none."""
    ranges = np.asarray(record["ranges"], dtype=np.float64)
    t, first, step, longest = _finite(record["t"], record["angle_min"], record["angle_increment"], record["range_max"])
    light = None if record.get("intensities") is None else np.asarray(record["intensities"], dtype=np.float64)
    if ranges.ndim != 1 or len(ranges) < 2 or (light is not None and light.shape != ranges.shape):
        raise ValueError("no list of ranges")
    return t, (len(ranges), first, step, longest), np.nan_to_num(ranges, posinf=0.0, neginf=0.0), light


def _finite(*values: Any) -> tuple[float, float, float, float]:
    a, b, c, d = (float(value) for value in values)
    if not all(map(math.isfinite, (a, b, c, d))):
        raise ValueError("not finite")
    return a, b, c, d
