"""The paper's experiment from simulated sensors over HTTP to the pies."""

from __future__ import annotations

import io
import os
import signal
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path

import httpx
import pytest
from server_process import ServerProcess

from tms_agents.simulation.demo import Plan, run
from tms_agents.simulation.terminal import Terminal
from tms_client import Town

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


@pytest.mark.parametrize("seed", [0, 1])
def test_the_pies_are_those_of_the_paper(tmp_path: Path, seed: int) -> None:
    terminal = Recorder()
    with ServerProcess(tmp_path) as server:
        assert run(Plan(url=server.url, once=True, speed=20.0, seed=seed), terminal)
        with Town(server.url) as town:
            objects = list(town.objects.search(room="demo"))
            assert len(objects) == 10
            assert all(one.weight_g is None and one.size_m is None for one in objects)
            assert town.where("お茶").name == "Tea bottle"
            assert not list(town.unknown_tags("demo"))
    for step, (found, wanted) in enumerate(zip(terminal.found, FIGURE_8, strict=True)):
        for number, pie in wanted.items():
            for place, p in pie.items():
                assert found[number][place] == pytest.approx(p, abs=0.02), f"step {step}, object {number}, {place}"


def test_weight_knows_before_the_tag_is_read(tmp_path: Path) -> None:
    terminal = Recorder()
    with ServerProcess(tmp_path) as server:
        assert run(Plan(url=server.url, once=True, speed=20.0, weights=True), terminal)
        with Town(server.url) as town:
            assert {one.weight_g for one in town.objects.search(room="demo")} >= {541.0, 318.0}
    before_the_read = terminal.found[5]
    assert before_the_read[4]["cabinet B"] == pytest.approx(1.0, abs=0.02)
    assert before_the_read[3]["floor"] == pytest.approx(1.0, abs=0.02)


@pytest.mark.parametrize("more", [[], ["--weights"]])
def test_once_leaves_after_the_story_and_writes_plain_text(tmp_path: Path, more: list[str]) -> None:
    done = tms_demo("--once", "--speed", "20", "--data-dir", str(tmp_path), *more)
    out, err = done.communicate(timeout=120)
    assert done.returncode == 0, err
    assert "Traceback" not in err
    assert out.startswith("The page: http://127.0.0.1:")
    assert "\x1b" not in out
    assert out.count("Tea bottle") == 7
    assert_stopped(out)


def test_ctrl_c_leaves_cleanly_and_stops_the_server(tmp_path: Path) -> None:
    demo = tms_demo("--speed", "20", "--data-dir", str(tmp_path))
    assert demo.stdout is not None
    out = demo.stdout.readline()
    for line in demo.stdout:
        if "lives on" in line:
            break
    demo.send_signal(signal.SIGINT)
    rest, err = demo.communicate(timeout=60)
    assert demo.returncode == 0
    assert "Traceback" not in rest + err
    assert_stopped(out)


def test_bad_input_is_one_line(tmp_path: Path) -> None:
    for arguments in (["--speed", "0"], ["--url", "http://127.0.0.1:1", "--port", "3"], ["--seed", "-1"]):
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


def assert_stopped(out: str) -> None:
    url = out.splitlines()[0].removeprefix("The page: ")
    with pytest.raises(httpx.TransportError):
        httpx.get(url + "healthz", timeout=2.0)
