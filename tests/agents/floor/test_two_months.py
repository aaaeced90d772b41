"""What happens in a room within two months: outages, a full disk, clocks that are set, lasers unplugged for long."""

from __future__ import annotations

import asyncio
import contextlib
import math
import resource
import socket
import sqlite3
import time
from pathlib import Path

import numpy as np
import pytest
from floor_rig import COMES, DOORS, GONE, PUT_AT, QUICK, Playing, Rig, Room, agent, config_toml, laser_toml
from server_process import ServerProcess

from tms_agents.devices.cola import ColaDevice
from tms_agents.devices.cola.emulator import MODELS
from tms_agents.devices.emulation import TcpLine
from tms_agents.devices.scans import Sweep
from tms_agents.devices.scip import ScipDevice
from tms_client import Town
from tms_schemas.rooms import RoomIn

# The estimator compiles where it never ran before.
pytestmark = pytest.mark.timeout(600)

POSE, WEST = (2.5, 0.05, math.pi / 2), (0.05, 1.0, 0.0)


@contextlib.asynccontextmanager
async def urg(room: Room, play=lambda: None):
    """A URG-04LX: its line, and its section of the configuration."""

    def scan():
        play()
        return room.ranges(device.sweep, POSE), None

    device = ScipDevice(scan, "URG-04LX")
    async with TcpLine(device, tick_s=0.01) as line:
        yield line, laser_toml(f'{{ kind = "scip", host = "127.0.0.1", port = {line.port} }}', POSE, name="south")


@contextlib.asynccontextmanager
async def tim(room: Room):
    sweep = Sweep(np.linspace(-0.75 * math.pi, 0.75 * math.pi, 811), 0.0, 1 / 15, 0.02, 8.0, "test")
    device = ColaDevice(lambda: (room.ranges(sweep, WEST), None), model=MODELS["TiM571"], dialect="B")
    async with TcpLine(device, tick_s=0.01) as line:
        yield line, laser_toml(f'{{ kind = "cola", host = "127.0.0.1", port = {line.port} }}', WEST, name="west")


class Stories:
    """One after the other: somebody comes, leaves something, goes; after that it is gone as well."""

    def __init__(self, room: Room) -> None:
        self._room, self.told, self._playing = room, 0, None

    def step(self) -> None:
        if self._playing is None or self._playing.t > GONE + 3.0:
            self._room.discs.pop("thing", None)
            self._playing = Playing(self._room, start=COMES)
            self.told += 1
        self._playing.step()


def free_port() -> int:
    with socket.socket() as one:
        one.bind(("127.0.0.1", 0))
        return int(one.getsockname()[1])


def recorded(data_dir: Path, name: str) -> list[tuple[int, int]]:
    """(first seq, observations) of what the server has of an agent, in the order in which it came."""
    with contextlib.closing(sqlite3.connect(data_dir / "tms.sqlite")) as db:
        return db.execute('SELECT seq, records FROM log WHERE agent = ? ORDER BY "offset"', (name,)).fetchall()


