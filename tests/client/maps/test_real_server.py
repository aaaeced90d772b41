"""Maps through the library and ``tms map`` against the real server; blocking and awaited alike."""

from __future__ import annotations

import contextlib
import io
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import map_server
import numpy as np
import pytest
from PIL import Image
from server_process import ServerProcess

import tms_client
from tms_client import AsyncTown, Town, cli
from tms_client.maps import sending
from tms_client.maps.cells import Intensity
from tms_schemas.maps import MapIn, MapObject
from tms_schemas.rooms import RoomIn

DOOR = MapObject(tag="E1", x=1.0, y=2.0, theta=0.5, state="open")


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[ServerProcess]:
    with ServerProcess(tmp_path_factory.mktemp("server")) as server:
        yield server


@pytest.fixture
def town(server: ServerProcess, request: pytest.FixtureRequest) -> Iterator[Town]:
    with Town(server.url) as town:
        town.rooms.put("lab", RoomIn.model_validate({"name": "Lab", "outline": [[0, 0], [5, 0], [5, 4], [0, 4]]}))
        town.maps.put("corridor", MapIn(room="lab", resolution=0.05, origin=(-1.0, 0.5), map_to_room=(1, 2, 0.5)))
        yield town
        with contextlib.suppress(tms_client.NotFound):
            town.maps.delete("corridor")


def room(shape: tuple[int, int] = (120, 200)) -> np.ndarray:
    """Four walls around free floor."""
    cells = np.full(shape, 0.05)
    cells[[0, -1], :] = cells[:, [0, -1]] = 0.95
    return cells


def close(got: np.ndarray, put: np.ndarray) -> None:
    np.testing.assert_allclose(got, put, atol=0.5 / 254 + 1e-6)


def size(picture: bytes) -> tuple[int, int]:
    return Image.open(io.BytesIO(picture)).size


def test_a_map_is_uploaded_fetched_and_followed(town: Town) -> None:
    robot, cells = town.map("corridor"), room()
    assert robot.version == 0 and robot.occupancy.size == 0 and not robot.update()
    made = town.maps.upload("corridor", cells, (-1.0, 0.5), agent="robot", objects=[DOOR], note="first")
    assert (made.version, made.changed, made.agent, made.note) == (1, 8, "robot", "first")
    assert robot.update() and not robot.update()
    assert (robot.name, robot.room, robot.version, robot.resolution) == ("corridor", "lab", 1, 0.05)
    assert robot.origin == pytest.approx((-1.0, 0.5)) and robot.map_to_room == (1, 2, 0.5)
    assert robot.objects == [DOOR] and robot.intensity is None
    close(robot.occupancy, cells)
    assert robot.at(-0.99, 0.51) == pytest.approx(0.95, abs=0.01)
    assert robot.at(0.0, 1.0) == pytest.approx(0.05, abs=0.01)
    assert np.isnan(robot.at(-1.01, 1.0)) and np.isnan(robot.at(100.0, 1.0))

    # The map grows to the left and below: the arrays grow, their origin moves, only new and changed tiles travel.
    grown = np.pad(cells, ((80, 0), (70, 0)), constant_values=np.nan)
    grown[0, 0] = 0.5
    made = town.maps.upload("corridor", grown, (-1.0 - 70 * 0.05, 0.5 - 80 * 0.05), agent="robot")
    assert made.changed == 1
    assert robot.update() and robot.objects == [DOOR]
    close(robot.occupancy, grown)
    assert robot.origin == pytest.approx((-4.5, -3.5))
    close(town.map("corridor", version=1).occupancy, cells)
    with pytest.raises(tms_client.NotFound):
        town.map("corridor", version=3)


def test_the_traffic_of_a_driving_robot(town: Town, monkeypatch: pytest.MonkeyPatch) -> None:
    """What goes over the wire is the changed tiles, both ways."""
    sent: list[int] = []
    got: list[int] = []
    pack, unpack = sending.pack, tms_client.maps.view.unpack
    monkeypatch.setattr(sending, "pack", lambda planes: sent.append(1) or pack(planes))
    monkeypatch.setattr(tms_client.maps.view, "unpack", lambda data: got.append(1) or unpack(data))
    cells = np.random.default_rng(1).random((640, 640))
    town.maps.upload("corridor", cells, (-1.0, 0.5), agent="robot")
    robot = town.map("corridor")
    assert (len(sent), len(got)) == (100, 100)
    cells[5, 5] = 1 - cells[5, 5]
    cells[600, 5] = np.nan
    town.maps.upload("corridor", cells, (-1.0, 0.5), agent="robot")
    robot.update()
    assert (len(sent), len(got)) == (102, 102)
    close(robot.occupancy, cells)
    town.maps.upload("corridor", cells[:64], (-1.0, 0.5), agent="robot", whole=False)
    assert town.maps.get("corridor").version == 2
    town.maps.upload("corridor", cells[:64], (-1.0, 0.5), agent="robot")
    robot.update()
    assert len(got) == 102 and robot.occupancy.shape == (64, 640)


