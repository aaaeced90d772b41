"""``tms floor``: replay, watch, calibrate, record; what is shown and what is said of bad input."""

from __future__ import annotations

import asyncio
import io
import json
import math
import os
import pty
import re
import subprocess
import sys

import numpy as np
import pytest
from floor_rig import COMES, GONE, OUTLINE, PUT_AT, QUICK, Room, config_toml, laser_toml, story, sweep
from PIL import Image

from tms_agents.config import read_config
from tms_agents.devices.emulation import TcpLine
from tms_agents.devices.scans import Scan
from tms_agents.devices.scip import ScipDevice
from tms_agents.floor.calibration.poses import calibrated, read_poses
from tms_agents.floor.config import FloorConfig
from tms_agents.floor.recordings.formats import read_scans
from tms_agents.floor.recordings.recording import ScanWriter
from tms_agents.floor.watch.canvas import Canvas
from tms_client import cli

POSE = (2.5, 0.05, math.pi / 2)
SWEEP = sweep()


@pytest.fixture(scope="module")
def story_scans(tmp_path_factory):
    """The story of ``floor_rig`` as our recording and as npz without a pose."""
    folder, room = tmp_path_factory.mktemp("story"), Room()
    t = np.arange(0.0, GONE + 4.0, 0.1)
    ranges = []
    for now in t:
        story(room, now)
        ranges.append(room.ranges(SWEEP, POSE))
    writer = ScanWriter(folder / "story.scans")
    for now, one in zip(t, ranges, strict=True):
        writer.add("laser", POSE, 1000 + now, Scan(SWEEP, one))
    writer.close()
    np.savez(
        folder / "story.npz",
        ranges=np.array(ranges, np.float32),
        t=t,
        angle_min=SWEEP.angles[0],
        angle_increment=SWEEP.angles[1] - SWEEP.angles[0],
        range_max=8.0,
    )
    config = folder / "floor.toml"
    config.write_text(config_toml("lab", "http://127.0.0.1:1", laser_toml('{ kind = "scip", host = "h" }'), more=QUICK))
    return folder


def test_watch_where_there_is_no_braille(story_scans):
    """The list is shown all the same."""
    command = [sys.executable, "-m", "tms_client", "floor", "watch", "--once", "--wait", "1"]
    done = subprocess.run(
        [*command, str(story_scans / "story.scans")],
        capture_output=True,
        env=os.environ | {"PYTHONIOENCODING": "ascii"},
    )
    assert (done.returncode, done.stderr) == (0, b"")
    assert b"laser laser: connected" in done.stdout and b"???" in done.stdout


def test_replay(story_scans, tmp_path, capsys):
    out, picture = tmp_path / "out.json", tmp_path / "tracks.png"
    scans = [str(story_scans / "story.scans"), "--config", str(story_scans / "floor.toml")]
    assert cli.main(["floor", "replay", *scans, "--out", str(out), "--png", str(picture), "--seed", "5"]) == 0
    assert capsys.readouterr() == ("", ""), "no progress where nobody looks"
    frames = json.loads(out.read_text())
    assert len(frames) == round((GONE + 4.0) * 10) and frames[0]["t"] == 1000.0
    kinds = [{(one["id"], one["attr"]) for one in frame["labels"]} for frame in frames]
    (mover,) = {one for frame in kinds for one in frame if one[1] == "mover"}
    (thing,) = {one for frame in kinds for one in frame if one[1] == "object"}
    assert mover[0] != thing[0] and kinds[-1] == {thing}
    assert math.dist((frames[-1]["labels"][0]["x"], frames[-1]["labels"][0]["y"]), PUT_AT) < 0.02
    walked = [one for frame in frames for one in frame["labels"] if one["attr"] == "mover"]
    assert walked[0]["x"] < 1.3 and max(one["x"] for one in walked) > 4.0
    width, height, dots = read_png(picture.read_bytes())
    assert width == 900 and height > 400 and len(np.unique(dots)) >= 5


