"""Scans of an emulated laser over TCP through the agent to a real server, and every fault on the way."""

from __future__ import annotations

import asyncio
import contextlib
import math
import time

import numpy as np
import pytest
from floor_rig import COMES, DOORS, PUT_AT, QUICK, Playing, Room, agent, laser_toml

from tms_agents.devices.emulation import TcpLine
from tms_agents.devices.scip import ScipDevice
from tms_agents.floor.recordings.formats import read_scans

# The estimator compiles where it never ran before.
pytestmark = pytest.mark.timeout(600)

POSE = (2.5, 0.05, math.pi / 2)
SOON_S = 5.0


class Laser:
    """A URG-04LX in the room: its emulator, and what is wrong with it."""

    def __init__(self, room: Room, play=lambda: None) -> None:
        self.room, self.play = room, play
        self.covered = self.stuck = False
        self.device = ScipDevice(self.scan, "URG-04LX")
        self._last: np.ndarray | None = None

    def scan(self):
        self.play()
        if not self.stuck or self._last is None:
            self._last = self.room.ranges(self.device.sweep, POSE)
        return (np.full(len(self._last), 0.03), None) if self.covered else (self._last, None)

    @contextlib.asynccontextmanager
    async def line(self):
        async with TcpLine(self.device, tick_s=0.01) as line:
            yield line


def scip(line, **options):
    return laser_toml(f'{{ kind = "scip", host = "127.0.0.1", port = {line.port} }}', POSE, **options)


async def test_a_walker_who_leaves_a_thing(rig):
    """The agent as a process, from the bytes of the laser to the belief; it records, too, and remembers."""
    room = Room()
    laser = Laser(room)
    async with laser.line() as line:
        floor = rig(scip(line), more='[recording]\npath = "floor.scans"\n' + QUICK + DOORS)
        async with agent(floor.config):
            await floor.state("connected", "SCIP laser", timeout_s=400.0)
            await asyncio.sleep(2.0)  # the room is learnt
            playing = Playing(room, start=COMES)
            laser.play = playing.step
            (mover,) = (await floor.count(1, "mover")).values()
            (thing,) = (await floor.count(1)).values()
            assert math.dist(thing.xy, PUT_AT) < 0.03
            await floor.count(0, "mover")
        # Ended and started again: the thing keeps its label, nothing new appears.
        async with agent(floor.config):
            await asyncio.sleep(0.5)
            await floor.state("connected", "SCIP laser", timeout_s=400.0)
            await asyncio.sleep(2.5)  # the inventory after a device came back
            assert [(one.label, one.since) for one in (await floor.labels()).values()] == [(thing.label, thing.since)]
            assert await floor.labels("mover") == {}
            laser.play = lambda: None
            room.take("thing")
            await floor.count(0)
    assert mover.label != thing.label
    recorded = read_scans(floor.config.with_name("floor.scans"))
    assert sum(map(len, recorded)) > 100 and recorded[0].name == "laser"
    assert floor.town.anomalies(floor.name).anomalies == []


async def test_a_clock_that_is_set_back(rig):
    """What is taken afterwards is gone at the server, too, and nothing there is strange."""
    room, set_s = Room(), [0.0]
    laser = Laser(room)
    async with laser.line() as line:
        floor = rig(scip(line), more=QUICK)
        async with floor.agent(clock=lambda: time.time() + set_s[0]):
            await floor.state("connected", "SCIP laser", timeout_s=400.0)
            await asyncio.sleep(2.0)
            room.put("thing", *PUT_AT)
            await floor.count(1)
            set_s[0] = -3600.0
            room.take("thing")
            await floor.count(0)
            await asyncio.sleep(1.5)  # a heartbeat
            assert (await floor.view()).state == "connected"
        view = await floor.view()
    assert (view.state, view.why) == ("silent", "the agent ended") and view.lag_s < 30.0
    assert floor.town.anomalies(floor.name).anomalies == []


async def test_faults_of_a_laser(rig):
    """Each is shown within 5 s and heals by itself; a thing that lay there keeps its label, nothing is made up."""
    room = Room()
    laser = Laser(room)
    async with laser.line() as line:
        floor = rig(scip(line), more=QUICK)
        async with floor.agent():
            await floor.state("connected", "SCIP laser", timeout_s=400.0)
            await asyncio.sleep(2.0)
            room.put("thing", *PUT_AT)
            (before,) = (await floor.count(1)).values()

            laser.device.silent = True
            await floor.state("silent", "laser: SCIP laser", SOON_S)
            laser.device.silent = False
            await floor.state("connected")

            await line.__aexit__()  # the cable, and the port with it
            await floor.state("faulty", "laser: SCIP laser", SOON_S)
            await line.__aenter__()
            await floor.state("connected")

            laser.device.garble_next = 1_000_000
            await floor.state("silent", "laser: SCIP laser", SOON_S)
            laser.device.garble_next = 0
            await floor.state("connected")

            laser.device.broken = "51"
            await floor.state("faulty", "laser: SCIP laser", SOON_S)
            laser.device.broken = ""
            await floor.state("connected")

            laser.covered = True
            await floor.state("faulty", "laser: 100% of the beams end at its window", SOON_S)
            laser.covered = False
            await floor.state("connected")

            laser.stuck = True
            await floor.state("faulty", "laser: it repeats one scan", SOON_S)
            laser.stuck = False
            await floor.state("connected")

            laser.device.power_cycle()
            room.put("other", 1.5, 2.0)
            labels = await floor.count(2)
            assert await floor.labels("mover") == {}
    assert labels.pop(before.label).since == before.since
    # Labels are counted: a thing or mover that came and went in between would have taken the number.
    (other,) = labels
    assert int(other.rpartition("/")[2]) == int(before.label.rpartition("/")[2]) + 1
    assert floor.town.anomalies(floor.name).anomalies == []
