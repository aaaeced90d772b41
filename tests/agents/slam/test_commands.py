"""``tms slam``: files that a ROS map reader takes, numbers that agree, one clear line for bad input."""

from __future__ import annotations

import json
import struct
import zlib
from pathlib import Path

import numpy as np
import pytest

from tms_agents.commands import slam
from tms_agents.simulation.building import carmen
from tms_agents.slam.geometry import between
from tms_agents.slam.metric import agreement_with, read_trajectory, relations_of
from tms_client.cli import CommandError


@pytest.fixture(scope="module")
def done(tmp_path_factory, driven) -> Path:
    folder = tmp_path_factory.mktemp("slam")
    (folder / "drive.log").write_text("\n".join(carmen(driven)[:161]))
    arguments = ["run", str(folder / "drive.log"), "--out", str(folder / "out"), "--particles", "5", "--seed", "4"]
    assert slam.main(arguments) == 0
    return folder


def test_a_line_for_every_scan(done, log):
    rows = read_trajectory(done / "out" / "trajectory.txt")
    assert len(rows) == 80
    np.testing.assert_allclose(rows[:, 0], log.t[:80], atol=1e-6)
    stats = json.loads((done / "out" / "stats.json").read_text())
    assert stats["scans"] == 80
    assert stats["particles"] == 5
    assert stats["seconds"] > 0
    assert stats["real_time_factor"] > 0
    assert stats["peak_memory_mb"] > 0


def read_ros_map(yaml: Path) -> tuple[np.ndarray, float, list[float]]:
    """By the documentation of ROS map_server: (cells -1, 0..100 with row 0 lowest, resolution, origin)."""
    entries = dict(line.split(": ", 1) for line in yaml.read_text().splitlines())
    data = (yaml.parent / entries["image"]).read_bytes()
    magic, size, most, pixels = data.split(b"\n", 3)
    assert (magic, most) == (b"P5", b"255")
    width, height = map(int, size.split())
    grey = np.frombuffer(pixels, dtype=np.uint8).reshape(height, width)[::-1].astype(float)
    if entries["mode"] == "raw":
        cells = np.where(grey > 100, -1, grey)
    else:
        assert entries["negate"] == "0"
        occupied = (255 - grey) / 255
        cells = np.full(grey.shape, -1.0)
        cells[occupied > float(entries["occupied_thresh"])] = 100
        cells[occupied < float(entries["free_thresh"])] = 0
    return cells, float(entries["resolution"]), json.loads(entries["origin"])


def test_ros_reads_the_maps(done):
    out = done / "out"
    probabilities = np.load(out / "map.npy")
    trinary, resolution, origin = read_ros_map(out / "map.yaml")
    raw, _, raw_origin = read_ros_map(out / "map_raw.yaml")
    assert resolution == 0.05
    assert origin == raw_origin
    assert ((trinary == 100) == (probabilities > 0.65)).all()
    assert ((trinary == 0) == (probabilities < 0.5)).all()
    assert ((raw == -1) == np.isnan(probabilities)).all()
    known = raw >= 0
    np.testing.assert_allclose(raw[known] / 100, probabilities[known], atol=0.006)
    start = np.floor(-np.array(origin[:2]) / resolution + 1e-6).astype(int)
    assert trinary[start[1], start[0]] == 0  # the robot began there
    with np.load(out / "map.npz") as layers:
        np.testing.assert_array_equal(layers["occupancy"], probabilities)


def test_the_picture_is_a_png(done):
    data = (done / "out" / "map.png").read_bytes()
    assert data.startswith(b"\x89PNG\r\n\x1a\n")
    width, height = struct.unpack(">II", data[16:24])
    length = struct.unpack(">I", data[33:37])[0]
    assert data[37:41] == b"IDAT"
    assert len(zlib.decompress(data[41 : 41 + length])) == height * (1 + 3 * width)