def test_replay_in_the_frame_of_the_sensor_and_of_several(story_scans, tmp_path):
    """A file without a pose is in its own frame; two sensors of one run see one walker."""
    out, npz = tmp_path / "out.json", str(story_scans / "story.npz")
    settings = ["--config", str(story_scans / "floor.toml")]
    assert cli.main(["floor", "replay", npz, "--out", str(out), *settings]) == 0
    last = json.loads(out.read_text())[-1]["labels"]
    ahead, left = PUT_AT[1] - POSE[1], POSE[0] - PUT_AT[0]
    assert math.dist((last[0]["x"], last[0]["y"]), (ahead, left)) < 0.02
    pose = ",".join(map(str, POSE))
    both = [npz, npz, "--pose", pose, "--pose", pose]
    assert cli.main(["floor", "replay", *both, "--out", str(out), *settings]) == 0
    frames = json.loads(out.read_text())
    assert len(frames) == 2 * round((GONE + 4.0) * 10)
    assert len({one["id"] for frame in frames for one in frame["labels"] if one["attr"] == "mover"}) == 1


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["replay", "none.npz", "--out", "o.json"], "none.npz: No such file"),
        (["replay", "{story}", "--out", "no/such/folder.json"], "no/such/folder.json: there is no folder no/such"),
        (["replay", "none.npz", "--out", "no/such/folder.json"], "there is no folder no/such"),  # before it is read
        (["replay", "none.npz", "--out", "o.json", "--png", "no/such.png"], "no/such.png: there is no folder no"),
        (["replay", "none.npz", "--out", "."], ".: that is a folder"),
        (["replay", "none.npz", "--out", "o.json", "--png", "x.jpg"], "x.jpg: the name of a picture ends in .png"),
        (["watch", "{story}", "--png", "x.jpg"], "x.jpg: the name of a picture ends in .png"),
        (["watch", "{story}", "--png", "no/such.png"], "no/such.png: there is no folder no"),
        (["watch", "{story}", "--once", "--wait", "nan"], "--wait is 0 or more"),
        (["watch", "{story}", "--speed", "nan"], "--speed is 0 or more"),
        (["record", "--config", "{config}", "--out", "x.scans", "--seconds", "0"], "--seconds is 0.5 or more"),
        (["record", "--config", "{config}", "--out", "x.scans", "--seconds", "-1"], "--seconds is 0.5 or more"),
        (["record", "--config", "{config}", "--out", "x.scans", "--seconds", "nan"], "--seconds is 0.5 or more"),
        (["replay", "{folder}", "--out", "o.json"], "the folder is no bag"),
        (["replay", "{story}"], "--out"),
        (["replay", "{story}", "--out", "o", "--pose", "1,2"], "--pose '1,2': it is x,y,theta"),
        (["replay", "{story}", "--out", "o", "--pose", "1,nan,2"], "--pose '1,nan,2': it is x,y,theta"),
        (["watch", "{story}", "--pose", "inf,0,0"], "--pose 'inf,0,0': it is x,y,theta"),
        (["replay", "{story}", "--out", "o", "--pose", "1e9,0,0"], "lasers.0.pose.x: Input should be less than"),
        (["replay", "{story}", "--out", "o", "--pose", "1,2,0", "--pose", "1,2,0"], "there are 1 sensors: laser"),
        (["replay", "{story}", "--out", "o", "--config", "none.toml"], "tms: none.toml: no such file\n"),
        (["watch"], "what shall be watched?"),
        (["watch", "{story}", "--speed", "-1"], "--speed is 0 or more"),
        (["calibrate", "--config", "{config}", "--laser", "x"], "which laser? one of: laser"),
        (["calibrate", "--config", "{config}", "--outline", "0,0 1"], "corners like"),
        (["calibrate", "--config", "{config}", "--walkers", "laser"], "that is the laser itself"),
        (["calibrate", "--config", "{config}", "--scans", "{story}"], "no outline: give --outline"),
        (["record", "--config", "{config}", "--out", "x.bin"], "the name of a recording ends in .scans"),
        (["dance"], "dance"),
    ],
)
def test_bad_input_is_one_line(story_scans, monkeypatch, tmp_path, capsys, arguments, says):
    monkeypatch.chdir(tmp_path)
    places = {"story": story_scans / "story.scans", "config": story_scans / "floor.toml", "folder": tmp_path}
    assert cli.main(["floor", *(one.format(**places) for one in arguments)]) == 2
    out, err = capsys.readouterr()
    assert says in err and err.startswith("tms: ") and err.count("\n") == 1 and not out


def test_what_is_beyond_the_reach_that_is_told_is_not_there(story_scans, tmp_path, capsys):
    """The thing lies 1.66 m off; replay and watch leave it out, as the agent does."""
    out, config = tmp_path / "out.json", tmp_path / "floor.toml"
    told = (story_scans / "floor.toml").read_text()
    seen = []
    for reach in (1.8, 1.5):
        config.write_text(told.replace('name = "laser"', f'name = "laser"\nrange_max_m = {reach}'))
        arguments = [str(story_scans / "story.scans"), "--config", str(config)]
        assert cli.main(["floor", "replay", *arguments, "--out", str(out)]) == 0
        assert cli.main(["floor", "watch", *arguments, "--once", "--wait", "1000"]) == 0
        seen.append((len(json.loads(out.read_text())[-1]["labels"]), " thing " in capsys.readouterr().out))
    assert seen == [(1, True), (0, False)]


