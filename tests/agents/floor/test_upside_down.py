"""A laser with its top to the floor, in recordings: what the device told is turned once, whoever wrote it down."""

from __future__ import annotations

import json
import math
import zlib

import numpy as np
import pytest
from floor_rig import OUTLINE, PUT_AT, QUICK, Room, config_toml, laser_toml, sweep

from tms_agents.devices.scans import Scan
from tms_agents.floor.calibration.poses import read_poses
from tms_agents.floor.config import LaserSection
from tms_agents.floor.lasers import Laser
from tms_agents.floor.recordings.formats import read_scans
from tms_agents.floor.recordings.recording import ScanWriter
from tms_agents.floor.recordings.records import HEAD, MAGIC, Damage, records
from tms_client import cli

#: Not in the middle, so that left and right are told apart.
POSE = (1.6, 0.1, 1.3)
BY_RULER = (1.63, 0.08, 1.32)
SWEEP = sweep()
CORNERS = " ".join(f"{x},{y}" for x, y in OUTLINE)


def as_told(room):
    """What the device tells, whose left is the room's right."""
    return room.ranges(SWEEP, POSE)[::-1]


def configured(tmp_path, upside_down, pose=BY_RULER):
    path = tmp_path / "floor.toml"
    hangs = f"upside_down = {str(upside_down).lower()}"
    laser = laser_toml('{ kind = "scip", host = "h" }', pose, more=hangs)
    path.write_text(config_toml("lab", "http://127.0.0.1:1", laser, more=QUICK))
    return path


def npz(tmp_path, scans):
    path = tmp_path / "laser.npz"
    np.savez(path, ranges=scans, t=np.arange(len(scans)) / 10, angles=SWEEP.angles, range_max=8.0)
    return path


def recorded(tmp_path, upside_down):
    """As the agent, or `tms floor record`, writes it."""
    path = tmp_path / "laser.scans"
    source, (x, y, theta) = {"kind": "scip", "host": "h"}, BY_RULER
    section = LaserSection.model_validate(
        {"source": source, "pose": {"x": x, "y": y, "theta": theta}, "upside_down": upside_down}
    )
    room, laser = Room(1), Laser(section)
    writer = ScanWriter(path, ["laser"] if upside_down else [])
    for n in range(20):
        writer.add("laser", BY_RULER, 1000 + n / 10, laser.mounted(Scan(SWEEP, as_told(room))))
    writer.close()
    return path


def calibrate(config, scans):
    """The exit code, and where it found the laser, if it did."""
    code = cli.main(["floor", "calibrate", "--config", str(config), "--outline", CORNERS, "--scans", str(scans)])
    return code, read_poses(config.with_name("floor.calibration.toml")).get("laser")


def test_calibrate_from_what_others_recorded(tmp_path, capsys):
    room = Room(1)
    scans = npz(tmp_path, np.array([as_told(room) for _ in range(20)]))
    code, found = calibrate(configured(tmp_path, upside_down=False), scans)
    assert (code, found) == (2, None) and "is upside_down right?" in capsys.readouterr().err
    code, found = calibrate(configured(tmp_path, upside_down=True), scans)
    assert code == 0 and math.dist(found.pose[:2], POSE[:2]) < 0.01 and abs(found.theta - POSE[2]) < 0.005


@pytest.mark.parametrize("then", [False, True])
def test_calibrate_from_our_own(tmp_path, then):
    """Also where the configuration said something else when it was recorded."""
    code, found = calibrate(configured(tmp_path, upside_down=True), recorded(tmp_path, then))
    assert code == 0 and math.dist(found.pose[:2], POSE[:2]) < 0.01 and abs(found.theta - POSE[2]) < 0.005


def test_an_older_recording_does_not_tell(tmp_path):
    """It is taken as it is: it was turned when it was written."""
    path = recorded(tmp_path, upside_down=True)
    whole = MAGIC
    with path.open("rb") as file:
        for one in records(file, Damage()):
            body = one.body
            if one.kind == b"S":
                told = json.loads(zlib.decompress(body))
                assert told.pop("upside_down") is True
                body = zlib.compress(json.dumps(told).encode())
            whole += HEAD.pack(one.kind, len(body), zlib.crc32(body)) + body
    path.write_bytes(whole)
    assert read_scans(path)[0].upside_down is None
    code, found = calibrate(configured(tmp_path, upside_down=True), path)
    assert code == 0 and math.dist(found.pose[:2], POSE[:2]) < 0.01


def test_replay(tmp_path):
    """A thing is told on the side where it lies."""
    room, scans = Room(2), []
    for n in range(160):
        if n == 60:
            room.put("thing", *PUT_AT)
        scans.append(as_told(room))
    out, config = tmp_path / "out.json", configured(tmp_path, upside_down=True)
    pose = ",".join(map(str, POSE))
    arguments = ["--config", str(config), "--pose", pose, "--out", str(out)]
    assert cli.main(["floor", "replay", str(npz(tmp_path, np.array(scans))), *arguments]) == 0
    (told,) = json.loads(out.read_text())[-1]["labels"]
    assert math.dist((told["x"], told["y"]), PUT_AT) < 0.03
