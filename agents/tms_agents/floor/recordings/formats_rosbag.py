"""LaserScan topics of ROS bags (ROS 1 .bag; ROS 2 .db3, .mcap or the folder of them); needs the extra ``rosbags``."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from tms_agents.bags import read_messages
from tms_agents.devices.scans import Array, Sweep
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
        first = scans[0]
        shape = len(first.ranges)
        if any(len(one.ranges) != shape for one in scans):
            raise ValueError(f"topic {topic}: scans with different numbers of beams")
        t = np.array([one.header.stamp.sec + 1e-9 * one.header.stamp.nanosec for one in scans])
        ranges = np.array([one.ranges for one in scans], dtype=np.float64).reshape(len(scans), shape)
        sweep = Sweep(
            angles=float(first.angle_min) + float(first.angle_increment) * np.arange(shape, dtype=np.float64),
            time_increment_s=float(first.time_increment),
            period_s=float(first.scan_time) or (float(np.median(np.diff(t))) if len(t) > 1 else 0.1),
            range_min_m=float(first.range_min),
            range_max_m=float(first.range_max),
            model=str(first.header.frame_id),
        )
        name = re.sub(r"[^A-Za-z0-9._-]+", "_", topic.strip("/")) or "scan"
        cleaned = clean_ranges(ranges, sweep.range_min_m, sweep.range_max_m)
        yield Recorded(name, sweep, (0.0, 0.0, 0.0), t, list(zip(cleaned, map(_intensities, scans), strict=True)))


def _intensities(scan: Any) -> Array | None:
    """Many drivers announce some and send none, or send some now and then."""
    return np.array(scan.intensities, dtype=np.float64) if 0 < len(scan.intensities) == len(scan.ranges) else None
