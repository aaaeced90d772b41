"""Recorded scans out of every kind of file, and what is wrong with a file in one line."""

from __future__ import annotations

import contextlib

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from rosbags.rosbag1 import Writer as Ros1Writer
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as Ros2Writer
from rosbags.typesys import Stores, get_typestore

from tms_agents.floor.recordings.formats import read_scans
from tms_agents.floor.recordings.recorded import Recorded, clean_ranges, in_time, rows_of
from tms_client.cli import CommandError

#: Every way to say that nothing echoed, or that something is wrong, and a range.
RAW = [np.inf, np.nan, 0.0, 5.6, 5.5999, 0.006, 0.019, 1.234]
CLEAN = [np.inf, np.nan, np.inf, np.inf, np.inf, np.nan, np.nan, 1.234]


def test_every_code_for_nothing_is_normalised():
    np.testing.assert_array_equal(clean_ranges(np.array([RAW]), 0.02, 5.6), [CLEAN])
    # Where nan is the only code it is what the driver says for "no echo".
    np.testing.assert_array_equal(clean_ranges(np.array([np.nan, 1.0]), 0.02, 5.6), [np.inf, 1.0])


@given(arrays(np.float64, 20, elements=st.floats(width=32)))
def test_cleaning_gives_ranges_as_drivers_do_and_is_done_once(raw):
    cleaned = clean_ranges(raw, 0.02, 5.6)
    measured = np.isfinite(cleaned)
    assert ((cleaned[measured] >= 0.02) & (cleaned[measured] < 5.6)).all()
    assert not (cleaned == -np.inf).any()
    if not np.isnan(cleaned).all():  # a scan of errors alone says nothing about codes
        np.testing.assert_array_equal(clean_ranges(np.append(cleaned, np.inf), 0.02, 5.6)[:-1], cleaned)


def test_npz_as_simulators_write_it(tmp_path):
    path = tmp_path / "room_A.npz"
    angles = np.linspace(-1, 1, 8).astype(np.float32)
    np.savez(
        path,
        ranges=np.array([RAW, RAW], np.float32),
        t=[1.0, 1.1],
        angles=angles,
        sensor_pose=[1.0, 2.0, 0.5],
        time_increment=1e-4,
        range_min=0.02,
        range_max=5.6,
        scan_rate=10.0,
        model="URG-04LX",
    )
    (found,) = read_scans(path)
    assert (found.name, found.pose, found.sweep.model) == ("room_A", (1.0, 2.0, 0.5), "URG-04LX")
    assert (found.sweep.time_increment_s, found.sweep.period_s) == (1e-4, 0.1)
    np.testing.assert_allclose(found.sweep.angles, angles)
    np.testing.assert_allclose(found.ranges[1], CLEAN, atol=1e-6)
    assert found.scan(0).intensities is None


def test_intensities_that_were_announced_and_never_sent_are_none(tmp_path):
    path = tmp_path / "room.npz"
    told = {"ranges": np.ones((2, 8)), "t": [1.0, 1.1], "angles": np.linspace(-1, 1, 8)}
    for intensities in ([], np.zeros((2, 0)), np.zeros((2, 3))):
        np.savez(path, intensities=intensities, **told)
        assert read_scans(path)[0].scan(1).intensities is None
    np.savez(path, intensities=7.0 * np.ones((2, 8)), **told)
    np.testing.assert_array_equal(read_scans(path)[0].scan(1).intensities, np.full(8, 7.0))


