"""A map goes to a real server while it is made, through a restart of the server, and no answer that was lost stops
it."""

from __future__ import annotations

import socket
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from server_process import ServerProcess

from tms_agents.commands import slam
from tms_agents.robot.map_uploader import Grid, MapUploader
from tms_agents.simulation.building import Drive, carmen, drive
from tms_agents.simulation.coloured_drive import record
from tms_client import Conflict, Town, Unreachable
from tms_client.cli import CommandError
from tms_client.flows import NO_RETRY
from tms_schemas.maps import MapIn
from tms_schemas.rooms import RoomIn

ROOM = RoomIn(name="Lab", outline=[(0.0, 0.0), (9.0, 0.0), (9.0, 9.0), (0.0, 9.0)])


class Clock:
    def __init__(self) -> None:
        self.now = 0.0

    def __call__(self) -> float:
        return self.now

    def sleep(self, seconds: float) -> None:
        self.now += seconds


def grown(columns):
    """Occupancy of which so many columns are known."""
    cells = np.full((100, 300), np.nan)
    cells[:, :columns] = 0.05
    cells[0, :columns] = 0.95
    return cells, (-1.0, -2.0)


def made(url, clock, said, **more):
    town = Town(url, retry=NO_RETRY, **more)
    return MapUploader(town, "corridor", "robot", 5.0, said.append, clock, clock.sleep), town


def prepare(url):
    with Town(url) as town:
        town.rooms.put("lab", ROOM)
        town.maps.put("corridor", MapIn(room="lab", resolution=0.05))


def fetched(url):
    with Town(url) as town:
        found = town.map("corridor")
        return found.version, int(np.isfinite(found.occupancy).sum())


def test_at_a_modest_rate_and_through_a_restart(tmp_path):
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
    said: list[str] = []
    clock = Clock()
    server = ServerProcess(tmp_path, port=port)
    with server:
        prepare(server.url)
        uploader, town = made(server.url, clock, said)
        for columns in range(10, 110, 10):  # a scan each second
            clock.now += 1.0
            uploader.offer(lambda columns=columns: Grid(*grown(columns)))
        assert uploader.versions == 2
        assert fetched(server.url) == (2, 100 * 100)
        server.kill()
        for columns in range(110, 160, 10):
            clock.now += 1.0
            uploader.offer(lambda columns=columns: Grid(*grown(columns)))
        assert len(said) == 1
        assert said[0].startswith("map corridor waits for the server")
        with pytest.raises(Unreachable):
            uploader.finish(Grid(*grown(160)), 2.0)
        with ServerProcess(tmp_path, port=port) as again:
            assert fetched(again.url) == (2, 100 * 100)  # nothing acknowledged was lost
            clock.now += 10.0
            uploader.offer(lambda: Grid(*grown(170)))
            assert uploader.finish(Grid(*grown(200)), 10.0).version == 4
            assert said[1:] == ["the server is back; map corridor is at version 3"]
            assert fetched(again.url) == (4, 200 * 100)
            town.close()


def test_a_version_of_ones_own_is_built_on_and_that_of_others_is_not(tmp_path):
    with ServerProcess(tmp_path) as server:
        prepare(server.url)
        clock = Clock()
        uploader, town = made(server.url, clock, [])
        assert uploader.finish(Grid(*grown(10)), 0.0).version == 1
        with Town(server.url) as other:
            other.maps.upload("corridor", *grown(20), agent="robot")  # as one whose answer was lost
            assert uploader.finish(Grid(*grown(30)), 0.0).version == 3
            other.maps.upload("corridor", *grown(40), agent="somebody", base=3)
        with pytest.raises(Conflict):
            uploader.finish(Grid(*grown(50)), 0.0)
        town.close()


@pytest.mark.timeout(300)  # the mapper compiles where it never ran before
def test_the_mapper_uploads_while_it_works(tmp_path, capsys):
    log = tmp_path / "drive.log"
    log.write_text("\n".join(carmen(drive("block", Drive(seed=3, step_m=0.6)))[:121]))
    command = ["run", str(log), "--out", str(tmp_path / "out"), "--particles", "30", "--upload", "corridor"]
    with ServerProcess(tmp_path / "data") as server:
        with pytest.raises(CommandError, match="--room"):
            slam.main([*command, "--url", server.url])
        with Town(server.url) as town:
            town.rooms.put("lab", ROOM)
        more = ["--room", "lab", "--map-to-room", "1,2,0.5", "--upload-every", "0.1", "--url", server.url]
        assert slam.main([*command, *more]) == 0
        said = capsys.readouterr().out
        assert "map corridor on the server is at version" in said
        with Town(server.url) as town:
            found = town.map("corridor")
            notes = [one.note for one in town.maps.versions("corridor")]
        assert found.map_to_room == (1.0, 2.0, 0.5)
        assert len(notes) >= 2
        assert set(notes[1:]) == {"while driving"}
        occupancy = np.load(tmp_path / "out" / "map.npy")
        assert np.isfinite(found.occupancy).sum() == np.isfinite(occupancy).sum()
        localise = ["slam", "localise", str(log), "--map", "corridor", "--url", server.url, "--particles", "8000"]
        done = subprocess.run(
            [sys.executable, "-m", "tms_client", *localise], capture_output=True, text=True, timeout=200, check=False
        )
        assert done.returncode == 0, done.stdout + done.stderr
        assert done.stdout.startswith("localised after")
    with pytest.raises(CommandError, match="corridor"):
        slam.main([*command, "--room", "lab", "--url", server.url])
    assert Path(tmp_path / "out" / "map.npz").exists()


@pytest.mark.timeout(300)
def test_light_goes_with_the_map(tmp_path):
    made = record("corridor", 5)
    (tmp_path / "stream.jsonl").write_text("\n".join(made.lines[:400]))
    (tmp_path / "models.json").write_text(made.models)
    files = [str(tmp_path / "stream.jsonl"), "--out", str(tmp_path / "out")]
    command = ["run", *files, "--particles", "30", "--intensity"]
    with ServerProcess(tmp_path / "data") as server:
        prepare(server.url)
        assert slam.main([*command, "--upload", "corridor", "--upload-every", "0.1", "--url", server.url]) == 0
        with Town(server.url) as town:
            newest, first = town.map("corridor"), town.map("corridor", version=1)
    written = np.load(tmp_path / "out" / "imap.npy")
    assert newest.version > 1
    assert newest.intensity is not None
    assert first.intensity is not None
    assert 0 < np.isfinite(first.intensity.mean).sum() < np.isfinite(written).sum()
    np.testing.assert_allclose(np.nanmean(newest.intensity.mean), np.nanmean(written), rtol=1e-4)
    assert np.isfinite(newest.intensity.mean).sum() == np.isfinite(written).sum()
