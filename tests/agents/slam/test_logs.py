"""Logs of every kind come out alike; what cannot be read is counted or said in one line."""

from __future__ import annotations

import gzip
import json

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tms_agents.simulation.building import carmen
from tms_agents.slam import LogError, read_log
from tms_agents.slam.logs_carmen import parse_carmen
from tms_agents.slam.logs_recording import parse_recording

FLASER = "FLASER 4 1.0 2.0 81.83 3.0 0.5 0.1 0.2 0.5 0.1 0.2 10.5 host 10.5"
NEWER = (
    "ROBOTLASER1 0 -1.5708 3.1416 1.0472 80.0 0.01 0 4 1.0 2.0 81.83 3.0 0 0.6 0.1 0.0 0.5 0.1 0.0 "
    "0 0 0 0 0 10.5 host 10.5"
)


def test_a_simulated_log_comes_back(driven, log):
    assert len(log) == len(driven.t)
    np.testing.assert_allclose(log.t, driven.t, atol=1e-6)
    np.testing.assert_allclose(log.odometry, driven.odometry, atol=1e-5)
    np.testing.assert_allclose(log.ranges, driven.ranges, atol=0.006)
    np.testing.assert_allclose(log.angles, driven.angles)
    np.testing.assert_allclose(log.laser, 0.0, atol=1e-9)
    assert log.bad_lines == 0


@pytest.mark.parametrize("name", ["drive.log", "drive.clf", "drive.log.gz"])
def test_files_packed_or_not(tmp_path, driven, log, name):
    text = "\n".join(carmen(driven)).encode()
    (tmp_path / name).write_bytes(gzip.compress(text) if name.endswith("gz") else text)
    np.testing.assert_array_equal(read_log(tmp_path / name).ranges, log.ranges)


def test_a_file_that_is_broken_off_is_read_to_there(tmp_path, driven):
    packed = gzip.compress("\n".join(carmen(driven)).encode())
    (tmp_path / "drive.log.gz").write_bytes(packed[: len(packed) // 2])
    read = read_log(tmp_path / "drive.log.gz")
    assert 0 < len(read) < len(driven.t)
    assert read.bad_lines > 0


def test_beams_of_both_kinds_of_messages():
    old, new = parse_carmen([FLASER, FLASER]), parse_carmen([NEWER])
    np.testing.assert_allclose(old.angles, np.radians([-90, -45, 0, 45]))
    np.testing.assert_allclose(np.degrees(new.angles), [-90, -30, 30, 90], atol=0.01)
    np.testing.assert_allclose(new.laser, [0.1, 0.0, 0.0], atol=1e-9)
    np.testing.assert_array_equal(old.returned(0), [True, True, False, True])
    assert old.odometry[0].tolist() == [0.5, 0.1, 0.2]


def test_lines_that_cannot_be_read_are_counted():
    log = parse_carmen([FLASER, "FLASER 4 1.0", "FLASER x", FLASER.replace("81.83", "nan"), "", "# note", "ODOM 1"])
    assert (len(log), log.bad_lines) == (1, 4)


def test_what_repeats_at_the_end_is_no_return():
    near = FLASER.replace("81.83", "8.19").replace("3.0", "8.19").replace("2.0", "8.18")
    assert not parse_carmen([near] * 5).returned(0)[1:].any()


def test_way_and_turn_are_added_up_between_scans():
    odometry = [(0, 0, 0), (1, 0, 0), (0, 0, 0), (0, 0, 1), (0, 0, 0)]
    lines = [f"ODOM {x} {y} {a} 0 0 0 {t} h {t}" for t, (x, y, a) in enumerate(odometry)]
    first, last = (FLASER.replace("0.5 0.1 0.2", "0 0 0").replace("10.5", str(t)) for t in (0, 4))
    log = parse_carmen([first, *lines, last])
    np.testing.assert_allclose(log.driven[1] - log.driven[0], [2.0, 2.0])


def test_recordings_have_odometry_between_its_records(tmp_path):
    records = [{"t": t, "type": "odom", "x": t, "y": 0.0, "theta": 0.0} for t in (0.0, 1.0, 2.0)]
    scan = {"type": "scan", "angle_min": -1.0, "angle_increment": 0.5, "range_max": 4.0, "intensities": [1, 2, 3]}
    records += [scan | {"t": t, "ranges": [1.0, 0.0, 4.0]} for t in (0.5, 1.25)]
    records.append({"t": 0.2, "type": "rfid", "antenna": 0, "tags": []})
    path = tmp_path / "stream.jsonl.gz"
    path.write_bytes(gzip.compress("\n".join(map(json.dumps, records)).encode()))
    (tmp_path / "models.json").write_text(json.dumps({"robot": {"laser_pose": [0.1, 0.0, 0.0]}}))
    log = read_log(path)
    np.testing.assert_allclose(log.odometry[:, 0], [0.5, 1.25])
    np.testing.assert_allclose(log.points(0), [[0.1 + np.cos(1), -np.sin(1)]])
    assert log.intensities is not None
    assert log.intensities.shape == (2, 3)
    (tmp_path / "models.json").write_text("{}")
    with pytest.raises(LogError, match="laser_pose"):
        read_log(path)


@pytest.mark.parametrize(
    ("name", "text", "why"),
    [
        ("a.log", "", "no FLASER"),
        ("a.log", "PARAM x\nhello", "no FLASER"),
        ("a.jsonl", "{}", "0 scans"),
        ("a.txt", "x", "not a log"),
    ],
)
def test_what_is_no_log_is_said_so(tmp_path, name, text, why):
    (tmp_path / name).write_text(text)
    with pytest.raises(LogError, match=why):
        read_log(tmp_path / name)


_words = st.sampled_from([*FLASER.split(), *NEWER.split(), "-3", "1e999", "nan", "99999999999", "ODOM", "é", "{"])


@settings(max_examples=300)
@given(st.lists(st.lists(_words, max_size=30).map(" ".join), max_size=5))
def test_any_carmen_lines(lines):
    try:
        log = parse_carmen(lines)
    except LogError:
        return
    assert log.ranges.shape == (len(log.t), len(log.angles))
    assert np.isfinite(log.ranges).all()
    assert np.isfinite(log.odometry).all()


_values = st.recursive(
    st.one_of(st.none(), st.booleans(), st.floats(), st.integers(), st.text(max_size=4)),
    lambda inner: st.lists(inner, max_size=3),
    max_leaves=5,
)
_KEYS = ("t", "x", "y", "theta", "ranges", "angle_min", "angle_increment", "range_max", "intensities")
_records = st.fixed_dictionaries(
    {"type": st.sampled_from(["odom", "scan", "rfid", 3])},
    optional=dict.fromkeys(
        ("t", "x", "y", "theta", "ranges", "angle_min", "angle_increment", "range_max", "intensities"), _values
    ),
)


@settings(max_examples=300)
@given(st.lists(st.one_of(_records.map(json.dumps), st.text(max_size=20)), max_size=6))
def test_any_lines_of_a_recording(lines):
    try:
        log = parse_recording(lines)
    except LogError:
        return
    assert np.isfinite(log.odometry).all()