def test_npz_as_ros_has_it_and_times_that_stand_still(tmp_path):
    path = tmp_path / "bag.npz"
    np.savez(
        path,
        ranges=np.full((4, 3), 2.0),
        intensities=np.full((4, 3), 7.0),
        t=[5.0, 5.1, 5.1, 5.2],
        angle_min=-0.5,
        angle_increment=0.5,
        range_max=5.6,
        scan_time=0.1,
        odom=np.zeros((4, 3)),
    )
    (found,) = read_scans(path)
    assert found.pose == (0.0, 0.0, 0.0)
    np.testing.assert_allclose(found.sweep.angles, [-0.5, 0.0, 0.5])
    np.testing.assert_allclose(found.t, [5.0, 5.1, 5.2])
    np.testing.assert_array_equal(found.scan(2).intensities, np.full(3, 7.0))


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"ranges": None}, "it has no 'ranges'"),
        ({"t": [1.0]}, "1 times for 2 scans"),
        ({"t": [1.0, np.nan]}, "a time is no number"),
        ({"angle_min": None}, "neither 'angles' nor"),
        ({"angles": [1.0]}, "1 angles for 3 beams"),
        ({"ranges": ["a", "b"]}, "'ranges' is not made of numbers"),
        ({"ranges": [1.0, 2.0]}, "'ranges' has 1 dimensions instead of 2"),
        ({"ranges": np.empty((2, 0))}, "a scan has 0 beams"),
        ({"sensor_pose": [1.0]}, "x, y, yaw"),
        ({"range_min": 9.0}, "no reach"),
        ({"ranges": 1000.0 + np.arange(6.0).reshape(2, 3)}, "they seem to be millimetres"),
        ({"ranges": np.full((2, 3), np.nan)}, "every range is nan"),
        ({"ranges": np.ones((2, 3)) + 1j}, "'ranges' is not made of numbers, but of complex128"),
        ({"time_increment": np.inf}, "time_increment inf s is no time from beam to beam"),
        ({"time_increment": -1e-4}, "time_increment -0.0001 s is no time from beam to beam"),
        ({"time_increment": 0.6}, "time_increment 0.6 s: a sweep would last 1.2 s, and the next begins after 1 s"),
        ({"ranges": np.empty((0, 3)), "t": np.empty(0)}, "it holds no scan"),
    ],
)
def test_a_wrong_npz_is_named_in_one_line(tmp_path, change, says):
    path = tmp_path / "x.npz"
    good = {"ranges": np.ones((2, 3)), "t": [1.0, 2.0], "angle_min": 0.0, "angle_increment": 0.1, "range_max": 5.0}
    np.savez(path, **{name: value for name, value in (good | change).items() if value is not None})
    with pytest.raises(CommandError, match=says) as caught:
        read_scans(path)
    assert str(caught.value).startswith(f"{path}: ") and "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("name", "content", "says"),
    [
        ("none.npz", None, "No such file"),
        ("text.npz", b"hello", "it is no npz file"),
        ("torn.npz", b"PK\x03\x04 torn", "it is no npz file"),
        ("x.txt", b"hello", "not a recording: its name ends in"),
        ("none.txt", None, "No such file"),
        ("x.bag", b"hello", "the bag cannot be read"),
        ("x.db3", b"hello", "the bag cannot be read"),
        ("x.mcap", b"hello", "the bag cannot be read"),
        ("none.bag", None, "No such file"),
        ("x.scans", b"hello", "it is no recording of scans"),
        ("empty.scans", b"", "it holds no scan"),
    ],
)
def test_what_is_no_recording_is_said_in_one_line(tmp_path, name, content, says):
    path = tmp_path / name
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(CommandError, match=says) as caught:
        read_scans(path)
    assert "\n" not in " ".join(str(caught.value).split()) and str(path) in str(caught.value)


CSV = """# angle_min = -0.5
# angle_increment = 0.5
# range_max = 5.6
# range_min = 0.02
# pose = 1 2 0.5
# written by hand
10.0,1.402,,inf

10.1,1.405,0.006,5.6
"""


def test_csv(tmp_path):
    path = tmp_path / "hand.csv"
    path.write_text(CSV)
    (found,) = read_scans(path)
    np.testing.assert_allclose(found.sweep.angles, [-0.5, 0.0, 0.5])
    np.testing.assert_array_equal(found.ranges, [[1.402, np.inf, np.inf], [1.405, np.nan, np.inf]])
    assert found.pose == (1.0, 2.0, 0.5) and found.sweep.period_s == pytest.approx(0.1)
    path.write_text(CSV.replace("1.40", "140").replace("0.006", "6").replace("5.6\n", "5600\n", 2) + "# unit = mm\n")
    (other,) = read_scans(path)
    np.testing.assert_allclose(other.ranges[:, 0], [1.402, 1.405])
    assert other.sweep.range_max_m == pytest.approx(5.6), "it is told in the unit of the ranges"
    path.write_text("\ufeff" + CSV, encoding="utf-8")  # as some editors begin a file
    assert len(read_scans(path)[0]) == 2
    path.write_text(CSV.replace("range_max = 5.6", "range_max = inf"))
    assert read_scans(path)[0].sweep.range_max_m == np.inf


