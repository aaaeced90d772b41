"""The demo of the robot: emulated wheels, laser and tag reader, the agent as a process, a real server."""

from __future__ import annotations

import io
import re
from pathlib import Path

import numpy as np
import pytest
from server_process import ServerProcess

from tms_agents.commands import demo
from tms_agents.simulation.demo import Plan
from tms_agents.simulation.robot_demo import run
from tms_agents.simulation.robot_stage import RobotStage
from tms_agents.simulation.semidynamic_plans import PLANS
from tms_agents.simulation.terminal import Terminal
from tms_client import Town
from tms_client.cli import CommandError


@pytest.mark.timeout(600)  # the estimator compiles where it never ran before
def test_a_map_grows_while_doors_are_moved(tmp_path: Path) -> None:
    """Whether every door is right depends on what was seen in time; that is tested with recordings."""
    said = io.StringIO()
    with ServerProcess(tmp_path) as server, Town(server.url) as town:
        run(Plan(url=server.url, once=True, speed=3.0), Terminal(said, colour=False))
        text = said.getvalue()
        areas = [float(area) for area in re.findall(r"version +\d+: +([\d.]+) m2 known", text)]
        assert len(areas) >= 2 and areas[-1] > areas[0] > 5.0
        assert len(re.findall(r"Door of room [12]: (?:open|closed|unknown|not seen)", text)) == 4
        doors = town.doors("demo")
        assert {one.name for one in doors} <= {"Door of room 1", "Door of room 2"} and doors
        assert all(one.map == "demo" and one.room_pose is not None for one in doors)
        (mover,) = town.movers("demo").movers
        assert mover.xy is not None and np.hypot(mover.xy[0] - 1.0, mover.xy[1] - 1.15) < 0.3
        assert [one.state for one in town.agents.list()] == ["silent"]  # it ended in order


def test_the_stage_drives_the_plan_in_its_own_time() -> None:
    now = [0.0]
    plan = PLANS["ward"](np.random.default_rng([0, 7]))
    stage = RobotStage(plan, [f"E{n}" for n in range(len(plan.things))], 0, 2.0, lambda: now[0])
    first = stage.closed
    assert stage.standing and stage.base.status().x == 0 and not stage.listened_to
    stage.drive()
    now[0] = 8.0
    assert not stage.standing
    stage.base.tick()
    assert stage.base.pose[0] > 2.0
    now[0] = 60.0
    assert stage.standing
    stage.drive()
    assert set(stage.closed.values()) == set(first.values()) == {True, False} and stage.closed != first


def test_options_of_the_other_story_are_refused() -> None:
    with pytest.raises(CommandError, match="--weights"):
        demo.main(["--robot", "--weights"])
