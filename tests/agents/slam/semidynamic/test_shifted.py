"""Things that were all moved alike while the robot was parked pull its path along; what stays brings it back."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from tms_agents.simulation import semidynamic_plans
from tms_agents.simulation.semidynamic_drive import record
from tms_agents.simulation.semidynamic_plans import Plan
from tms_agents.slam import Log, Settings, read_log
from tms_agents.slam.geometry import Floats, between, transform
from tms_agents.slam.logs import odometry_at
from tms_agents.slam.polishing import legs_of, polish
from tms_agents.slam.semidynamic import Stay, Visit, parse_models
from tms_agents.slam.semidynamic.outlines import Outlines

LENGTH, SHIFT = 14.0, 0.35


def bare(random: np.random.Generator) -> Plan:
    """A corridor with three cabinets that are moved by the same way."""
    plan = Plan([(0.0, 0.0, LENGTH, 2.3)], np.array([(1.0, 1.15), (LENGTH - 1.0, 1.15), (1.0, 1.15)]), passes=2)
    for number, x in enumerate((3.5, 6.5, 9.5)):
        y = 0.3 if number % 2 else 2.0
        poses = [(x + SHIFT * k, y, 0.1) for k in range(2)]
        plan.things.append(semidynamic_plans._thing(f"cabinet_{number}", "cabinet", poses))
    return plan


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder: Path = tmp_path_factory.mktemp("shifted")
    with pytest.MonkeyPatch.context() as patch:
        patch.setitem(semidynamic_plans.PLANS, "bare", bare)
        record("bare", 1, folder)
    return folder


def pulled(truth: Floats, legs: NDArray[np.int64]) -> Floats:
    """As a path is that takes the cabinets for what does not move."""
    middle = np.clip(4 - np.abs(truth[:, 0] - LENGTH / 2 + 1), 0, 1) * (legs == 1)
    return truth - np.column_stack([SHIFT * middle, np.zeros((len(truth), 2))])


def true_stays(folder: Path, log: Log) -> dict[str, list[Stay]]:
    legs = legs_of(log.t)
    empty = np.zeros(0, dtype=np.int64)
    return {
        tag: [
            Stay(
                Visit(tag, empty, np.flatnonzero(legs == leg), np.zeros(2), 9, leg),
                np.array([at["x"], at["y"], at["theta"]]),
            )
            for leg, at in enumerate(thing["poses"])
        ]
        for tag, thing in json.loads((folder / "truth.json").read_text())["objects"].items()
    }


def test_a_path_that_was_pulled_along_is_brought_back_by_what_stays(folder: Path) -> None:
    log = read_log(folder / "stream.jsonl.gz")
    path = np.array(json.loads((folder / "truth.json").read_text())["trajectory"])
    truth = odometry_at(path[:, 0], path[:, 1:], log.t)
    models = parse_models((folder / "models.json").read_text())
    outlines = Outlines(log.t, true_stays(folder, log), models)
    before = pulled(truth, legs_of(log.t))

    def movable(n: int, points: Floats) -> NDArray[np.bool_]:
        return outlines.own(n, transform(truth[n], points), 0.2)

    def worst(poses: Floats) -> float:
        off = between(poses[:1], poses) - between(truth[:1], truth)
        return float(np.abs(off[:, 0]).max())

    assert worst(before) > 0.3
    assert worst(polish(log, before, Settings().noise)) > 0.2
    assert worst(polish(log, before, Settings().noise, movable)) < 0.1


def test_points_are_of_what_stood_there_then(folder: Path) -> None:
    log = read_log(folder / "stream.jsonl.gz")
    models = parse_models((folder / "models.json").read_text())
    outlines = Outlines(log.t, true_stays(folder, log), models)
    before, after = np.array([[3.2, 2.0]]), np.array([[3.2 + SHIFT, 2.0]])
    last = len(log) - 1
    assert outlines.own(0, before, 0.1)[0] and not outlines.own(0, before - 0.3, 0.1)[0]
    assert outlines.own(last, after, 0.1)[0] and not outlines.own(last, before, 0.1)[0]
    nothing = Outlines(log.t, {}, models)
    assert not nothing.own(0, before, 0.1).any()