async def test_a_server_that_is_away_for_long(tmp_path):
    """Killed under the running agent and started again much later: everything is there, each once and in order."""
    room, port = Room(), free_port()
    stories = Stories(room)
    data = tmp_path / "server"
    async with urg(room, stories.step) as (_, laser):
        path = tmp_path / "floor.toml"
        text = config_toml("lab", f"http://127.0.0.1:{port}", laser, more=QUICK + DOORS)
        path.write_text(text.replace("linger_s = 0.0", "linger_s = 0.0\nbatch = 7"))  # many batches
        with Town(f"http://127.0.0.1:{port}") as town:
            floor = Rig(town, "lab", path)
            with ServerProcess(data, port=port) as server:
                town.rooms.put("lab", RoomIn.model_validate({"name": "Lab", "outline": [[0, 0], [5, 0], [5, 4]]}))
                process = contextlib.AsyncExitStack()
                await process.enter_async_context(agent(path))
                await floor.state("connected", "SCIP laser", timeout_s=400.0)
                server.kill()
            told, before = stories.told, time.monotonic()
            while stories.told < told + 4:
                await asyncio.sleep(0.5)
            waited = time.monotonic() - before
            with ServerProcess(data, port=port) as server:
                server.kill()  # and away again while it is delivered, perhaps
            with ServerProcess(data, port=port):
                async with asyncio.timeout(60.0):
                    while (await floor.view()).last_observed_at.timestamp() < time.time() - 2.0:
                        await asyncio.sleep(0.2)
                await process.aclose()
                view = await floor.view()
                assert (view.missing, view.state, view.why) == (0, "silent", "the agent ended")
                assert floor.town.anomalies("lab").anomalies == []
                log = path.with_suffix(".log").read_text()
                assert " 0 refused by the server, 0 lost, 0 waiting in the spool" in log
                assert log.count("cannot post, keeps") >= 1 and "posts again" in log
    rows = recorded(data, "lab-floor")
    assert sum(count for _, count in rows) == view.next_seq > waited
    assert rows == sorted(rows) and rows[0][0] == 0


async def test_a_disk_that_becomes_full(rig):
    """The agent says so, works on, and tells what is there when there is place again; no label comes back."""
    room = Room()
    async with urg(room) as (_, laser):
        floor = rig(laser, more=QUICK)
        async with agent(floor.config) as process:
            await floor.state("connected", "SCIP laser", timeout_s=400.0)
            await asyncio.sleep(2.0)
            room.put("first", 1.5, 1.0)
            (first,) = await floor.count(1)
            await asyncio.sleep(1.0)
            spool = floor.config.with_name("floor.spool-wal")
            whole = resource.prlimit(process.pid, resource.RLIMIT_FSIZE, (spool.stat().st_size, resource.RLIM_INFINITY))
            await asyncio.sleep(2.5)  # heartbeats are refused
            room.put("second", 3.5, 1.0)
            await asyncio.sleep(4.0)
            log = floor.config.with_suffix(".log")
            assert process.poll() is None and "what is seen now is lost" in log.read_text()
            assert list(await floor.labels()) == [first]
            resource.prlimit(process.pid, resource.RLIMIT_FSIZE, whole)
            both = await floor.count(2)
            room.take("first")
            room.put("third", 2.5, 2.5)
            async with asyncio.timeout(30.0):
                while len(seen := both | await floor.labels()) < 3:
                    await asyncio.sleep(0.1)
        assert process.returncode == 0
        async with agent(floor.config):  # what it remembered goes on
            await floor.state("connected", "SCIP laser", timeout_s=400.0)
            await asyncio.sleep(3.0)
            assert set(await floor.labels()) == set(seen) - {first}
    assert len(seen) == 3 and floor.town.anomalies(floor.name).anomalies == []
    assert "takes observations again" in log.read_text()


async def test_two_kinds_of_lasers_in_one_room(rig):
    """At 10 and at 15 Hz, with and without a clock of their own: they see one walker and one thing, also one alone."""
    room = Room()
    playing = Playing(room, start=-1e9)
    async with urg(room, lambda: playing.step()) as (line, south), tim(room) as (_, west):
        floor = rig(south + west, more=QUICK + DOORS)
        async with floor.agent():
            await floor.state("connected", "SCIP laser", timeout_s=400.0)
            await floor.state("connected", "CoLa laser", timeout_s=60.0)
            await asyncio.sleep(4.0)
            playing = Playing(room, start=COMES)
            (mover,) = await floor.count(1, "mover")
            (thing,) = (await floor.count(1)).values()
            await floor.count(0, "mover")
            assert math.dist(thing.xy, PUT_AT) < 0.03
            await line.__aexit__()
            await floor.state("faulty", "south: SCIP laser")
            playing = Playing(room, start=-1e9)
            await asyncio.sleep(2.0)
            assert list(await floor.labels()) == [thing.label], "the other one still sees it"
            room.take("thing")
            await floor.count(0)
            await line.__aenter__()
            await floor.state("connected", "SCIP laser")
            await asyncio.sleep(3.0)
            assert await floor.labels() == await floor.labels("mover") == {}
            room.put("last", 1.5, 2.5)
            (last,) = await floor.count(1)
    # Labels are counted: whatever came and went in between would have taken a number.
    assert [int(one.rpartition("/")[2]) - int(mover.rpartition("/")[2]) for one in (thing.label, last)] == [1, 2]
    assert floor.town.anomalies(floor.name).anomalies == []