def test_a_large_map_goes_in_parts_and_appears_at_once(town: Town, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sending, "_MOST_CHARACTERS", 100_000)
    random = np.random.default_rng(2)
    cells, count = random.random((300, 300)), random.integers(1, 9, (300, 300)).astype(np.uint32)
    light = Intensity(*(random.random((2, 300, 300)) * 1000).astype(np.float32), count)
    made = town.maps.upload("corridor", cells, (-1.0, 0.5), agent="robot", intensity=light)
    assert made.changed == 25
    found = town.map("corridor")
    assert found.version == 1 and found.intensity is not None
    np.testing.assert_array_equal(found.intensity.mean, light.mean)
    np.testing.assert_array_equal(found.intensity.variance, light.variance)
    np.testing.assert_array_equal(found.intensity.count, count)
    assert size(town.maps.png("corridor", layer="mean")) == (300, 300)


def test_two_robots_do_not_overwrite_each_other(town: Town, server: ServerProcess) -> None:
    cells = room()
    town.maps.upload("corridor", cells, (-1.0, 0.5), agent="a")
    with Town(server.url) as other:
        other.maps.upload("corridor", np.where(cells > 0.5, 0.0, cells), (-1.0, 0.5), agent="b")
    cells[60, 60] = 1.0
    for _ in range(2):  # it stays one until the robot has looked
        with pytest.raises(tms_client.Conflict, match="newest version"):
            town.maps.upload("corridor", cells, (-1.0, 0.5), agent="a")
    newest = town.map("corridor").version
    assert town.maps.upload("corridor", cells, (-1.0, 0.5), agent="a", base=newest).version == 3
    close(town.map("corridor").occupancy, cells)


def test_a_map_made_anew_is_fetched_anew(town: Town) -> None:
    robot = town.map("corridor")
    for _ in range(3):
        about = town.maps.get("corridor")
        for value in (0.2, 0.8):
            town.maps.upload(
                "corridor", np.full((3, 4), value), (-1.0, 0.5), agent="a", base=town.maps.get("corridor").version
            )
        assert robot.update()
        close(robot.occupancy, np.full((3, 4), 0.8))
        town.maps.delete("corridor")
        with pytest.raises(tms_client.NotFound):
            robot.update()
        town.maps.put("corridor", MapIn(**about.model_dump(include=set(MapIn.model_fields))))


def test_bad_arrays_are_refused_before_they_travel(town: Town) -> None:
    with pytest.raises(tms_client.TownError, match="off the grid"):
        town.maps.upload("corridor", room(), (-0.98, 0.5), agent="a")
    assert town.maps.upload("corridor", room(), (-0.98, 0.5), agent="a", snap=True).version == 1
    with pytest.raises(tms_client.TownError, match="probability"):
        town.maps.upload("corridor", room() * 2, (-1.0, 0.5), agent="a")
    with pytest.raises(tms_client.NotFound):
        town.maps.upload("nowhere", room(), (0, 0), agent="a")


def test_versions_differences_and_files(town: Town) -> None:
    cells = room()
    town.maps.upload("corridor", cells, (-1.0, 0.5), agent="a", objects=[DOOR])
    cells[50, 50] = 0.95
    closed = DOOR.model_copy(update={"state": "closed"})
    town.maps.upload("corridor", cells, (-1.0, 0.5), agent="a", objects=[closed])
    assert [one.version for one in town.maps.versions("corridor")] == [2, 1]
    assert [one.id for one in town.maps.list("lab")] == ["corridor"]
    assert (town.maps.objects("corridor", 1), town.maps.objects("corridor")) == ([DOOR], [closed])
    diff = town.maps.diff("corridor", 1)
    assert (diff.became_occupied, diff.became_free, len(diff.tiles)) == (1, 0, 1)
    assert [(one.before, one.after) for one in diff.objects] == [(DOOR, closed)]
    assert size(town.maps.diff_png("corridor", 1, 2)) == (200, 120)
    grid = map_server.load(town.maps.yaml("corridor", 1, mode="raw"), town.maps.pgm("corridor", 1, mode="raw"))
    np.testing.assert_allclose(grid.data / 100, room(), atol=0.011)


