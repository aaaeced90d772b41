"""Recordings of corridors where doors and bins were moved meanwhile: path, map, and where everything stood."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial import cKDTree

from tms_agents.commands import slam
from tms_agents.simulation.semidynamic_drive import record
from tms_agents.slam import Log, Settings, build_map, read_log
from tms_agents.slam.geometry import Floats, between, compose
from tms_agents.slam.logs import lines_of_file, odometry_at
from tms_agents.slam.polishing import polish
from tms_agents.slam.semidynamic import Semidynamic, map_with_objects, parse_models, parse_rounds
from tms_agents.slam.semidynamic.shapes import surface
from tms_client.cli import CommandError


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder: Path = tmp_path_factory.mktemp("short")
    record("short", 2, folder)
    return folder


@pytest.fixture(scope="module")
def mapped(folder: Path) -> Semidynamic:
    return solved(folder)


def solved(folder: Path) -> Semidynamic:
    rounds, bad = parse_rounds(lines_of_file(folder / "stream.jsonl.gz"))
    assert bad == 0
    models = parse_models((folder / "models.json").read_text())
    return map_with_objects(read_log(folder / "stream.jsonl.gz"), rounds, models, Settings())


def true_path(folder: Path, log: Log) -> Floats:
    truth = np.array(json.loads((folder / "truth.json").read_text())["trajectory"])
    poses = odometry_at(truth[:, 0], truth[:, 1:], log.t)
    return between(poses[:1], poses)


def best_fit_error(path: Floats, truth: Floats) -> float:
    """Root mean square (m) after the best shift and turn."""
    a, b = (poses[:, 0] + 1j * poses[:, 1] for poses in (path, truth))
    a, b = a - a.mean(), b - b.mean()
    turn = np.vdot(a, b)
    return float(np.sqrt(np.mean(np.abs(a * turn / abs(turn) - b) ** 2)))


def misplaced(folder: Path, result: Semidynamic) -> tuple[int, int]:
    """Visits whose object is 0.2 m or 20 degrees off (round things may be turned), and all of them."""
    truth = json.loads((folder / "truth.json").read_text())
    log = read_log(folder / "stream.jsonl.gz")
    path = np.array(truth["trajectory"])
    start = odometry_at(path[:, 0], path[:, 1:], log.t[:1])
    wrong = every = 0
    for tag, stays in result.stays.items():
        for stay in stays:
            t = float(log.t[stay.visit.scans].mean())
            there = next(one for one in truth["objects"][tag]["poses"] if one["t0"] <= t < one["t1"])
            off = compose(start[0], stay.pose) - np.array([there["x"], there["y"], there["theta"]])
            turned = abs((off[2] + np.pi) % (2 * np.pi) - np.pi) > np.radians(20)
            every += 1
            wrong += bool(np.hypot(*off[:2]) > 0.2 or (turned and truth["objects"][tag]["class"] != "bin_round"))
    return wrong, every


def test_polishing_brings_the_path_within_two_centimetres(folder: Path) -> None:
    log = read_log(folder / "stream.jsonl.gz")
    truth = true_path(folder, log)
    shaken = truth + np.random.default_rng(1).normal(0, [0.03, 0.03, 0.006], truth.shape)
    shaken[0] = truth[0]
    assert best_fit_error(shaken, truth) > 0.035
    assert best_fit_error(polish(log, shaken, Settings().noise), truth) < 0.02


def test_everything_is_found_where_it_stood(folder: Path, mapped: Semidynamic) -> None:
    log = read_log(folder / "stream.jsonl.gz")
    off = np.hypot(*(mapped.poses - true_path(folder, log))[:, :2].T)
    assert float(np.sqrt(np.mean(off**2))) < 0.05
    wrong, every = misplaced(folder, mapped)
    assert every >= 10
    assert wrong == 0


def test_nothing_is_left_where_something_was(folder: Path, mapped: Semidynamic) -> None:
    models = parse_models((folder / "models.json").read_text())
    grid = mapped.grid
    rows, columns = np.nonzero(np.nan_to_num(grid.probabilities()) > 0.65)
    occupied = cKDTree(np.array(grid.origin) + (np.stack([columns, rows], axis=-1) + 0.5) * grid.resolution)
    moved = 0
    for tag, stays in mapped.stays.items():
        now = surface(models.objects[tag], stays[-1].pose)
        assert (occupied.query(now)[0] < 0.03).mean() > 0.95
        for stay in stays[:-1]:
            before = surface(models.objects[tag], stay.pose)
            others = [surface(models.objects[other], found[-1].pose) for other, found in mapped.stays.items()]
            clear = cKDTree(np.concatenate(others)).query(before)[0] > 0.15
            moved += bool(clear.any())
            # What is left may be a wall that the door touched.
            assert (occupied.query(before[clear])[0] < 0.03).mean() < 0.25 if clear.any() else True
    assert moved >= 2


def test_the_command_writes_the_same_again(folder: Path, mapped: Semidynamic, tmp_path: Path) -> None:
    assert slam.main(["semidynamic", str(folder / "stream.jsonl.gz"), "--out", str(tmp_path)]) == 0
    result = json.loads((tmp_path / "result.json").read_text())
    assert set(result["objects"]) == set(result["objects_history"]) == set(mapped.stays)
    assert [row[1:] for row in result["trajectory"]] == mapped.poses.tolist()
    for tag, stays in mapped.stays.items():
        assert [row[1:] for row in result["objects_history"][tag]] == [stay.pose.tolist() for stay in stays]
    cells = np.load(tmp_path / result["map"]["file"])
    assert np.array_equal(cells, mapped.grid.probabilities().astype(np.float32), equal_nan=True)
    assert json.loads((tmp_path / "stats.json").read_text())["visits"] == sum(map(len, mapped.stays.values()))


@pytest.mark.parametrize("name", ["a.log", "missing.jsonl", "stream.jsonl"])
def test_bad_input_is_one_line(name: str, tmp_path: Path) -> None:
    (tmp_path / "models.json").write_text("{}")
    (tmp_path / "stream.jsonl").write_text("{}\n")
    (tmp_path / "a.log").write_text("")
    with pytest.raises(CommandError) as caught:
        slam.main(["semidynamic", str(tmp_path / name), "--out", str(tmp_path / "out")])
    assert "\n" not in str(caught.value)
    assert not (tmp_path / "out").exists()


@pytest.mark.realdata
def test_the_sample_of_a_short_corridor(shared_data: Path) -> None:
    sample = shared_data / "robot" / "slamsd" / "short10_s1"
    assert misplaced(sample, solved(sample))[0] == 0


def test_a_path_is_found_in_a_room_with_furniture(tmp_path: Path) -> None:
    record("room", 3, tmp_path)
    log = read_log(tmp_path / "stream.jsonl.gz")
    poses = polish(log, build_map(log, Settings()).poses, Settings().noise)
    off = np.hypot(*(between(poses[:1], poses) - true_path(tmp_path, log))[:, :2].T)
    assert float(np.sqrt(np.mean(off**2))) < 0.05