def test_what_is_left_out_of_a_file_is_one_line(story_scans, tmp_path, capsys):
    """Times that run backwards, and a damaged byte: the rest is played."""
    out, damaged, back = tmp_path / "out.json", tmp_path / "damaged.scans", tmp_path / "back.npz"
    data = bytearray((story_scans / "story.scans").read_bytes())
    data[len(data) // 3] ^= 1
    damaged.write_bytes(data)
    assert cli.main(["floor", "replay", str(damaged), "--out", str(out)]) == 0
    _, err = capsys.readouterr()
    assert re.fullmatch(rf"tms: {damaged}: \d+ bytes are damaged and were skipped\n", err)
    assert len(json.loads(out.read_text())) > 0.8 * (GONE + 4.0) * 10
    with np.load(story_scans / "story.npz") as story_npz:
        np.savez(back, **(dict(story_npz) | {"t": story_npz["t"][::-1]}))
    assert cli.main(["floor", "replay", str(back), "--out", str(out)]) == 0
    _, err = capsys.readouterr()
    assert re.fullmatch(rf"tms: {back}: (\d+) of \d+ scans of back are left out: they are not later .*\n", err)
    assert len(json.loads(out.read_text())) == 1


@pytest.mark.parametrize(
    "how", [["watch"], ["watch", "--once"], ["watch", "--speed", "0"], ["replay", "--out", "o.json"]]
)
def test_a_recording_that_no_estimator_can_use_is_one_line(tmp_path, monkeypatch, capsys, how):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "few.csv").write_text("# angle_min = 0\n# angle_increment = 0.1\n1.0,1,1,1\n1.1,1,1,1\n")
    assert cli.main(["floor", how[0], "few.csv", *how[1:]]) == 2
    assert capsys.readouterr() == ("", "tms: few.csv: a sensor of the floor needs at least eight beams\n")


def test_a_pose_may_begin_with_a_minus(story_scans, tmp_path):
    out, found = tmp_path / "out.json", []
    for pose in (["--pose=-1,2,0"], ["--pose", "-1,2,0"], ["--pose", "-.5,2,0"]):
        arguments = ["--config", str(story_scans / "floor.toml"), "--out", str(out), *pose]
        assert cli.main(["floor", "replay", str(story_scans / "story.npz"), *arguments]) == 0
        found.append(json.loads(out.read_text())[-1]["labels"])
    assert found[0] == found[1] and found[2][0]["x"] == pytest.approx(found[0][0]["x"] + 0.5, abs=1e-3)


def test_watch_a_recording(story_scans, capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "90")
    monkeypatch.setenv("LINES", "30")
    scans = [str(story_scans / "story.scans"), "--config", str(story_scans / "floor.toml")]
    assert cli.main(["floor", "watch", *scans, "--once", "--wait", str(COMES + 2.0)]) == 0
    out = capsys.readouterr().out
    lines = out.splitlines()
    assert len(lines) <= 30 and all(len(line) <= 90 for line in lines) and "\x1b" not in out
    assert "connected" in out and " mover " in out and "appeared at" in out
    dots = sum(0x2800 < ord(one) <= 0x28FF for one in out)
    assert dots > 60, "walls, points in front and the mover"


def test_watch_writes_pictures(story_scans, tmp_path):
    picture = tmp_path / "floor.png"
    scans = [str(story_scans / "story.scans"), "--config", str(story_scans / "floor.toml")]
    assert cli.main(["floor", "watch", *scans, "--speed", "0", "--png", str(picture)]) == 0
    width, height, dots = read_png(picture.read_bytes())
    assert dots.shape == (height, width) and (dots == 6).any(), "the thing that lies there"
    assert not (dots == 7).any(), "nobody is there any more"


def test_watch_in_a_terminal(story_scans):
    """On a terminal: the other screen, colours, a picture after the other, and everything back at the end."""
    master, slave = pty.openpty()
    command = [sys.executable, "-m", "tms_client", "floor", "watch", str(story_scans / "story.scans"), "--speed", "50"]
    command += ["--config", str(story_scans / "floor.toml")]
    process = subprocess.Popen(command, stdout=slave, stderr=slave, stdin=slave)
    os.close(slave)
    seen = b""
    while True:
        try:
            data = os.read(master, 65536)
        except OSError:  # the terminal was closed with the process
            break
        if not data:
            break
        seen += data
    os.close(master)
    assert process.wait(20) == 0
    text = seen.decode()
    assert text.startswith("\x1b[?1049h\x1b[?25l") and text.rstrip().endswith("\x1b[?25h\x1b[?1049l")
    assert text.count("\x1b[H") >= 2 and "\x1b[32mconnected" in text