async def test_the_same_awaited(town: Town, server: ServerProcess) -> None:
    cells = room()
    async with AsyncTown(server.url) as awaited:
        robot = await awaited.map("corridor")
        assert (await awaited.maps.upload("corridor", cells, (-1.0, 0.5), agent="a", objects=[DOOR])).version == 1
        assert await robot.update() and not await robot.update()
        close(robot.occupancy, cells)
        cells[3, 3] = 1
        assert (await awaited.maps.upload("corridor", cells, (-1.0, 0.5), agent="a")).changed == 1
        assert [one.version async for one in awaited.maps.versions("corridor")] == [2, 1]
        assert [one.id async for one in awaited.maps.list()] == ["corridor"]
        assert (await awaited.maps.get("corridor")).version == 2
        assert (await awaited.maps.objects("corridor")) == [DOOR]
        assert (await awaited.maps.diff("corridor", 1)).became_occupied == 1
        for file in (awaited.maps.png("corridor"), awaited.maps.pgm("corridor"), awaited.maps.diff_png("corridor", 1)):
            assert len(await file) > 100
        assert "resolution: 0.05" in await awaited.maps.yaml("corridor")
        await awaited.maps.put("second", MapIn(room="lab", resolution=0.1))
        await awaited.maps.delete("second")


def test_viewers_of_the_room_are_told(town: Town) -> None:
    with contextlib.closing(town.live("lab", events=["registry"])) as frames:
        assert next(frames).type == "snapshot"
        town.maps.upload("corridor", room(), (-1.0, 0.5), agent="a")
        told = next(frame.event for frame in frames if frame.type == "event")
    assert told == {"type": "map_changed", "map": "corridor", "version": 1}


def test_the_light_install_needs_no_numpy(monkeypatch: pytest.MonkeyPatch, town: Town) -> None:
    code = "import sys, tms_client, tms_client.maps.blocking; print('numpy' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, timeout=60)
    assert done.stdout == "False\n"
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    for call in (lambda: town.map("corridor"), lambda: town.maps.upload("corridor", [[0.5]], (0, 0), agent="a")):
        with pytest.raises(tms_client.TownError, match=r"pip install .*\[maps\]"):
            call()


def folder_of(path: Path, cells: np.ndarray, origin: tuple[float, float] = (3.0, -2.0)) -> Path:
    """As ``tms slam run`` writes it."""
    path.mkdir(exist_ok=True)
    values = np.where(np.isnan(cells), 205, np.where(cells > 0.65, 0, 254)).astype(np.uint8)
    (path / "map.pgm").write_bytes(b"P5\n%d %d\n255\n" % cells.shape[::-1] + values[::-1].tobytes())
    (path / "map.yaml").write_text(
        f"image: map.pgm\nmode: trinary\nresolution: 0.05\norigin: [{origin[0]}, {origin[1]}, 0.0]\nnegate: 0\n"
        "occupied_thresh: 0.65\nfree_thresh: 0.196\n"
    )
    np.save(path / "map.npy", cells.astype(np.float32))
    return path