def test_scans_that_are_left_out_are_said(tmp_path):
    path, said = tmp_path / "back.csv", []
    path.write_text(CSV.split("10.0,")[0] + "".join(f"{50 - n / 10},1.4,1.5,1.6\n" for n in range(40)))
    (found,) = read_scans(path, said.append)
    assert len(found) == 1 and found.sweep.period_s > 0
    assert said == [f"{path}: 39 of 40 scans of back are left out: they are not later than one before"]


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (("# angle_min = -0.5\n", ""), "'# angle_min = ...' is missing"),
        (("# angle_min = -0.5", "# angle_min = left"), "line 1: angle_min = 'left' is no number"),
        (("# range_max", "# rangemax"), "line 3: 'rangemax' is unknown"),
        (("1.402", "1.4o2"), "line 7: could not convert"),
        (("10.1,1.405,", "10.1,"), "line 9: 3 cells, the first scan has 4"),
        (("10.1,1.405", "inf,1.405"), "line 9: it begins with no time"),
        (("pose = 1 2 0.5", "pose = 1 2"), "line 5: pose = '1 2': it is x y yaw"),
        (("pose = 1 2 0.5", "pose = inf 0 0"), "line 5: pose = 'inf 0 0': it is x y yaw"),
        (("angle_min = -0.5", "angle_min = inf"), "line 1: angle_min = 'inf' is no number"),
        (("range_min = 0.02", "time_increment = inf"), "line 4: time_increment = 'inf' is no number"),
        (("pose = 1 2 0.5", "unit = inch"), "line 5: unit = 'inch': it is m or mm"),
        (("range_max = 5.6", "range_max = 0"), "line 3: range_max = 0: no laser reaches 0 mm only"),
        (("range_max = 5.6", "range_max = -5.6"), "line 3: range_max = -5.6: no laser reaches"),
        (("range_min = 0.02", "range_min = 6"), "line 4: range_max is not more than range_min"),
        (("range_min = 0.02", "range_min = -1"), "line 4: range_min = -1: it is 0 or more"),
        (("pose = 1 2 0.5", "unit = mm"), "line 3: range_max = 5.6: no laser reaches 5.6 mm only"),
        (("range_min = 0.02", "time_increment = 0.1"), "a sweep would last 0.2 s"),
        (("1.402,,inf\n\n10.1,1.405,0.006,5.6", "1402,1403,1404"), "they seem to be millimetres"),
        (("1.402,,inf\n\n10.1,1.405,0.006,5.6", "nan,nan,nan"), "every range is nan"),
    ],
)
def test_a_wrong_csv_is_named_with_its_line(tmp_path, change, says):
    path = tmp_path / "x.csv"
    path.write_text(CSV.replace(*change))
    with pytest.raises(CommandError, match=says):
        read_scans(path)


def laser_scan(store, t, ranges, ros1=False, light=()):
    sec, nanosec = int(t), round(t % 1 * 1e9)
    header = {"stamp": store.types["builtin_interfaces/msg/Time"](sec=sec, nanosec=nanosec), "frame_id": "laser"}
    if ros1:
        header["seq"] = 0
    return store.types["sensor_msgs/msg/LaserScan"](
        header=store.types["std_msgs/msg/Header"](**header),
        angle_min=-0.5,
        angle_max=0.5,
        angle_increment=0.5,
        time_increment=1e-4,
        scan_time=0.1,
        range_min=0.02,
        range_max=5.6,
        ranges=np.array(ranges, np.float32),
        intensities=np.array(light, np.float32),
    )


SCANS = [(100.0, [1.0, np.inf, 2.0]), (100.1, [1.0, 0.006, 2.5])]


def check_bag(path, topics=("front_scan",)):
    found = read_scans(path)
    assert [one.name for one in found] == list(topics)
    for one in found:
        np.testing.assert_allclose(one.t, [100.0, 100.1])
        np.testing.assert_allclose(one.ranges, [[1.0, np.inf, 2.0], [1.0, np.nan, 2.5]])
        np.testing.assert_allclose(one.sweep.angles, [-0.5, 0.0, 0.5])
        assert one.scan(0).intensities is None and one.sweep.model == "laser"


def test_ros1_bag(tmp_path):
    path, store = tmp_path / "walk.bag", get_typestore(Stores.ROS1_NOETIC)
    with Ros1Writer(path) as writer:
        connection = writer.add_connection("/front/scan", "sensor_msgs/msg/LaserScan", typestore=store)
        text = writer.add_connection("/chatter", "std_msgs/msg/String", typestore=store)
        said = store.types["std_msgs/msg/String"](data="hello")
        writer.write(text, 1, store.serialize_ros1(said, "std_msgs/msg/String"))
        for t, ranges in SCANS:
            message = laser_scan(store, t, ranges, ros1=True)
            writer.write(connection, int(t * 1e9), store.serialize_ros1(message, connection.msgtype))
    check_bag(path)


@pytest.mark.parametrize("kind", [StoragePlugin.SQLITE3, StoragePlugin.MCAP])
def test_ros2_bag_of_two_lasers(tmp_path, kind):
    folder, store = tmp_path / "walk", get_typestore(Stores.ROS2_HUMBLE)
    with Ros2Writer(folder, version=9, storage_plugin=kind) as writer:
        for topic in ("/front/scan", "/rear"):
            connection = writer.add_connection(topic, "sensor_msgs/msg/LaserScan", typestore=store)
            for t, ranges in SCANS:
                message = store.serialize_cdr(laser_scan(store, t, ranges), connection.msgtype)
                writer.write(connection, int(t * 1e9), message)
    check_bag(folder, ("front_scan", "rear"))
    (file,) = [one for one in folder.iterdir() if one.suffix in (".db3", ".mcap")]
    check_bag(file, ("front_scan", "rear"))


