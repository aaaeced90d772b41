"""Messages of ROS, read by others from a bag: LaserScan, Odometry or else tf, and the place of the laser from tf."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from tms_agents.slam.geometry import Floats
from tms_agents.slam.logs import Log, LogError
from tms_agents.slam.logs_recording import Scan, put_together

SCAN, ODOMETRY = "sensor_msgs/msg/LaserScan", "nav_msgs/msg/Odometry"
#: As ROS 2 and ROS 1 call it.
TRANSFORMS = ("tf2_msgs/msg/TFMessage", "tf/msg/tfMessage")
TYPES = (SCAN, ODOMETRY, *TRANSFORMS)


def parse_messages(topics: Mapping[str, Sequence[Any]]) -> Log:
    """A log of ``topics`` of messages of `TYPES`: the topic of most scans, and that of most odometry.

    Without Odometry, what tf says of the frame ``odom`` (or ``.../odom``) is taken. A laser of whose place tf says
    nothing is at the robot's origin; one that hangs upside down turns the other way round.

    Raises:
        LogError: no scan, no odometry.
    """
    scans = _most(topics, "ranges")
    transforms = [one for messages in topics.values() for m in messages for one in getattr(m, "transforms", ())]
    if not scans:
        raise LogError("it holds no LaserScan message")
    odometry = _most(topics, "pose")
    if odometry:
        records = [(_time(m), *_planar(_matrix(m.pose.pose.position, m.pose.pose.orientation))) for m in odometry]
        base = _name(odometry[0].child_frame_id)
    else:
        moving = [one for one in transforms if _name(one.header.frame_id).split("/")[-1] == "odom"]
        records = [(_time(one), *_planar(_of(one))) for one in moving]
        base = _name(moving[0].child_frame_id) if moving else ""
    mounted = _mounting(transforms, base, _name(scans[0].header.frame_id))
    upside_down = mounted[2, 2] < 0
    finite = [record for record in records if all(map(math.isfinite, record))]
    read = [_scan(m, upside_down) for m in scans]
    usable = [one for one in read if len(one[2]) >= 2]
    bad = len(records) - len(finite) + len(read) - len(usable)
    return put_together(usable, finite, np.array(_planar(mounted)), bad)


def _most(topics: Mapping[str, Sequence[Any]], field: str) -> Sequence[Any]:
    """Messages of the topic that has most of those with a ``field``."""
    found = [messages for _, messages in sorted(topics.items()) if messages and hasattr(messages[0], field)]
    return max(found, key=len, default=[])


def _scan(message: Any, upside_down: bool) -> Scan:
    ranges = np.nan_to_num(np.asarray(message.ranges, dtype=np.float64), posinf=0.0, neginf=0.0)
    light = np.asarray(message.intensities, dtype=np.float64)
    first, step = float(message.angle_min), float(message.angle_increment)
    if upside_down:
        first, step = -first, -step
    return (
        _time(message),
        (len(ranges), first, step, float(message.range_max)),
        np.where(ranges < message.range_min, 0.0, ranges),
        light if len(light) == len(ranges) else None,
    )


def _time(message: Any) -> float:
    return float(message.header.stamp.sec + 1e-9 * message.header.stamp.nanosec)


def _name(frame: str) -> str:
    """ROS 1 wrote frames with a slash before them and without."""
    return frame.lstrip("/")


def _mounting(transforms: Iterable[Any], base: str, laser: str) -> Floats:
    """(4, 4) the frame ``laser`` seen from ``base`` along tf; if no way leads there, they are one."""
    parents: dict[str, tuple[str, Floats]] = {}
    for one in transforms:
        parents.setdefault(_name(one.child_frame_id), (_name(one.header.frame_id), _of(one)))
    up, down = _ancestors(parents, laser), _ancestors(parents, base)
    common = next((frame for frame in up if frame in down), None)
    found: Floats = np.eye(4) if common is None else np.linalg.inv(down[common]) @ up[common]
    return found


def _ancestors(parents: Mapping[str, tuple[str, Floats]], frame: str) -> dict[str, Floats]:
    """``frame`` and the frames above it, each with ``frame`` seen from it (4, 4)."""
    found = {frame: np.eye(4)}
    while frame in parents and parents[frame][0] not in found:
        above, seen = parents[frame]
        found[above] = seen @ found[frame]
        frame = above
    return found


def _of(transform: Any) -> Floats:
    return _matrix(transform.transform.translation, transform.transform.rotation)


def _matrix(position: Any, quaternion: Any) -> Floats:
    """(4, 4) of a position and an orientation of any length above 0."""
    x, y, z, w = np.array([quaternion.x, quaternion.y, quaternion.z, quaternion.w]) / max(
        1e-12, math.hypot(quaternion.x, quaternion.y, quaternion.z, quaternion.w)
    )
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w), position.x],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w), position.y],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y), position.z],
            [0.0, 0.0, 0.0, 1.0],
        ]
    )


def _planar(matrix: Floats) -> tuple[float, float, float]:
    return float(matrix[0, 3]), float(matrix[1, 3]), math.atan2(matrix[1, 0], matrix[0, 0])