def test_the_command(town: Town, server: ServerProcess, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    def tms(*arguments: object) -> str:
        assert cli.main(["map", *map(str, arguments), "--url", server.url]) == 0
        return capsys.readouterr().out

    cells = room()
    source = folder_of(tmp_path / "run", cells)
    upload = ("upload", source, "--map", "hall", "--room", "lab", "--name", "the hall", "--map-to-room", "1,2,0.5")
    assert tms(*upload, "--note", "first") == "hall: version 1, 8 tiles changed\n"
    assert tms(*upload) == "hall: nothing changed since version 1\n"
    cells[7, 7] = 0.9
    np.save(folder_of(source, cells) / "imap.npy", np.where(cells > 0.5, 300.0, np.nan))
    assert "version 2" in tms("upload", source, "--map", "hall")
    assert tms("list") == "corridor  room lab  version 0  0.05 m\nhall  room lab  version 2  0.05 m  the hall\n"
    assert [line.split()[0] for line in tms("versions", "hall").splitlines()] == ["2", "1"]

    out = tmp_path / "out"
    assert tms("get", "hall", "--out", out) == f"hall version 2: 200 x 120 cells of 0.05 m in {out}\n"
    close(np.load(out / "map.npy"), cells)
    light = np.load(out / "imap.npy")
    np.testing.assert_array_equal(light[0], np.where(cells > 0.5, 300.0, np.nan))
    grid = map_server.load((out / "map.yaml").read_text(), (out / "map.pgm").read_bytes())
    assert grid.origin[:2] == pytest.approx((3.0, -2.0))
    np.testing.assert_array_equal(grid.data == 100, cells > 0.65)
    assert size((out / "map.png").read_bytes()) == (200, 120)
    assert tms("upload", out, "--map", "hall") == "hall: nothing changed since version 2\n"
    assert "version 1" in tms("get", "hall", "--out", tmp_path / "old", "--version", 1)
    assert np.load(tmp_path / "old" / "map.npy")[7, 7] < 0.5 and not (tmp_path / "old" / "imap.npy").exists()

    said = tms("diff", "hall", 1, 2, "--png", tmp_path / "diff.png")
    assert said.startswith("hall from version 1 to 2: 8 tiles changed; cells that became occupied 1, free 0, known 0")
    assert size((tmp_path / "diff.png").read_bytes()) == (200, 120)
    assert tms("upload", source / "map.yaml", "--map", "hall").startswith("hall: version 3")
    assert tms("delete", "hall") == ""


def test_the_command_says_in_one_line_what_is_wrong(
    town: Town, server: ServerProcess, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    good = folder_of(tmp_path / "good", room(), (-1.0, 0.5))
    fine = folder_of(tmp_path / "fine", room())
    (fine / "map.yaml").write_text((fine / "map.yaml").read_text().replace("0.05", "0.02"))
    off = folder_of(tmp_path / "off", room(), (-0.98, 0.5))
    (tmp_path / "file").touch()
    for arguments, says in (
        (["upload", tmp_path / "none", "--map", "corridor"], "No such file"),
        (["upload", tmp_path, "--map", "corridor"], "map.yaml"),
        (["upload", good, "--map", "new"], "--room"),
        (["upload", good, "--map", "new", "--room", "nowhere"], "nowhere"),
        (["upload", good, "--map", "a b", "--room", "lab"], "map"),
        (["upload", good, "--map", "new", "--room", "lab", "--map-to-room", "1,2"], "no pose"),
        (["upload", fine, "--map", "corridor"], "cells of 0.05 m"),
        (["upload", off, "--map", "corridor"], "off the grid"),
        (["upload", good, "--map", "corridor", "--agent", "a b"], "agent"),
        (["upload", good, "--map", "corridor", "--note", "x" * 1001], "note"),
        (["get", "corridor", "--out", tmp_path / "x"], "nothing in it"),
        (["get", "nowhere", "--out", tmp_path / "x"], "nowhere"),
        (["get", "corridor", "--out", tmp_path / "x", "--version", "9"], "no version 9"),
        (["diff", "corridor", "0", "5"], "no version 5"),
        (["diff", "corridor", "x"], "invalid int"),
        (["versions", "nowhere"], "nowhere"),
        (["delete", "nowhere"], "nowhere"),
    ):
        assert cli.main(["map", *map(str, arguments), "--url", server.url]) == 2, arguments
        out, err = capsys.readouterr()
        assert out == "" and err.startswith("tms: ") and err.count("\n") == 1 and says in err, (arguments, err)
    assert cli.main(["map", "upload", str(good), "--map", "corridor", "--url", server.url]) == 0
    capsys.readouterr()
    assert cli.main(["map", "get", "corridor", "--out", str(tmp_path / "file"), "--url", server.url]) == 2
    assert "File exists" in capsys.readouterr().err


def test_the_example(server: ServerProcess) -> None:
    """A robot maps while it drives, another one follows; the door that was closed is in the difference."""
    program = Path(__file__).resolve().parents[3] / "examples" / "map_while_driving.py"
    done = subprocess.run(
        [sys.executable, str(program), "--url", server.url], capture_output=True, text=True, check=True, timeout=150
    )
    *versions, last = done.stdout.splitlines()
    assert [line.split(":")[0] for line in versions] == [f"version {n + 1}" for n in range(len(versions))]
    assert re.fullmatch(r"since version \d+: 2\d cells became occupied; E00401504D4F4F52 closed", last)
    with Town(server.url) as town:
        ward = town.map("ward")
        assert ward.at(8.5, 3.58) > 0.65 > 0.196 > ward.at(2.5, 3.55)  # one door is closed, the other open
        assert ward.intensity is not None and [one.state for one in ward.objects] == ["closed"]
        town.maps.delete("ward")
