"""The paper's experiment from simulated sensors over HTTP to the pies."""

from __future__ import annotations

import contextlib
import io
import math
import os
import re
import signal
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path

import httpx
import pytest
from server_process import ServerProcess

from tms_agents.simulation.catalogue import ITEMS
from tms_agents.simulation.demo import Plan, register, run
from tms_agents.simulation.floor_choice import why_no_laser
from tms_agents.simulation.room import START, new_world
from tms_agents.simulation.terminal import Terminal
from tms_client import Town
from tms_client.cli import CommandError
from tms_schemas.belief import OUTSIDE

HALF = {"floor": 0.5, "person": 0.5}
#: Figure 8 of the paper, by hand: object -> place -> probability, after each step.
FIGURE_8 = [
    {2: {"cabinet A": 1.0}, 3: {"cabinet A": 1.0}, 4: {"cabinet B": 1.0}},
    {2: {"person": 1.0}, 3: {"person": 1.0}, 4: {"person": 1.0}},
    {number: {"floor": 1 / 3, "person": 2 / 3} for number in (2, 3, 4)},
    {2: {"robot's hand": 1.0}, 3: HALF, 4: HALF},
    {2: {"table": 1.0}, 3: HALF, 4: HALF},
    {2: {"table": 1.0}, 3: {"floor": 0.5, "cabinet B": 0.5}, 4: {"floor": 0.5, "cabinet B": 0.5}},
    {2: {"table": 1.0}, 3: {"floor": 1.0}, 4: {"cabinet B": 1.0}},
]


class Recorder(Terminal):
    """Keeps the pies that the server answered."""

    def __init__(self) -> None:
        super().__init__(io.StringIO(), colour=False)
        self.found: list[Mapping[int, Mapping[str, float]]] = []

    def pies(self, found: Mapping[int, Mapping[str, float]], off: list[str]) -> None:
        self.found.append(found)
        super().pies(found, off)


def test_the_pies_are_those_of_the_paper(tmp_path: Path) -> None:
    terminal = Recorder()
    with ServerProcess(tmp_path) as server:
        assert run(Plan(url=server.url, once=True, speed=20.0), terminal)
        with Town(server.url) as town:
            objects = list(town.objects.search(room="demo"))
            assert len(objects) == 10
            assert all(one.weight_g is None and one.size_m is None for one in objects)
            assert town.where("お茶").name == "Tea bottle"
            assert not list(town.unknown_tags("demo"))
            assert town.anomalies("demo").anomalies == []
            assert_measured(town)
            register(town, Plan())  # as the next demo does in the same room
            places = town.where(ITEMS[2].tag).places
            assert [(one.label, one.p) for one in places] == [(OUTSIDE, pytest.approx(1.0))]
    for step, (found, wanted) in enumerate(zip(terminal.found, FIGURE_8, strict=True)):
        for number, pie in wanted.items():
            for place, p in pie.items():
                assert found[number][place] == pytest.approx(p, abs=0.02), f"step {step}, object {number}, {place}"


def assert_measured(town: Town) -> None:
    """Things are told where they stand, as far as boards and arm can tell."""
    world, off = new_world(), []
    for cabinet, numbers in START.items():
        for slot, number in enumerate(numbers):
            if number in (2, 3, 4):
                continue
            best = town.where(ITEMS[number].tag).best
            assert best is not None and best.xy is not None and best.cov is not None
            off.append(math.dist(best.xy, world.cabinets[cabinet].slots[slot]))
    # A light thing on a board one and a half metres long; a heavy one may be right to the tenth of a millimetre told.
    assert 0.0 < max(off) < 0.06
    mug = town.where(ITEMS[2].tag).best
    assert mug is not None and mug.xy is not None
    assert math.dist(mug.xy, (4.3, 2.5)) < 0.03, "forward kinematics of the arm"


def test_once_leaves_after_the_story_and_weight_knows_before_the_tag_is_read(tmp_path: Path) -> None:
    done = tms_demo("--once", "--speed", "20", "--port", "0", "--data-dir", str(tmp_path), "--weights", "--seed", "1")
    out, err = done.communicate(timeout=150)
    assert done.returncode == 0, out + err
    assert "Traceback" not in err
    assert out.startswith("The page: http://127.0.0.1:")
    assert "\x1b" not in out
    assert "floor: a floor sensor without device; the laser needs people who walk" in out
    assert out.count("Tea bottle") == 7
    assert "Every pie is as weighing tells, within 0.02." in out
    before_the_read = out[out.index("\n(5)") : out.index("\n(6)")]
    assert re.search(r"Medicine box .* cabinet B (99|100) %", before_the_read)
    assert re.search(r"Tea bottle .* floor (9[89]|100) %", before_the_read)
    assert_stopped(out)


