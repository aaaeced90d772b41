"""The robot agent that maps with objects: shapes from the server, doors to the server, live or out of a recording."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.spatial import cKDTree
from server_process import ServerProcess

from tms_agents.config import read_config
from tms_agents.robot.config import RobotConfig
from tms_agents.robot.objects_runner import robot_of
from tms_agents.robot.shapes import Shapes, model_of
from tms_agents.simulation.semidynamic_drive import record
from tms_agents.slam.geometry import transform
from tms_agents.slam.logs import lines_of_file
from tms_client import NotFound, Town, Unreachable
from tms_client.cli import CommandError
from tms_client.commands import catalogue
from tms_schemas.objects import ObjectModel
from tms_schemas.problem import Problem
from tms_schemas.rooms import RoomIn, Sensor

ROOM = RoomIn(
    name="Ward",
    outline=[(-5.0, -5.0), (15.0, -5.0), (15.0, 8.0), (-5.0, 8.0)],
    sensors=[Sensor(agent="mapper", kind="robot")],
)
BASIC = 'agent = "mapper"\nroom = "ward"\n[spool]\npath = "m.spool"\n[map]\nid = "ward"\n'


def write(path: Path, text: str) -> Path:
    path.write_text(text)
    return path


def split(folder: Path) -> None:
    """``first.jsonl`` and ``second.jsonl`` of a recording in which the robot parked once."""
    passes = json.loads((folder / "truth.json").read_text())["passes"]
    lines = list(lines_of_file(folder / "stream.jsonl.gz"))
    first = [json.loads(line)["t"] <= passes[0][1] + 1 for line in lines]
    for name, wanted in (("first", True), ("second", False)):
        kept = [line for line, is_first in zip(lines, first, strict=True) if is_first is wanted]
        (folder / f"{name}.jsonl").write_text("".join(kept))


def drive(folder: Path, name: str, url: str, more: str) -> str:
    start = json.loads((folder / "truth.json").read_text())["start_pose"]
    config = write(
        folder / "robot.toml",
        f'agent = "mapper"\nroom = "ward"\nspool = {{ path = "m.spool" }}\nmap = {{ id = "ward", start = {start} }}\n'
        f'source = {{ path = "{name}.jsonl", speed = 0 }}\nobjects = {{ {more} }}\n',
    )
    command = [sys.executable, "-m", "tms_client", "agent", "robot", "--config", str(config)]
    done = subprocess.run(
        command, capture_output=True, text=True, timeout=350, check=False, env=os.environ | {"TMS_URL": url}
    )
    assert done.returncode == 0, done.stderr
    assert "0 lost, 0 waiting" in done.stdout
    return done.stderr


def check_doors(town: Town, truth: dict[str, Any], leg: int) -> set[str]:
    """They are where they were in that leg of the drive, and open as far."""
    doors = {door.tag: door for door in town.doors("ward")}
    for tag, one in truth["objects"].items():
        if one["door"] is None:
            continue
        there = one["poses"][leg]
        opened = (there["theta"] - one["door"]["closed_theta"] + np.pi) % (2 * np.pi) - np.pi
        assert doors[tag].state == ("open" if abs(opened) > np.radians(15) else "closed")
        assert doors[tag].angle == pytest.approx(opened, abs=np.radians(12))
        found = doors[tag].room_pose
        assert found is not None
        assert np.hypot(found[0] - there["x"], found[1] - there["y"]) < 0.2
    return {door.tag for door in doors.values() if door.state == "open"}


@pytest.mark.timeout(600)  # the estimator compiles where it never ran before
def test_the_map_of_a_first_drive_goes_on_in_the_second(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    record("ward", 4, tmp_path)
    split(tmp_path)
    truth = json.loads((tmp_path / "truth.json").read_text())
    with ServerProcess(tmp_path / "data") as server, Town(server.url) as town:
        town.rooms.put("ward", ROOM)
        models = [str(tmp_path / "models.json"), "--room", "ward", "--url", server.url]
        assert catalogue.main(["models", *models]) == 0
        assert "4 shapes stored, 4 of things that are new" in capsys.readouterr().out
        drive(tmp_path, "first", server.url, "parked_s = 3.0")
        before = town.map("ward")
        newest = next(town.maps.versions("ward"))
        assert newest.note.startswith("the whole drive") and "4 objects" in newest.note
        first = check_doors(town, truth, 0)
        (mover,) = town.movers("ward").movers
        assert mover.xy is not None
        assert np.hypot(*(np.array(mover.xy) - truth["trajectory"][-1][1:3])) < 0.15  # it came back

        said = drive(tmp_path, "second", server.url, "parked_s = 3.0, continues = true")
        assert f"goes on from version {before.version}" in said
        after = town.map("ward")
        assert check_doors(town, truth, 1) == {door.tag for door in town.doors("ward")} - first
        (mover,) = town.movers("ward").movers
        assert mover.xy is not None
        assert np.hypot(*(np.array(mover.xy) - truth["trajectory"][-1][1:3])) < 0.15
        # Walls are where they were: both drives saw them.
        assert after.map_to_room == before.map_to_room and after.version > before.version
        rows, columns = np.nonzero(before.occupancy > 0.65)
        places = np.array(before.origin) + (np.stack([columns, rows], axis=-1) + 0.5) * before.resolution
        rows, columns = np.nonzero(after.occupancy > 0.65)
        now = np.array(after.origin) + (np.stack([columns, rows], axis=-1) + 0.5) * after.resolution
        apart, _ = cKDTree(now).query(places)
        assert (apart < 0.05).mean() > 0.85
        assert np.isfinite(after.occupancy).sum() > 0.97 * np.isfinite(before.occupancy).sum()
        # The door that was opened left nothing where it was closed.
        for tag, one in truth["objects"].items():
            if one["door"] is not None and tag not in first:
                x, y, theta = (one["poses"][0][name] for name in ("x", "y", "theta"))
                start = np.array(truth["start_pose"])
                middle = np.array([[x + 0.35 * np.cos(theta), y + 0.35 * np.sin(theta)]]) - start[:2]
                turned = transform(np.array([0.0, 0.0, -start[2]]), middle)
                assert cKDTree(now).query(turned)[0][0] > 0.1
        moved = {one.tag for one in town.maps.diff("ward", before.version, least_rad=0.3, least_m=0.3).objects}
        assert {tag for tag, one in truth["objects"].items() if one["door"] is not None} <= moved


class Server:
    """Answers what is known of tags; an exception is raised."""

    def __init__(self, **models: Any) -> None:
        self.known, self.asked = models, []
        self.objects = self

    def model(self, tag: str) -> ObjectModel:
        self.asked.append(tag)
        problem = Problem(title="Not found", status=404, detail=f"there is no object {tag!r}")
        found = self.known.get(tag, NotFound(problem))
        if isinstance(found, Exception):
            raise found
        return ObjectModel.model_validate({"tag": tag, **found})


SQUARE = [(0.0, 0.0), (0.3, 0.0), (0.3, 0.3)]
BIN = {"class": "bin", "polygon": SQUARE, "tag_pose": (0.1, 0.0, 0.0)}


def test_the_server_is_asked_once_by_tag() -> None:
    now, said = [0.0], []
    server = Server(B1=BIN, B2=BIN | {"tag_pose": None}, B3=Unreachable("nobody answers"))
    shapes = Shapes(server, said.append, lambda: now[0])  # type: ignore[arg-type]
    for _ in range(3):
        shapes.learn(["B1", "B2", "B3", "B4"])
    assert set(shapes.known) == {"B1"} and shapes.known["B1"].kind == "bin"
    assert server.asked == ["B1", "B2", "B3", "B3", "B3"]  # while nobody answers, the rest waits
    assert len(said) == 2 and "where the tag is" in said[0]
    server.known["B3"] = BIN
    shapes.learn(["B3", "B4"])
    assert set(shapes.known) == {"B1", "B3"} and "B4" in said[-1]
    server.known["B4"] = BIN
    shapes.learn(["B4"])
    assert server.asked[-1] == "B4" and server.asked.count("B4") == 1
    now[0] = 61.0
    shapes.learn(["B4"])
    assert set(shapes.known) == {"B1", "B3", "B4"}


def test_what_has_no_parts_is_seen_as_its_polygon() -> None:
    chair = ObjectModel.model_validate({"tag": "C", **BIN, "parts": [SQUARE, SQUARE]})
    assert len(model_of(chair).parts) == 2
    assert np.array_equal(model_of(ObjectModel.model_validate({"tag": "B", **BIN})).parts[0], np.array(SQUARE))


@pytest.mark.parametrize(
    ("more", "says"),
    [
        ("", "give either source"),
        ('[source]\npath = "a.log"\n[objects]\n', "tag reads are in recordings only"),
        ('[source]\npath = "a.jsonl"\n[objects]\nparked_s = 0\n', "objects.parked_s"),
        (
            '[live]\nlaser = { kind = "scip", host = "h" }\nbase = { device = "/dev/ttyS0" }\n'
            'reader = { kind = "llrp", host = "h" }\nantennas = [{ number = 1, pose = [0, 0, 0] }]\n[objects]\n',
            "tell rounds",
        ),
        (
            '[live]\nlaser = { kind = "scip", host = "h" }\nbase = { device = "/dev/ttyS0" }\n'
            'reader = { kind = "llrp", host = "h", round_s = 0.1 }\nantennas = [{ number = 1, pose = [0, 0, 0] }]\n',
            r"add an \[objects\]",
        ),
    ],
)
def test_a_bad_configuration_is_one_line(tmp_path: Path, more: str, says: str) -> None:
    with pytest.raises(CommandError, match=says) as caught:
        read_config(write(tmp_path / "robot.toml", BASIC + more), RobotConfig)
    assert "\n" not in str(caught.value)


def test_a_recording_without_models_is_one_line(tmp_path: Path) -> None:
    text = BASIC + '[source]\npath = "a.jsonl"\n[objects]\n'
    config = read_config(write(tmp_path / "robot.toml", text), RobotConfig)
    assert config.source is not None and config.resolution == 0.02
    with pytest.raises(CommandError, match=r"a\.jsonl"):
        robot_of(config.source)
    write(tmp_path / "a.jsonl", "")
    with pytest.raises(CommandError, match=r"models\.json"):
        robot_of(config.source)
    write(tmp_path / "models.json", '{"robot": {}}')
    with pytest.raises(CommandError, match="laser_pose"):
        robot_of(config.source)
