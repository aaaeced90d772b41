"""Things that were all moved alike while the robot was parked pull its path along; what stays brings it back. Of those
whose tags are never read nothing is left where they were."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from tms_agents.simulation import semidynamic_plans
from tms_agents.simulation.semidynamic_drive import record
from tms_agents.simulation.semidynamic_plans import Plan
from tms_agents.slam import Log, Settings, read_log
from tms_agents.slam.geometry import Floats, between, transform
from tms_agents.slam.gridmap import GridMap, grid_map, render
from tms_agents.slam.keyframes import key_scans
from tms_agents.slam.logs import odometry_at
from tms_agents.slam.polishing import legs_of, polish
from tms_agents.slam.semidynamic import Models, Stay, Visit, parse_models
from tms_agents.slam.semidynamic.drawing import draw
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


def world(folder: Path) -> tuple[Log, Floats, Models]:
    """With the true path."""
    log = read_log(folder / "stream.jsonl.gz")
    path = np.array(json.loads((folder / "truth.json").read_text())["trajectory"])
    return log, odometry_at(path[:, 0], path[:, 1:], log.t), parse_models((folder / "models.json").read_text())


def drawn(grid: GridMap, points: Floats) -> float:
    """Share of ``points`` (N, 2) that is in the map."""
    rows, columns = np.nonzero(np.nan_to_num(grid.probabilities()) > 0.65)
    cells = np.array(grid.origin) + (np.stack([columns, rows], axis=-1) + 0.5) * grid.resolution
    return float((cKDTree(cells).query(points)[0] < 0.03).mean())


def sides(folder: Path, leg: int, sign: float) -> Floats:
    """Points on the faces of all cabinets at their near or far ends in the corridor, off the walls."""
    face = np.column_stack([np.full(8, sign * 0.22), np.linspace(-0.2, 0.2, 8)])
    things = json.loads((folder / "truth.json").read_text())["objects"].values()
    poses = [thing["poses"][leg] for thing in things]
    points = np.concatenate([transform(np.array([at["x"], at["y"], at["theta"]]), face) for at in poses])
    return points[(points[:, 1] > 0.25) & (points[:, 1] < 2.05)]


def test_of_a_nameless_thing_that_went_nothing_is_left_where_no_beam_passes_again(folder: Path) -> None:
    log, truth, models = world(folder)
    grid = draw(log, truth, {}, models, 0.02)
    # The far face of where a cabinet was is inside of where it is.
    assert drawn(grid, sides(folder, 0, 1.0)) < 0.1
    assert drawn(grid, sides(folder, 0, -1.0)) < 0.1
    assert drawn(grid, sides(folder, 1, 1.0)) > 0.9
    assert drawn(grid, sides(folder, 1, -1.0)) > 0.9


def test_what_was_not_read_again_has_gone_though_its_far_sides_are_hidden(folder: Path) -> None:
    log, truth, models = world(folder)
    begins = float(log.t[legs_of(log.t) == 1][0])
    stays = {
        tag: [replace(found[0], visit=replace(found[0].visit, ends=begins))]
        for tag, found in true_stays(folder, log).items()
    }
    # Beams that meet the near face of where a cabinet is now come from inside of where it was.
    grid = draw(log, truth, stays, models, 0.02)
    assert drawn(grid, sides(folder, 0, 1.0)) < 0.1
    assert drawn(grid, sides(folder, 0, -1.0)) < 0.1


def test_walls_stay_behind_what_was_moved_before_them(folder: Path) -> None:
    log, truth, models = world(folder)
    x = np.arange(1.5, LENGTH - 1.5, 0.02)
    walls = np.concatenate([np.column_stack([x, np.full(len(x), y)]) for y in (0.0, 2.3)])
    before = render_all(log, truth)
    assert drawn(draw(log, truth, {}, models, 0.02), walls) > drawn(before, walls) - 0.01


def test_what_nobody_moved_is_left_as_it_is(folder: Path) -> None:
    log, truth, models = world(folder)
    count = int((legs_of(log.t) == 0).sum())
    part = replace(
        log, t=log.t[:count], odometry=log.odometry[:count], driven=log.driven[:count], ranges=log.ranges[:count]
    )
    grid = draw(part, truth[:count], {}, models, 0.02)
    np.testing.assert_array_equal(grid.cells, render_all(part, truth[:count]).cells)


def render_all(log: Log, poses: Floats) -> GridMap:
    scans = key_scans(log, 0.1, 0.1)
    return grid_map(render(poses[scans], [log.points(int(n)) for n in scans], log.laser[:2], 0.02, 0.2), 0)