@pytest.mark.timeout(400)
def test_a_laser_sees_the_floor(tmp_path: Path) -> None:
    """Raw scans of an emulated laser to the pies, as the demo is started by most."""
    done = tms_demo("--once", "--port", "0", "--data-dir", str(tmp_path))
    out, err = done.communicate(timeout=300)
    assert done.returncode == 0, out[-3000:] + err
    assert "Traceback" not in err
    assert re.search(r"floor: laser tcp 127\.0\.0\.1:\d+; tms agent floor --config", out)
    assert out.count("Tea bottle") == 7
    assert "Every pie is as in the paper, within 0.02." in out
    assert_stopped(out)


def test_the_laser_is_there_where_it_can_follow() -> None:
    def all_there(name: str) -> object:
        return name

    assert why_no_laser(None, 1.0, all_there) is why_no_laser(True, 1.2, all_there) is None
    assert "as asked for" in (why_no_laser(False, 1.0, all_there) or "")
    assert "--speed 0.5 to 1.25, not 20" in (why_no_laser(None, 20.0, all_there) or "")
    assert "--speed" in (why_no_laser(None, 0.1, all_there) or "")
    with pytest.raises(CommandError, match="--speed"):
        why_no_laser(True, 20.0, all_there)


def test_without_its_packages_the_laser_is_left_out_and_that_is_said() -> None:
    def no_scipy(name: str) -> object:
        return None if name == "scipy" else name

    assert "needs scipy: pip install" in (why_no_laser(None, 1.0, no_scipy) or "")
    with pytest.raises(CommandError, match="needs scipy"):
        why_no_laser(True, 1.0, no_scipy)


def test_ctrl_c_leaves_cleanly_and_stops_server_and_agents(tmp_path: Path) -> None:
    demo = tms_demo("--speed", "20", "--port", "0", "--data-dir", str(tmp_path))
    assert demo.stdout is not None
    out = ""
    for line in demo.stdout:
        out += line
        if line.startswith("Things are put"):
            break
    assert len(running(out)) == 4
    demo.send_signal(signal.SIGINT)
    rest, err = demo.communicate(timeout=60)
    assert demo.returncode == 0
    assert "Traceback" not in rest + err
    assert_stopped(out)


def test_an_agent_that_dies_is_named(tmp_path: Path) -> None:
    demo = tms_demo("--once", "--no-laser", "--port", "0", "--data-dir", str(tmp_path))
    assert demo.stdout is not None
    out = ""
    for line in demo.stdout:
        out += line
        if line.startswith("Things are put"):
            break
    cabinet_b = [number for number, command in running(out).items() if "cabinet-b" in command]
    os.kill(cabinet_b[0], signal.SIGKILL)
    _, err = demo.communicate(timeout=60)
    assert demo.returncode == 2
    assert "tms: agent cabinet-b ended with status -9" in err
    assert_stopped(out)


def test_bad_input_is_one_line(tmp_path: Path) -> None:
    for arguments in (
        ["--speed", "0"],
        ["--laser", "--speed", "20"],
        ["--url", "http://127.0.0.1:1", "--port", "3"],
        ["--seed", "-1"],
    ):
        done = tms_demo(*arguments)
        _, err = done.communicate(timeout=60)
        assert done.returncode == 2
        assert err.startswith("tms: ") and err.count("\n") == 1


def tms_demo(*arguments: str) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, "-m", "tms_client", "demo", *arguments],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env=os.environ | {"PYTHONUNBUFFERED": "1"},
    )


def running(out: str) -> dict[int, str]:
    """The processes of the agents that the demo named, by their numbers."""
    configs = re.findall(r"tms agent \w+ --config (\S+)", out)
    assert len(configs) == (5 if "tms agent floor" in out else 4)
    found = {}
    for entry in Path("/proc").iterdir():
        with contextlib.suppress(OSError):
            command = (entry / "cmdline").read_text().replace("\0", " ")
            if entry.name.isdigit() and any(f"--config {config} " in command for config in configs):
                found[int(entry.name)] = command
    return found


def assert_stopped(out: str) -> None:
    assert running(out) == {}
    url = out.splitlines()[0].removeprefix("The page: ")
    with pytest.raises(httpx.TransportError):
        httpx.get(url + "healthz", timeout=2.0)