def test_calibrate_and_record_a_live_laser(tmp_path, capsys):
    """From the bytes of an emulated laser to the file beside the configuration, which the agent uses."""
    room = Room()
    device = ScipDevice(lambda: (room.ranges(device.sweep, POSE), None), "UST-20LX")
    config = tmp_path / "floor.toml"

    async def run(*arguments: str) -> int:
        async with TcpLine(device, tick_s=0.005) as line:
            source = f'{{ kind = "scip", host = "127.0.0.1", port = {line.port} }}'
            config.write_text(config_toml("lab", "http://127.0.0.1:1", laser_toml(source, (2.7, 0.2, 1.4))))
            return await asyncio.to_thread(
                lambda: (
                    subprocess.run(
                        [sys.executable, "-m", "tms_client", "floor", *arguments, "--config", str(config)], timeout=60
                    ).returncode
                )
            )

    scans, outline = tmp_path / "room.scans", " ".join(f"{x},{y}" for x, y in OUTLINE)
    assert asyncio.run(run("record", "--out", str(scans), "--seconds", "2")) == 0
    (recorded,) = read_scans(scans)
    assert len(recorded) >= 10 and recorded.name == "laser"
    assert asyncio.run(run("calibrate", "--outline", outline, "--seconds", "1")) == 0
    path = tmp_path / "floor.calibration.toml"
    found = read_poses(path)["laser"]
    assert math.dist(found.pose[:2], POSE[:2]) < 0.01 and abs(found.theta - POSE[2]) < 0.005
    assert found.method == "walls" and found.rmse_m < 0.01

    # Again, from the recording; the former result is kept.
    arguments = ["calibrate", "--config", str(config), "--outline", outline, "--scans", str(scans)]
    assert cli.main(["floor", *arguments]) == 0
    assert "Written to" in capsys.readouterr().out
    assert path.with_name(path.name + ".old").exists()
    assert math.dist(read_poses(path)["laser"].pose[:2], POSE[:2]) < 0.01

    # Another room's outline is refused.
    assert cli.main(["floor", *arguments[:3], "--outline", "0,0 2,0 2,1 0,1", "--scans", str(scans)]) == 2
    assert "that is no good fit" in capsys.readouterr().err


def read_png(data: bytes) -> tuple[int, int, np.ndarray]:
    """Size and palette numbers of a PNG."""
    with Image.open(io.BytesIO(data)) as image:
        assert (image.format, image.mode) == ("PNG", "P")
        return image.width, image.height, np.asarray(image)


def test_a_laser_that_measures_too_long_is_found_out_and_understood(story_scans, tmp_path, capsys):
    """By the file beside the configuration, though that does not tell the room."""
    scans, config = tmp_path / "long.scans", tmp_path / "floor.toml"
    (recorded,) = read_scans(story_scans / "story.scans")
    writer = ScanWriter(scans)
    for t, ranges in zip(recorded.t, recorded.ranges, strict=True):
        writer.add("laser", POSE, t, Scan(SWEEP, 1.01 * ranges))
    writer.close()
    config.write_text((story_scans / "floor.toml").read_text())

    def away_m():
        out = tmp_path / "out.json"
        assert cli.main(["floor", "replay", str(scans), "--config", str(config), "--out", str(out)]) == 0
        (told,) = [one for one in json.loads(out.read_text())[-1]["labels"] if one["attr"] == "object"]
        return math.dist((told["x"], told["y"]), POSE[:2])

    before = away_m()
    outline = " ".join(f"{x},{y}" for x, y in OUTLINE)
    arguments = ["floor", "calibrate", "--config", str(config), "--outline", outline, "--scans", str(scans)]
    assert cli.main(arguments) == 0
    assert "it measures +1.00 % too long" in capsys.readouterr().out
    found, _ = calibrated(read_config(config, FloorConfig), config)
    assert found.lasers[0].range_scale == pytest.approx(1 / 1.01, abs=2e-4)
    assert before / away_m() == pytest.approx(1.01, abs=0.001)


def test_a_picture_that_others_can_read():
    """The dots of a picture as another program decodes them, and as braille."""
    canvas = Canvas(40, 20, (0.0, 0.0, 4.0, 2.0))
    canvas.points([(0.05, 0.05)], 1)
    canvas.ring((2.0, 1.0), 0.5, 2, filled=True)
    canvas.text((3.0, 1.0), "17", 3)
    canvas.points([(99.0, 99.0), (float("nan"), 0.0)], 1)
    palette = [(255, 255, 255), (255, 0, 0), (0, 255, 0), (0, 0, 255)]
    decoded = np.array(Image.open(io.BytesIO(canvas.png(palette))).convert("RGB"))
    np.testing.assert_array_equal(decoded, np.array(palette, np.uint8)[canvas.dots])
    assert tuple(decoded[19, 0]) == (255, 0, 0) and tuple(decoded[10, 20]) == (0, 255, 0)
    rows = canvas.braille()
    assert len(rows) == 5 and len(rows[0]) == 20 and rows[4][0] == ("⡀", 1)
