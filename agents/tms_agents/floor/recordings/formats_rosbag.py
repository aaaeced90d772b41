"""LaserScan topics of ROS bags (ROS 1 .bag; ROS 2 .db3, .mcap or the folder of them); needs the extra ``rosbags``."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from tms_agents.bags import read_messages
from tms_agents.devices.scans import Array, Sweep
from tms_agents.floor.recordings.checks import period_of
from tms_agents.floor.recordings.recorded import Recorded, clean_ranges


def read_rosbag(path: Path) -> list[Recorded]:
    """A recording per topic, the sensors at the origin: bags keep their poses elsewhere.

    Raises:
        CommandError: ``rosbags`` is not installed.
        ValueError: the bag is damaged, or a topic changes what a scan looks like.
        OSError: it cannot be read.
    """
    return list(_recordings(read_messages(path, ["sensor_msgs/msg/LaserScan"])))


def _recordings(topics: dict[str, list[Any]]) -> Iterator[Recorded]:
    for topic, scans in topics.items():
        shape = len(scans[0].ranges)
        if any(len(one.ranges) != shape for one in scans):
            raise ValueError(f"topic {topic}: scans with different numbers of beams")
        t = np.array([one.header.stamp.sec + 1e-9 * one.header.stamp.nanosec for one in scans])
        sweep = _sweep(scans[0], period_of(t))
        numbers = [*sweep.angles, sweep.time_increment_s, sweep.period_s, sweep.range_min_m]
        if not np.isfinite(numbers).all() or np.isnan(sweep.range_max_m):
            raise ValueError(f"topic {topic}: what it tells of the laser is no number")
        cleaned = clean_ranges(
            np.array([_numbers(one.ranges) for one in scans]).reshape(len(scans), shape),
            sweep.range_min_m,
            sweep.range_max_m,
        )
        name = re.sub(r"[^A-Za-z0-9._-]+", "_", topic.strip("/")) or "scan"
        yield Recorded(name, sweep, (0.0, 0.0, 0.0), t, list(zip(cleaned, map(_intensities, scans), strict=True)))


def _sweep(scan: Any, between_s: float) -> Sweep:
    with np.errstate(invalid="ignore"):
        angles = float(scan.angle_min) + float(scan.angle_increment) * np.arange(len(scan.ranges), dtype=np.float64)
    return Sweep(
        angles=angles,
        time_increment_s=float(scan.time_increment),
        period_s=float(scan.scan_time) or between_s,
        range_min_m=float(scan.range_min),
        range_max_m=float(scan.range_max),
        model=str(scan.header.frame_id),
    )


def _intensities(scan: Any) -> Array | None:
    """Many drivers announce some and send none, or send some now and then."""
    return _numbers(scan.intensities) if 0 < len(scan.intensities) == len(scan.ranges) else None


def _numbers(given: Any) -> Array:
    with np.errstate(invalid="ignore"):  # a nan of a kind that numpy warns of
        return np.array(given, dtype=np.float64)
