"""Bags written by ``rosbags`` itself, of ROS 1 and 2, with Odometry or tf, and lasers that hang where tf says."""

from __future__ import annotations

import json

import numpy as np
import pytest
from rosbags.rosbag1 import Writer as Ros1Writer
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as Ros2Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from tms_agents.bags import read_messages
from tms_agents.commands import slam
from tms_agents.slam.logs_ros import ODOMETRY, SCAN, TRANSFORMS, TYPES, parse_messages
from tms_client.cli import CommandError

TF = TRANSFORMS[0]
ROLLED, AHEAD = (1.0, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0)


class Maker:
    """Messages of one version of ROS."""

    def __init__(self, ros1: bool) -> None:
        self.ros1 = ros1
        self.store = get_typestore(Stores.ROS1_NOETIC if ros1 else Stores.ROS2_HUMBLE)
        if ros1:
            self.store.register(get_types_from_msg("geometry_msgs/TransformStamped[] transforms", TF))

    def make(self, kind, **fields):
        return self.store.types[kind](**fields)

    def header(self, t, frame):
        stamp = self.make("builtin_interfaces/msg/Time", sec=int(t), nanosec=round(t % 1 * 1e9))
        number = {"seq": 0} if self.ros1 else {}
        return self.make("std_msgs/msg/Header", stamp=stamp, frame_id=frame, **number)

    def scan(self, t, ranges, light=()):
        return self.make(
            SCAN, header=self.header(t, "laser"), angle_min=-1.0, angle_max=1.0, angle_increment=2 / (len(ranges) - 1),
            time_increment=0.0, scan_time=0.1, range_min=0.1, range_max=30.0,
            ranges=np.array(ranges, np.float32), intensities=np.array(light, np.float32),
        )  # fmt: skip

    def place(self, x, y, quaternion):
        make = self.make
        return (
            make("geometry_msgs/msg/Vector3", x=x, y=y, z=0.2),
            make("geometry_msgs/msg/Quaternion", **dict(zip("xyzw", quaternion, strict=True))),
        )

    def odometry(self, t, x, y, theta):
        make = self.make
        position = make("geometry_msgs/msg/Point", x=x, y=y, z=0.0)
        nothing = make("geometry_msgs/msg/Vector3", x=0.0, y=0.0, z=0.0)
        pose = make("geometry_msgs/msg/Pose", position=position, orientation=self.place(0.0, 0.0, turned(theta))[1])
        twist = make("geometry_msgs/msg/Twist", linear=nothing, angular=nothing)
        return make(
            ODOMETRY, header=self.header(t, "odom"), child_frame_id="base_link",
            pose=make("geometry_msgs/msg/PoseWithCovariance", pose=pose, covariance=np.zeros(36)),
            twist=make("geometry_msgs/msg/TwistWithCovariance", twist=twist, covariance=np.zeros(36)),
        )  # fmt: skip

    def transform(self, t, parent, child, x, y, quaternion):
        translation, rotation = self.place(x, y, quaternion)
        one = self.make("geometry_msgs/msg/Transform", translation=translation, rotation=rotation)
        header = self.header(t, parent)
        stamped = self.make(
            "geometry_msgs/msg/TransformStamped", header=header, child_frame_id=child, transform=one
        )  # fmt: skip
        return self.make(TF, transforms=[stamped])


def turned(theta):
    return (0.0, 0.0, float(np.sin(theta / 2)), float(np.cos(theta / 2)))


def write(path, maker, messages, kind=StoragePlugin.SQLITE3):
    """``messages``: (topic, type, t, message)."""
    writer = Ros1Writer(path) if maker.ros1 else Ros2Writer(path, version=9, storage_plugin=kind)
    serialize = maker.store.serialize_ros1 if maker.ros1 else maker.store.serialize_cdr
    with writer:
        connections = {}
        for topic, msgtype, t, message in messages:
            if topic not in connections:
                connections[topic] = writer.add_connection(topic, msgtype, typestore=maker.store)
            writer.write(connections[topic], int(t * 1e9), serialize(message, msgtype))
    return path


