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
from server_process import ServerProcess

from tms_agents.config import read_config
from tms_agents.robot.config import RobotConfig
from tms_agents.robot.objects_runner import robot_of
from tms_agents.robot.shapes import Shapes, model_of
from tms_agents.simulation.semidynamic_drive import record
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


@pytest.mark.timeout(400)  # the estimator compiles where it never ran before
def test_a_recording_becomes_a_map_with_doors(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    record("ward", 0, tmp_path)
    truth = json.loads((tmp_path / "truth.json").read_text())
    config = write(
        tmp_path / "robot.toml",
        f'agent = "mapper"\nroom = "ward"\nspool = {{ path = "m.spool" }}\n'
        f'map = {{ id = "ward", start = {truth["start_pose"]} }}\n'
        'source = { path = "stream.jsonl.gz", speed = 0 }\nobjects = { parked_s = 3.0 }\n',
    )
    with ServerProcess(tmp_path / "data") as server, Town(server.url) as town:
        town.rooms.put("ward", ROOM)
        models = [str(tmp_path / "models.json"), "--room", "ward", "--url", server.url]
        assert catalogue.main(["models", *models]) == 0
        assert "4 shapes stored, 4 of things that are new" in capsys.readouterr().out
        command = [sys.executable, "-m", "tms_client", "agent", "robot", "--config", str(config)]
        environment = {"TMS_URL": server.url}
        done = subprocess.run(
            command, capture_output=True, text=True, timeout=350, check=False, env=os.environ | environment
        )
        assert done.returncode == 0, done.stderr
        assert "0 lost, 0 waiting" in done.stdout
        newest = next(town.maps.versions("ward"))
        assert newest.note.startswith("the whole drive") and "4 objects" in newest.note
        doors = {door.tag: door for door in town.doors("ward")}
        for tag, one in truth["objects"].items():
            if one["door"] is None:
                continue
            last = one["poses"][-1]
            opened = (last["theta"] - one["door"]["closed_theta"] + np.pi) % (2 * np.pi) - np.pi
            assert doors[tag].state == ("open" if abs(opened) > np.radians(15) else "closed")
            assert doors[tag].angle == pytest.approx(opened, abs=np.radians(12))
            assert doors[tag].room_pose is not None
            assert np.hypot(doors[tag].room_pose[0] - last["x"], doors[tag].room_pose[1] - last["y"]) < 0.2
        assert {door.state for door in doors.values()} == {"open", "closed"}
        (mover,) = town.movers("ward").movers  # it came back to where it began
        assert mover.xy is not None
        assert np.hypot(*(np.array(mover.xy) - truth["trajectory"][-1][1:3])) < 0.15


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
    assert server.asked == ["B1", "B2", "B3", "B4", "B3", "B3"]
    assert len(said) == 3 and "where the tag is" in said[0]
    server.known |= {"B3": BIN, "B4": BIN}
    shapes.learn(["B3", "B4"])
    assert set(shapes.known) == {"B1", "B3"}
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