def test_compare_looks_at_the_time_both_have(done, tmp_path, capsys):
    lines = (done / "out" / "trajectory.txt").read_text().splitlines()
    part = tmp_path / "part.txt"
    part.write_text("\n".join(lines[: len(lines) // 2]))
    assert slam.main(["compare", str(part), str(done / "out")]) == 0
    assert ": 0.0000 +- 0.0000 m" in capsys.readouterr().out
    late = tmp_path / "late.txt"
    late.write_text("99999 0 0 0\n100000 1 0 0\n")
    with pytest.raises(CommandError, match="no time in common"):
        slam.main(["compare", str(part), str(late)])


def test_compare_with_itself_and_with_relations(done, driven, capsys):
    out = done / "out"
    assert slam.main(["compare", str(out), str(out / "trajectory.txt")]) == 0
    assert " 0.0000 +- 0.0000 m" in capsys.readouterr().out
    assert (out / "compare.png").exists()
    truth = np.column_stack([driven.t, driven.truth])[:80]
    rows = [(a[0], b[0], *between(a[1:], b[1:])) for a, b in zip(truth[:-20:5], truth[20::5], strict=False)]
    lines = [f"{t1} {t2} {x} {y} 0 0 0 {theta}" for t1, t2, x, y, theta in rows]
    (done / "true.relations").write_text("\n".join(lines))
    assert slam.main(["compare", str(out), str(done / "true.relations")]) == 0
    said = capsys.readouterr().out
    assert said.startswith(f"{len(rows)} relations: 0.0")


def localised(done, *arguments):
    return slam.main(["localise", str(done / "drive.log"), "--particles", "5000", *arguments])


def test_the_drive_is_localised_in_its_own_map(done, capsys, monkeypatch):
    out = done / "found"
    assert localised(done, "--map", str(done / "out"), "--out", str(out)) == 0
    assert capsys.readouterr().out.startswith("localised after ")
    stats = json.loads((out / "stats.json").read_text())
    assert stats["localised"] and stats["converged_after_m"] > 1.5
    assert stats["particles"]["first"] > 10 * stats["particles"]["last"]
    believed, driven = read_trajectory(out / "trajectory.txt"), read_trajectory(done / "out" / "trajectory.txt")
    assert 40 < len(believed) < 80
    same = driven[np.searchsorted(driven[:, 0], believed[:, 0] - 1e-6)]
    assert np.median(np.hypot(*(same - believed)[:, 1:3].T)) < 0.05
    lines = (out / "estimates.txt").read_text().splitlines()[1:]
    assert len(lines) == 80
    assert sum(int(line.split()[4]) for line in lines) == len(believed)
    assert (out / "localised.png").read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize("file", ["map.npz", "map.yaml", "map_raw.yaml"])
def test_any_file_of_a_map_and_a_known_start(done, file, capsys):
    assert localised(done, "--map", str(done / "out" / file), "--start", "0.1,0.1,0") == 0
    assert float(capsys.readouterr().out.split()[2]) < 6.0


def test_who_is_not_localised_is_told_so(done, capsys, tmp_path):
    """A room of 4 m, empty, is another place than the building."""
    room = np.pad(np.zeros((76, 76)), 2, constant_values=1.0)
    np.savez(tmp_path / "map.npz", occupancy=room, origin=(0.0, 0.0), resolution=0.05)
    out = tmp_path / "out"
    assert localised(done, "--map", str(tmp_path / "map.npz"), "--out", str(out)) == 1
    assert capsys.readouterr().out.startswith("not localised; the best guess is")
    assert json.loads((out / "stats.json").read_text())["converged_after_m"] is None
    assert (out / "trajectory.txt").read_text().count("\n") == 1


def test_the_metric_is_that_of_the_definition():
    t = np.arange(60.0)
    path = np.column_stack([t, t, 0 * t, 0 * t])
    shifted = path + np.array([0.0, 5.0, 2.0, 0.0])
    stretched = path * np.array([1.0, 1.1, 1.0, 1.0])
    relations = relations_of(path)
    assert agreement_with(relations, shifted).translation == pytest.approx(0.0, abs=1e-9)
    lengths = relations[:, 2]
    assert agreement_with(relations, stretched).translation == pytest.approx(0.1 * lengths.mean())


@pytest.mark.parametrize(
    ("arguments", "why"),
    [
        (["run", "missing.log", "--out", "o"], "missing.log: No such file"),
        (["run", "empty.log", "--out", "o"], "empty.log: it holds no FLASER"),
        (["run", "other.txt", "--out", "o"], "other.txt: not a log"),
        (["run", "drive.log", "--out", "o", "--particles", "0"], "--particles"),
        (["run", "drive.log", "--out", "o", "--resolution", "7"], "--resolution"),
        (["run", "drive.log", "--out", "o", "--seed", "-1"], "--seed"),
        (["run", "drive.log", "--out", "o", "--models", "empty.log"], "models.json"),
        (["compare", "empty.log", "empty.log"], "empty.log"),
        (["compare", "missing", "missing"], "missing"),
        (["localise", "drive.log", "--map", "nowhere.yaml"], "nowhere.yaml"),
        (["localise", "drive.log", "--map", "empty.npz"], "empty.npz: no map"),
        (["localise", "drive.log", "--map", "out", "--particles", "1"], "--particles"),
        (["localise", "drive.log", "--map", "out", "--seed", "-1"], "--seed"),
        (["localise", "missing.log", "--map", "out"], "missing.log: No such file"),
        (["localise", "drive.log", "--map", "corridor", "--url", "http://127.0.0.1:1"], "127.0.0.1:1"),
    ],
)
def test_bad_input_is_one_clear_line(done, monkeypatch, arguments, why):
    monkeypatch.chdir(done)
    (done / "empty.log").write_text("")
    (done / "other.txt").write_text("x")
    (done / "empty.npz").write_bytes(b"")
    with pytest.raises(CommandError, match=why) as raised:
        slam.main(arguments)
    assert "\n" not in str(raised.value)