def test_scans_of_a_bag_have_the_intensities_that_they_came_with(tmp_path):
    path, store = tmp_path / "some.bag", get_typestore(Stores.ROS1_NOETIC)
    with Ros1Writer(path) as writer:
        connection = writer.add_connection("/scan", "sensor_msgs/msg/LaserScan", typestore=store)
        for n, light in enumerate([[1.0, 2.0, 3.0], [], [4.0, 5.0, 6.0]]):
            message = laser_scan(store, 100 + n, [1.0, 2.0, 3.0], ros1=True, light=light)
            writer.write(connection, int((100 + n) * 1e9), store.serialize_ros1(message, connection.msgtype))
    (found,) = read_scans(path)
    np.testing.assert_array_equal(found.scan(0).intensities, [1.0, 2.0, 3.0])
    assert found.scan(1).intensities is None
    np.testing.assert_array_equal(found.scan(2).intensities, [4.0, 5.0, 6.0])


@pytest.mark.parametrize("kind", ["mcap", "bag", "db3"])
def test_a_damaged_bag_is_one_line_or_is_read(tmp_path, kind):
    """A byte is wrong, or the end is missing, at many places."""
    path = tmp_path / f"x.{kind}"
    whole = bag_of(tmp_path / "whole", kind)
    for n in range(15):
        at = len(whole) * n // 15
        for damaged in (whole[:at], whole[:at] + bytes([whole[at] ^ 0xFF]) + whole[at + 1 :]):
            path.write_bytes(damaged)
            with contextlib.suppress(CommandError):
                read_scans(path)
    # Found in practice: the last length of an mcap is wrong.
    path.write_bytes(whole[:-40] + b"\xff" * 12 + whole[-28:])
    if kind == "mcap":
        with pytest.raises(CommandError, match="the bag cannot be read"):
            read_scans(path)


def bag_of(path, kind):
    store = get_typestore(Stores.ROS1_NOETIC if kind == "bag" else Stores.ROS2_HUMBLE)
    plugin = StoragePlugin.MCAP if kind == "mcap" else StoragePlugin.SQLITE3
    with Ros1Writer(path) if kind == "bag" else Ros2Writer(path, version=9, storage_plugin=plugin) as writer:
        connection = writer.add_connection("/scan", "sensor_msgs/msg/LaserScan", typestore=store)
        for t, ranges in SCANS * 10:
            message = laser_scan(store, t, ranges, ros1=kind == "bag")
            pack = store.serialize_ros1 if kind == "bag" else store.serialize_cdr
            writer.write(connection, int(t * 1e9), pack(message, connection.msgtype))
    return (path if kind == "bag" else next(path.glob(f"*.{kind}"))).read_bytes()


def test_a_folder_that_is_no_bag(tmp_path):
    with pytest.raises(CommandError, match=r"the folder is no bag: there is no metadata\.yaml in it"):
        read_scans(tmp_path)


def test_a_bag_without_scans(tmp_path):
    path, store = tmp_path / "quiet.bag", get_typestore(Stores.ROS1_NOETIC)
    with Ros1Writer(path) as writer:
        connection = writer.add_connection("/chatter", "std_msgs/msg/String", typestore=store)
        said = store.types["std_msgs/msg/String"](data="hello")
        writer.write(connection, 1, store.serialize_ros1(said, connection.msgtype))
    with pytest.raises(CommandError, match="it holds no scan"):
        read_scans(path)


def test_scans_of_several_sensors_come_in_time():
    def recorded(name, times):
        t = np.array(times)
        return Recorded(name, None, (0.0, 0.0, 0.0), t, rows_of(np.ones((len(t), 1))))

    order = list(in_time([recorded("a", [1.0, 2.0, 3.0]), recorded("b", [0.5, 2.5])]))
    assert order == [(1, 0), (0, 0), (0, 1), (1, 1), (0, 2)]


@pytest.mark.realdata
def test_real_recordings(shared_data):
    for path in sorted((shared_data / "floor" / "real").glob("*.npz")):
        (found,) = read_scans(path)
        measured = np.isfinite(found.ranges)
        assert found.ranges[measured].min() >= found.sweep.range_min_m
        assert found.ranges[measured].max() < found.sweep.range_max_m
        assert (np.diff(found.t) > 0).all() and 0.05 < found.sweep.period_s < 0.2
        assert np.isinf(found.ranges).any(), "every one of them looks at something out of reach now and then"
