"""Whole drives: light tells how far one has come along a corridor; where it tells nothing it does no harm."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numba
import numpy as np
import pytest

from tms_agents.commands import slam
from tms_agents.simulation.coloured_drive import record
from tms_agents.slam import Settings, build_map, read_log
from tms_agents.slam.geometry import between
from tms_agents.slam.light.compared import build_compared
from tms_client.cli import CommandError


def longitudinal(recording, poses) -> float:
    """Root mean square (m) along the corridor, first poses laid on one another."""
    path = between(np.broadcast_to(poses[0], poses.shape), poses)
    truth = between(np.broadcast_to(recording.truth[0], recording.truth.shape), recording.truth)
    return float(np.sqrt(np.mean(np.square(path[:, 0] - truth[:, 0]))))


def test_colours_tell_how_far(coloured):
    recording, log = coloured
    geometry = build_map(log, Settings(particles=8))
    light = build_map(log, Settings(particles=8), light=True)
    assert longitudinal(recording, geometry.poses) > 0.3
    assert longitudinal(recording, light.poses) < 0.1
    assert geometry.light is None
    assert light.contrast is not None
    assert light.contrast > 3.0


def test_without_colours_no_worse_than_geometry(plain):
    recording, log = plain
    found = [
        np.mean(
            [longitudinal(recording, build_map(log, Settings(particles=8, seed=s), light=light).poses) for s in (0, 1)]
        )
        for light in (False, True)
    ]
    assert found[1] < 1.1 * found[0]


def test_any_number_of_threads_gives_the_same_bits(coloured):
    _, log = coloured
    few = replace(log, t=log.t[:120], odometry=log.odometry[:120], driven=log.driven[:120], ranges=log.ranges[:120])
    assert log.intensities is not None
    few = replace(few, intensities=log.intensities[:120])
    found = []
    for threads in (1, 2):
        numba.set_num_threads(min(threads, numba.config.NUMBA_NUM_THREADS))
        found.append(
            [
                build_map(few, Settings(particles=6), light=True).poses,
                build_compared(few, Settings(particles=60), method="paper", light=True).poses,
            ]
        )
    np.testing.assert_array_equal(found[0], found[1])


def test_the_paper_and_intensity_icp_use_light(coloured):
    recording, log = coloured
    errors = {
        (method, light): longitudinal(
            recording, build_compared(log, Settings(particles=200), method=method, light=light).poses
        )
        for method, light in (("icp", False), ("icp", True), ("paper", True))
    }
    assert errors["icp", True] < errors["icp", False]
    assert errors["paper", True] < 0.3


@pytest.fixture(scope="module")
def folder(tmp_path_factory, coloured) -> Path:
    found = tmp_path_factory.mktemp("light")
    recording, _ = coloured
    (found / "drive.jsonl").write_text("\n".join(recording.lines[:600]))
    (found / "models.json").write_text(recording.models)
    without = [json.loads(line) for line in recording.lines[:90]]
    for one in without:
        one.pop("intensities", None)
    (found / "dark.jsonl").write_text("\n".join(map(json.dumps, without)))
    return found


def test_files_of_a_run_with_light(folder, capsys):
    out = folder / "out"
    assert slam.main(["run", str(folder / "drive.jsonl"), "--out", str(out), "--particles", "4", "--intensity"]) == 0
    occupancy, light = np.load(out / "map.npy"), np.load(out / "imap.npy")
    assert light.shape == occupancy.shape
    seen = np.isfinite(light)
    assert (light[seen] > 0.0).all()
    assert seen[occupancy > 0.65].mean() > 0.9
    with np.load(out / "map.npz") as layers:
        np.testing.assert_allclose(np.exp(layers["light_mean"][seen]), light[seen], rtol=1e-5)
        assert ((layers["light_count"] > 0) == seen).all()
        assert (layers["light_variance"][seen] >= 0.0).all()
    document = json.loads((out / "result.json").read_text())
    assert document["intensity_map"] == {"file": "imap.npy"}
    assert (out / "imap.png").read_bytes().startswith(b"\x89PNG")
    assert json.loads((out / "stats.json").read_text())["light_contrast"] > 3.0


@pytest.mark.parametrize("options", [["--method", "paper", "--particles", "20"], ["--method", "icp"]])
def test_other_methods_write_the_same_files(folder, options):
    out = folder / options[1]
    assert slam.main(["run", str(folder / "drive.jsonl"), "--out", str(out), *options]) == 0
    assert (out / "trajectory.txt").exists()
    assert (out / "imap.npy").exists() == (options[1] == "paper")


@pytest.mark.parametrize("options", [["--intensity"], ["--method", "paper"], ["--method", "icp", "--intensity"]])
def test_without_light_in_the_log_one_clear_line(folder, options):
    with pytest.raises(CommandError, match="no received light intensity; --") as raised:
        slam.main(["run", str(folder / "dark.jsonl"), "--out", str(folder / "none"), *options])
    assert "\n" not in str(raised.value)


def test_a_drive_is_decided_by_its_seed():
    one, again, other = record("plain room", 3), record("plain room", 3), record("plain room", 4)
    assert one.lines == again.lines
    assert one.lines != other.lines


@pytest.mark.realdata
def test_sample_of_a_coloured_corridor(shared_data):
    folder = shared_data / "robot" / "intensity" / "corridor40_s1"
    log = read_log(folder / "stream.jsonl.gz")
    rows = np.array(json.loads((folder / "truth.json").read_text())["trajectory"])
    truth = np.stack([np.interp(log.t, rows[:, 0], column) for column in rows.T[1:3]], axis=-1)
    poses = build_map(log, Settings(), light=True).poses
    along = np.hypot(*(poses[:, :2] - poses[0, :2]).T) - np.hypot(*(truth - truth[0]).T)
    assert np.sqrt(np.mean(np.square(along))) < 0.2
