"""The paper's filter of tags: what it finds, and the laws its parts keep."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from tms_agents.commands import slam
from tms_agents.slam.geometry import Floats, between, compose
from tms_agents.slam.gridmap import GridMap
from tms_agents.slam.semidynamic import Antenna, ObjectModel
from tms_agents.slam.semidynamic.paper import PaperSettings, PoseOf, TagFilter
from tms_agents.slam.semidynamic.paper.following import object_pose
from tms_agents.slam.semidynamic.paper.grid import RewrittenGrid
from tms_agents.slam.semidynamic.paper.resampling import residual
from tms_agents.slam.semidynamic.paper.tagfilter import in_range
from tms_agents.slam.semidynamic.shapes import surface
from tms_agents.slam.weights import normalised
from tms_client.cli import CommandError

ANTENNA = Antenna(np.zeros(3), 2.0, np.pi / 3)
BOX = np.array([[-0.2, -0.15], [0.2, -0.15], [0.2, 0.15], [-0.2, 0.15]])
BIN = ObjectModel("bin_box", (BOX,), np.array([0.0, -0.15, -np.pi / 2]))
ANGLES = np.linspace(-np.pi / 2, np.pi / 2, 181)


def beams_at(robot: Floats, thing: Floats) -> Floats:
    """(181, 2) of a laser at ``robot`` in a room, in which a box stands at ``thing``."""
    outline = between(robot, np.column_stack([surface(BIN, thing), np.zeros(len(surface(BIN, thing)))]))
    ahead, aside = np.maximum(np.cos(ANGLES), 1e-9), np.maximum(np.abs(np.sin(ANGLES)), 1e-9)
    ranges = np.minimum((4.0 - robot[0]) / ahead, 2.6 / aside)
    for x, y, _ in outline:
        k = int(np.rint((np.arctan2(y, x) + np.pi / 2) / (ANGLES[1] - ANGLES[0])))
        reach = float(np.hypot(x, y))
        if 0 <= k < len(ranges):
            ranges[k] = min(ranges[k], reach)
    return np.column_stack([ANGLES, ranges])


def followed(pose_of: PoseOf, seed: int, thing: Floats) -> TagFilter:
    one = TagFilter(BIN, PaperSettings(pose_of=pose_of), np.random.default_rng(seed))
    grid = RewrittenGrid(0.02)
    for step in range(25):
        robot = np.array([0.04 * step, 0.0, 0.0])
        beams = beams_at(robot, thing)
        grid.write(robot, beams[:, 1:] * np.column_stack([np.cos(ANGLES), np.sin(ANGLES)]), np.zeros(2))
        one.update(ANTENNA, robot, robot, np.zeros(3), beams, grid)
        assert one.weights.sum() == pytest.approx(1.0)
        assert 1.0 <= one.effective <= 1000.0
    return one


@pytest.mark.parametrize("pose_of", ["heaviest", "mean"])
def test_a_bin_is_found_the_same_way_each_time(pose_of: PoseOf) -> None:
    there = np.array([1.8, 0.5, -0.9])
    one, again = followed(pose_of, 3, there), followed(pose_of, 3, there)
    assert one.pose is not None and again.pose is not None
    assert np.array_equal(one.pose, again.pose)
    assert np.array_equal(one.tags, again.tags)
    found = object_pose(BIN, one.pose)
    assert np.hypot(*(found - there)[:2]) < 0.2


def test_without_a_scan_that_tells_more_nothing_converges() -> None:
    one = TagFilter(BIN, PaperSettings(), np.random.default_rng(0))
    blind = np.column_stack([ANGLES, np.zeros(len(ANGLES))])
    one.update(ANTENNA, np.zeros(3), np.zeros(3), np.zeros(3), blind, RewrittenGrid(0.02))
    assert one.pose is None


def test_the_first_particles_fill_the_range_of_the_antenna() -> None:
    seen_from = np.array([3.0, -1.0, 2.0])
    found = between(seen_from, in_range(ANTENNA, seen_from, 4000, np.random.default_rng(0)))
    reach = np.hypot(found[:, 0], found[:, 1])
    assert reach.max() < 1.3 * ANTENNA.reach
    # As many in the inner half of the area as in the outer.
    assert abs((reach < reach.max() / np.sqrt(2)).mean() - 0.5) < 0.05
    assert abs(np.exp(1j * found[:, 2]).mean()) < 0.05


def test_the_pose_of_the_object_follows_from_that_of_its_tag() -> None:
    thing = np.array([1.0, 2.0, 0.7])
    assert object_pose(BIN, compose(thing, BIN.tag)) == pytest.approx(thing)


@given(arrays(np.float64, st.integers(1, 60), elements=st.floats(-700, 700)))
def test_weights_sum_to_one(logarithms: Floats) -> None:
    weights = normalised(logarithms)
    assert weights.sum() == pytest.approx(1.0)
    assert (weights >= 0).all()


@settings(max_examples=50)
@given(arrays(np.float64, st.integers(1, 12), elements=st.floats(0.0, 1.0)), st.integers(0, 99))
def test_residual_resampling_keeps_the_expected_counts(raw: Floats, seed: int) -> None:
    weights = (raw + 1e-6) / (raw + 1e-6).sum()
    count, random, times = len(weights), np.random.default_rng(seed), 400
    counts = np.array([np.bincount(residual(weights, random), minlength=count) for _ in range(times)])
    assert (counts.sum(axis=1) == count).all()
    assert (counts >= np.floor(count * weights)).all()
    assert np.abs(counts.mean(axis=0) - count * weights).max() < 6 * np.sqrt(count / times)


def test_where_an_object_was_the_grid_is_empty_and_where_it_is_it_is_drawn() -> None:
    grid = RewrittenGrid(0.02)
    before, now = np.array([1.5, 0.0, 0.0]), np.array([1.5, 0.8, 0.4])
    seen = surface(BIN, before)
    grid.write(np.zeros(3), seen, np.zeros(2))
    grid.move(surface(BIN, before), surface(BIN, now))
    finished = grid.finished()
    assert not occupied(finished, seen).any()
    assert occupied(finished, surface(BIN, now)).all()


def occupied(grid: GridMap, points: Floats) -> np.ndarray[tuple[int], np.dtype[np.bool_]]:
    at = np.floor((points - np.array(grid.origin)) / grid.resolution).astype(int)
    found: np.ndarray[tuple[int], np.dtype[np.bool_]] = grid.probabilities()[at[:, 1], at[:, 0]] > 0.65
    return found


def test_a_choice_without_the_method_is_refused(tmp_path: Path) -> None:
    with pytest.raises(CommandError, match="--pose-of"):
        slam.main(["semidynamic", str(tmp_path / "a.jsonl"), "--out", str(tmp_path / "out"), "--pose-of", "mean"])


def test_the_command_writes_what_the_default_writes(tmp_path: Path) -> None:
    recording(tmp_path)
    out = tmp_path / "out"
    arguments = ["semidynamic", str(tmp_path / "stream.jsonl"), "--method", "paper", "--out", str(out)]
    assert slam.main(arguments) == 0
    result = json.loads((out / "result.json").read_text())
    assert len(result["trajectory"]) == 40
    (tag,) = result["objects"]
    assert np.hypot(result["objects"][tag]["x"] - 1.8, result["objects"][tag]["y"] - 0.5) < 0.2
    assert np.load(out / result["map"]["file"]).ndim == 2


def recording(folder: Path) -> None:
    """A robot comes near a box in a room."""
    thing = np.array([1.8, 0.5, -0.9])
    lines = []
    for n in range(40):
        t, robot = 0.2 * n, np.array([0.025 * n, 0.0, 0.0])
        lines += [
            {"t": t, "type": "odom", "x": robot[0], "y": 0.0, "theta": 0.0},
            {
                "t": t, "type": "scan", "angle_min": ANGLES[0], "angle_increment": ANGLES[1] - ANGLES[0],
                "range_max": 8.0, "ranges": beams_at(robot, thing)[:, 1].tolist(),
            },
            {"t": t + 0.01, "type": "rfid", "antenna": 0, "tags": [{"id": "A"}]},
        ]  # fmt: skip
    (folder / "stream.jsonl").write_text("".join(json.dumps(one) + "\n" for one in lines))
    antenna = {"id": 0, "pose": [0, 0, 0], "nominal_max_range": 2.0, "nominal_half_beam": np.pi / 3}
    tag = {"class": "bin_box", "parts": [BOX.tolist()], "tag_pose": BIN.tag.tolist()}
    robot_model = {"laser_pose": [0, 0, 0], "antennas": [antenna]}
    (folder / "models.json").write_text(json.dumps({"robot": robot_model, "tags": {"A": tag}}))