def drive(maker, tf=False, mounted=AHEAD):
    """Four scans of a robot that goes ahead 0.5 m a second, its laser 0.2 m before its middle."""
    yield "/tf_static", TF, 0.0, maker.transform(0.0, "base_link", "mast", 0.15, 0.0, AHEAD)
    yield "/tf_static", TF, 0.0, maker.transform(0.0, "mast", "laser", 0.05, 0.1, mounted)
    for n in range(9):
        t = 100.0 + 0.5 * n
        if tf:
            yield "/tf", TF, t, maker.transform(t, "odom", "base_link", 0.25 * n, 0.0, turned(0.1 * n))
        else:
            yield "/odom", ODOMETRY, t, maker.odometry(t, 0.25 * n, 0.0, 0.1 * n)
        if n % 2 == 1:
            yield "/scan", SCAN, t, maker.scan(t + 0.25, [1.0, np.inf, 0.05, 40.0, 2.0], [5, 0, 1, 0, 6])
    yield "/other", SCAN, 103.0, maker.scan(103.0, [9.0, 9.0])


@pytest.mark.parametrize("ros1", [True, False])
@pytest.mark.parametrize("tf", [True, False])
def test_scans_odometry_and_the_place_of_the_laser(tmp_path, ros1, tf):
    maker = Maker(ros1)
    log = parse_messages(read_messages(write(tmp_path / ("a.bag" if ros1 else "a"), maker, drive(maker, tf)), TYPES))
    np.testing.assert_allclose(log.t, [100.75, 101.75, 102.75, 103.75])
    np.testing.assert_allclose(log.odometry[0], [0.375, 0.0, 0.15], atol=1e-6)
    np.testing.assert_allclose(log.driven[1], [0.875, 0.35], atol=1e-6)
    np.testing.assert_allclose(log.laser, [0.2, 0.1, 0.0], atol=1e-9)
    np.testing.assert_array_equal(log.returned(0), [True, False, False, False, True])
    np.testing.assert_allclose(log.points(0)[1], np.array([0.2, 0.1]) + 2.0 * np.array([np.cos(1), np.sin(1)]))
    assert log.intensities is not None and log.intensities[0].tolist() == [5, 0, 1, 0, 6]


def test_a_laser_upside_down_sees_left_on_the_right(tmp_path):
    maker = Maker(True)
    log = parse_messages(read_messages(write(tmp_path / "a.bag", maker, drive(maker, mounted=ROLLED)), TYPES))
    np.testing.assert_allclose(log.points(0)[1], np.array([0.2, 0.1]) + 2.0 * np.array([np.cos(1), -np.sin(1)]))


@pytest.mark.parametrize("kind", [StoragePlugin.SQLITE3, StoragePlugin.MCAP])
def test_the_command_maps_a_bag(tmp_path, kind, log):
    maker = Maker(False)

    def messages():
        for n in range(40):
            t, (x, y, theta) = float(log.t[n]), log.odometry[n]
            yield "/odom", ODOMETRY, t, maker.odometry(t, float(x), float(y), float(theta))
            yield "/scan", SCAN, t, maker.scan(t, log.ranges[n])

    folder = write(tmp_path / "bag", maker, messages(), kind)
    (file,) = [one for one in folder.iterdir() if one.suffix in (".db3", ".mcap")]
    for bag in (folder, file):
        assert slam.main(["run", str(bag), "--out", str(tmp_path / "out"), "--particles", "2"]) == 0
    assert json.loads((tmp_path / "out" / "stats.json").read_text())["scans"] == 40


@pytest.mark.parametrize(
    ("messages", "why"),
    [
        (lambda maker: [("/odom", ODOMETRY, 1.0, maker.odometry(1.0, 0.0, 0.0, 0.0))], "no LaserScan"),
        (lambda maker: [("/scan", SCAN, 1.0, maker.scan(1.0, [1.0, 2.0]))], "1 scans and 0 records of odometry"),
        (None, "cannot be read"),
    ],
)
def test_what_is_missing_is_one_line(tmp_path, messages, why):
    path, maker = tmp_path / "a.bag", Maker(True)
    path.write_bytes(b"#ROSBAG V2.0\n") if messages is None else write(path, maker, messages(maker))
    with pytest.raises(CommandError, match=why):
        slam.main(["run", str(path), "--out", str(tmp_path / "out")])
