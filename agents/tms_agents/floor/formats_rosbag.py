"""LaserScan topics of ROS bags (ROS 1 .bag; ROS 2 .db3, .mcap or the folder of them); needs the extra ``rosbags``."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from tms_agents.devices.scans import Sweep
from tms_agents.floor.formats import Recorded, clean_ranges
from tms_client.cli import CommandError

_TYPE = "sensor_msgs/msg/LaserScan"


def read_rosbag(path: Path) -> list[Recorded]:
    """A recording per topic, the sensors at the origin: bags keep their poses elsewhere.

    Raises:
        CommandError: ``rosbags`` is not installed.
        ValueError: the bag is damaged, or a topic changes what a scan looks like.
        OSError: it cannot be read.
    """
    try:
        from rosbags.highlevel import AnyReader, AnyReaderError
        from rosbags.rosbag1 import ReaderError as Ros1Error
        from rosbags.rosbag2 import ReaderError as Ros2Error
        from rosbags.typesys import Stores, get_typestore
    except ImportError as error:
        raise CommandError(f'{path}: reading ROS bags needs pip install "robot-town-tms[rosbags]"') from error
    bag = _bag(path)
    bag.stat()
    # Bags of ROS 2 do not always describe their messages; this one never changed.
    known = get_typestore(Stores.ROS2_HUMBLE)
    topics: dict[str, list[Any]] = {}
    try:
        with AnyReader([bag], default_typestore=known) as reader:
            wanted = [one for one in reader.connections if one.msgtype == _TYPE]
            for connection, _, raw in reader.messages(connections=wanted) if wanted else ():
                topics.setdefault(connection.topic, []).append(reader.deserialize(raw, connection.msgtype))
    except (AnyReaderError, Ros1Error, Ros2Error) as error:
        raise ValueError(f"the bag cannot be read: {error}") from error
    return list(_recordings(topics))


def _bag(path: Path) -> Path:
    """What the reader wants to open: of a ROS 2 bag, the folder with its metadata."""
    if path.suffix.lower() in (".db3", ".mcap") and (path.parent / "metadata.yaml").is_file():
        return path.parent
    return path


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
        whole = all(len(one.intensities) == shape for one in scans)
        intensities = np.array([one.intensities for one in scans], dtype=np.float64) if whole else None
        name = re.sub(r"[^A-Za-z0-9._-]+", "_", topic.strip("/")) or "scan"
        cleaned = clean_ranges(ranges, sweep.range_min_m, sweep.range_max_m)
        yield Recorded(name, sweep, (0.0, 0.0, 0.0), t, cleaned, intensities if shape else None)