@pytest.mark.parametrize("by_s", [10.0, 3600.0])
async def test_a_clock_that_is_set_forward_and_right_again(rig, by_s):
    """Nobody appears or vanishes for it, what happens afterwards is told, and nothing is strange."""
    room, set_s = Room(), [0.0]
    playing = Playing(room, start=-1e9)
    async with urg(room, lambda: playing.step()) as (_, laser):
        floor = rig(laser, more=QUICK + DOORS)
        async with floor.agent(clock=lambda: time.time() + set_s[0]):
            await floor.state("connected", "SCIP laser", timeout_s=400.0)
            await asyncio.sleep(2.0)
            playing = Playing(room, start=COMES)
            (mover,) = await floor.count(1, "mover")
            set_s[0] = by_s  # while somebody walks there
            (thing,) = (await floor.count(1)).values()
            await floor.count(0, "mover")
            room.put("second", 1.2, 0.8)
            both = await floor.count(2)
            set_s[0] = 0.0
            await asyncio.sleep(1.0)
            playing = Playing(room, start=-1e9)
            room.take("thing")
            left = await floor.count(1)
            room.take("second")
            await floor.count(0)
            await asyncio.sleep(1.5)
            assert (await floor.view()).state == "connected"
    assert thing.label in both and list(left) == [one for one in both if one != thing.label]
    assert [int(one.rpartition("/")[2]) - int(mover.rpartition("/")[2]) for one in both] == [1, 2]
    assert floor.town.anomalies(floor.name).anomalies == []


async def test_a_laser_that_is_unplugged_for_ten_minutes(rig):
    """Meanwhile one thing was taken, another one put down, and somebody came who stands there: that is what is told."""
    room, later_s = Room(), [0.0]
    async with urg(room) as (line, laser):
        floor = rig(laser, more=QUICK + DOORS)
        clock, even = (lambda: time.time() + later_s[0]), (lambda: time.monotonic() + later_s[0])
        async with floor.agent(clock=clock, even=even):
            await floor.state("connected", "SCIP laser", timeout_s=400.0)
            await asyncio.sleep(2.0)
            room.put("stays", 1.2, 0.8)
            room.put("goes", *PUT_AT)
            before = await floor.count(2)
            (goes,) = (name for name, one in before.items() if math.dist(one.xy, PUT_AT) < 0.1)
            await line.__aexit__()
            await floor.state("faulty", "south: SCIP laser")
            later_s[0] = 600.0
            room.take("goes")
            room.put("new", 3.6, 1.4)
            room.walk("somebody", 3.0, 2.6, 0.0, 0.0)
            await line.__aenter__()
            await floor.state("connected", "SCIP laser")
            await asyncio.sleep(3.0)
            after = await floor.labels()
            assert goes not in after and set(before) - {goes} < set(after)
            (new,) = set(after) - set(before)
            assert math.dist(after[new].xy, (3.6, 1.4)) < 0.05
            begun = time.monotonic()
            while (x := 3.0 + 0.8 * (time.monotonic() - begun)) < 4.9:
                room.walk("somebody", x, 2.6, 0.0, x - 3.0)
                await asyncio.sleep(0.02)
            room.leave("somebody")
            await asyncio.sleep(3.0)
            assert set(await floor.labels()) == set(after)
            await floor.count(0, "mover", timeout_s=90.0)
    assert floor.town.anomalies(floor.name).anomalies == []
