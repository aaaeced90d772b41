"""``tms agent robot``: a recorded drive is mapped, its poses and its map are on a real server, across its restart."""

from __future__ import annotations

import math
import signal
import socket
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from server_process import ServerProcess

import tms_agents.robot
from tms_agents.config import read_config
from tms_agents.robot.config import RobotConfig
from tms_agents.simulation.building import Drive, carmen, drive
from tms_client import Town, cli
from tms_schemas.rooms import RoomIn, Sensor

START = (3.0, 4.0, 0.5)
ROOM = RoomIn(
    name="Building",
    outline=[(-50.0, -50.0), (50.0, -50.0), (50.0, 50.0), (-50.0, 50.0)],
    sensors=[Sensor(agent="mapper-1", kind="robot")],
)


@pytest.fixture
def config(tmp_path):
    (tmp_path / "drive.log").write_text("\n".join(carmen(drive("block", Drive(seed=3, step_m=0.6)))[:81]))

    def write(url, speed):
        path = tmp_path / "robot.toml"
        path.write_text(
            f"""
agent = "mapper-1"
room = "building"
server = {{ url = "{url}" }}
spool = {{ path = "mapper-1.spool" }}
source = {{ path = "drive.log", speed = {speed} }}
map = {{ id = "building", start = {list(START)}, every_s = 0.3, particles = 3 }}
"""
        )
        return path

    return write


def agent(path):
    return subprocess.Popen(
        [sys.executable, "-m", "tms_client", "agent", "robot", "--config", str(path)],
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    )


def poses(town):
    return [mover.xy for mover in town.movers("building").movers]


@pytest.mark.timeout(300)  # the mapper compiles where it never ran before
def test_poses_and_map_reach_the_server_across_its_restart(tmp_path, config):
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
    with ServerProcess(tmp_path / "data", port=port) as server:
        with Town(server.url) as town:
            town.rooms.put("building", ROOM)
        robot = agent(config(server.url, 10.0))
        with Town(server.url) as town:
            until = time.monotonic() + 200
            while time.monotonic() < until and (not list(town.maps.list("building")) or not poses(town)):
                time.sleep(0.1)
            first = poses(town)
            before = town.maps.get("building").version
        server.kill()
        time.sleep(1.0)
    with ServerProcess(tmp_path / "data", port=port) as server:
        told, _ = robot.communicate(timeout=120)
        assert robot.returncode == 0, told
        assert " 0 lost" in told
        told, _ = agent(config(server.url, 0)).communicate(timeout=200)  # sends what waited in the spool, too
        assert "0 refused by the server, 0 lost, 0 waiting" in told
        with Town(server.url) as town:
            found = town.map("building")
            last = poses(town)
        assert found.version > before
        assert found.map_to_room == START
        assert len(first) == len(last) == 1
        truth = drive("block", Drive(seed=3, step_m=0.6)).truth[:40]
        assert math.dist(last[0], START[:2]) == pytest.approx(math.dist(truth[-1, :2], truth[0, :2]), abs=0.3)
        assert np.isfinite(found.occupancy).sum() * found.resolution**2 > 40


@pytest.mark.timeout(300)
def test_a_second_run_goes_on_with_map_and_body(tmp_path, config):
    with ServerProcess(tmp_path / "data") as server:
        with Town(server.url) as town:
            town.rooms.put("building", ROOM)
            for run in (1, 2):
                told, _ = agent(config(server.url, 0)).communicate(timeout=200)
                assert "0 lost, 0 waiting" in told
                assert len(poses(town)) == 1, run
            # The same drive may end in the very map that is there, which makes no new version.
            assert f"map building is at version {town.maps.get('building').version}\n" in told
        robot = agent(config(server.url, 0.01))  # asked to stop in the middle
        assert robot.stdout is not None
        assert "log: connected: drive.log" in robot.stdout.readline()
        robot.send_signal(signal.SIGTERM)
        told, _ = robot.communicate(timeout=60)
        assert robot.returncode == 0
        assert "Traceback" not in told


@pytest.mark.parametrize("path", sorted((Path(tms_agents.robot.__file__).parent / "examples").glob("*.toml")))
def test_the_examples_are_valid(path):
    assert read_config(path, RobotConfig).map.id == "corridor"


@pytest.mark.parametrize(
    ("more", "says"),
    [("speed = -1", "source.speed"), ("kind = 'camera'", "source.kind"), ("", "nothing.log: No such file")],
)
def test_bad_input_is_one_clear_line(tmp_path, capsys, more, says):
    path = tmp_path / "robot.toml"
    path.write_text(
        f'agent = "m"\nroom = "r"\n[spool]\npath = "m.spool"\n[map]\nid = "m"\n[source]\npath = "nothing.log"\n{more}\n'
    )
    assert cli.main(["agent", "robot", "--config", str(path)]) == 2
    error = capsys.readouterr().err
    assert says in error
    assert error.count("\n") == 1
