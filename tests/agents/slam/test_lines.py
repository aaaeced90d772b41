"""Scans laid on one another: what a match tells, what it does not, and how long the way is then."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from tms_agents.simulation import semidynamic_plans
from tms_agents.simulation.semidynamic_drive import Devices, record
from tms_agents.simulation.semidynamic_plans import Plan
from tms_agents.slam import Log, Settings, read_log
from tms_agents.slam.geometry import Floats, between
from tms_agents.slam.lines import Lines, lines_of, match_lines
from tms_agents.slam.motion import OdometryNoise
from tms_agents.slam.polishing import polish
from tms_agents.slam.posegraph import Edges
from tms_agents.slam.wheels import wheels_of

LENGTH = 26.0


def corridor(at: float, end: float, seed: int) -> Lines:
    """Of a laser ``at`` so many m along a corridor that is closed at ``end``."""
    angles = np.radians(np.linspace(-90, 90, 361))
    with np.errstate(divide="ignore"):
        ranges = np.minimum(1.1 / np.abs(np.sin(angles)), (end - at) / np.maximum(np.cos(angles), 1e-9))
    ranges = np.where(ranges < 8.0, ranges + np.random.default_rng(seed).normal(0, 0.012, 361), 8.191)
    one = np.zeros((1, 3))
    return lines_of(Log(np.zeros(1), one, one[:, :2], ranges[None], angles, 8.0, np.zeros(3)), 0)


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("way", [0.1, 0.4, 0.8])
def test_along_a_bare_corridor_scans_tell_nothing(seed: int, way: float) -> None:
    start = np.array([way - 0.03, 0.01, 0.005])
    pose, information, share = match_lines(corridor(0.0, 99.0, seed), corridor(way, 99.0, seed + 50), start, 0.25, 0.02)
    assert share > 0.8
    assert np.abs(pose[1:]).max() < 0.005
    assert information[1, 1] > 1e4
    assert information[0, 0] < 1e-3 * information[1, 1]


@pytest.mark.parametrize("seed", range(5))
def test_where_its_end_is_in_view_they_do(seed: int) -> None:
    start = np.array([0.37, 0.01, 0.005])
    pose, information, _ = match_lines(corridor(0.0, 5.0, seed), corridor(0.4, 5.0, seed + 50), start, 0.25, 0.02)
    assert abs(pose[0] - 0.4) < 0.01
    assert information[0, 0] > 1e4


@pytest.mark.parametrize("scale", [0.95, 1.0, 1.03])
def test_the_metre_of_odometry_is_measured_by_matches_that_hold(scale: float) -> None:
    random = np.random.default_rng(3)
    count = 400
    odometry = np.column_stack([0.1 * np.arange(count + 4) / scale, np.zeros((count + 4, 2))])
    start = np.arange(count)
    seen = np.column_stack([0.4 + random.normal(0, 0.006, count), np.zeros((count, 2))])
    seen[::9, 0] -= 0.2
    # What does not hold tells wrongly.
    seen[1::3, 0] = 0.3
    information = np.tile(1e5 * np.eye(3), (count, 1, 1))
    information[1::3, 0, 0] = 1.0
    wheels = wheels_of(Edges(start, start + 4, seen, information), odometry, OdometryNoise())
    assert wheels.scale == pytest.approx(scale, abs=0.004)
    assert 0.0015 < wheels.noise.least_m < 0.005
    few = Edges(start[:30], start[:30] + 4, seen[:30], information[:30])
    assert wheels_of(few, odometry, OdometryNoise()).noise == OdometryNoise()


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> tuple[Log, Floats]:
    """To and fro along a bare corridor whose ends are out of view in the middle, and the true path."""
    folder: Path = tmp_path_factory.mktemp("bare")
    route = np.array([(1.0, 1.15), (LENGTH - 1.0, 1.15), (1.0, 1.15)])
    with pytest.MonkeyPatch.context() as patch:
        patch.setitem(semidynamic_plans.PLANS, "bare", lambda _: Plan([(0.0, 0.0, LENGTH, 2.3)], route, passes=1))
        record("bare", 1, folder, Devices(scale=0.03))
    poses = np.array(json.loads((folder / "truth.json").read_text())["scan_poses"])[:, 1:]
    return read_log(folder / "stream.jsonl.gz"), poses


def test_a_bare_stretch_is_as_long_as_odometry_says_once_it_is_measured(log: tuple[Log, Floats]) -> None:
    recorded, truth = log
    # As a mapper leaves it: short where nothing tells how far the robot went.
    short = truth.copy()
    short[:, 0] -= 0.04 * np.clip(truth[:, 0] - 9.0, 0.0, 8.0)
    path = polish(recorded, short, Settings().noise)
    off = between(path[:1], path) - between(truth[:1], truth)
    assert np.abs(short - truth)[:, 0].max() > 0.3
    assert np.abs(off[:, 0]).max() < 0.12
