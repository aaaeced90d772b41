"""SICK lasers, byte for byte, through the agent to a real server: serial telegrams, and CoLa in both dialects."""

from __future__ import annotations

import asyncio
import contextlib
import math
from dataclasses import replace

import numpy as np
import pytest
from floor_rig import PUT_AT, QUICK, Room, laser_toml

from tms_agents.devices.cola import ColaDevice
from tms_agents.devices.cola.emulator import MODELS, ColaModel
from tms_agents.devices.emulation import PtyLine, TcpLine
from tms_agents.devices.lms200 import Lms200Device
from tms_agents.devices.scans import Sweep

# The estimator compiles where it never ran before.
pytestmark = pytest.mark.timeout(600)

POSE = (2.5, 0.05, math.pi / 2)


def seen(room: Room, beams: int, span_deg: float):
    half = math.radians(span_deg) / 2
    return room.ranges(Sweep(np.linspace(-half, half, beams), 0.0, 0.1, 0.02, 8.0, "test"), POSE), None


@contextlib.asynccontextmanager
async def cola(room: Room, model: ColaModel, dialect, more: str = ""):
    device = ColaDevice(lambda: seen(room, 811, 270.0), model=model, dialect=dialect)
    async with TcpLine(device, tick_s=0.01) as line:
        yield device, laser_toml(f'{{ kind = "cola", host = "127.0.0.1", port = {line.port}{more} }}', POSE)


@contextlib.asynccontextmanager
async def lms200(room: Room):
    device = Lms200Device(lambda: seen(room, 361, 180.0))
    device.baud = 38400
    async with PtyLine(device, tick_s=0.02) as line:
        yield device, laser_toml(f'{{ kind = "lms200", device = "{line.path}" }}', POSE)


@pytest.mark.parametrize(
    ("open_", "told"),
    [
        (lambda room: cola(room, MODELS["TiM571"], "B"), "CoLa laser"),
        (lambda room: cola(room, MODELS["LMS111"], "A"), "CoLa laser"),
        (lms200, "LMS2xx"),
    ],
    ids=["TiM571", "LMS111", "LMS200"],
)
async def test_a_thing_put_down_and_taken_again(rig, open_, told):
    room = Room()
    async with open_(room) as (device, toml):
        floor = rig(toml, more=QUICK)
        async with floor.agent():
            await floor.state("connected", told, timeout_s=400.0)
            await asyncio.sleep(1.0)  # the first scan compiles the estimator, and the line may be lost meanwhile
            await floor.state("connected", told, timeout_s=400.0)
            await asyncio.sleep(3.0)  # the room is learnt
            room.put("thing", *PUT_AT)
            (thing,) = (await floor.count(1)).values()
            assert math.dist(thing.xy, PUT_AT) < 0.03

            device.power_cycle()
            await asyncio.sleep(1.0)
            await floor.state("connected", told)
            room.take("thing")
            await floor.count(0)
            assert await floor.labels("mover") == {}
    assert device.power_cycles == 1
    assert floor.town.anomalies(floor.name).anomalies == []


async def test_a_laser_whose_password_was_changed(rig):
    """It says so; as it is set up, without login, it works."""
    room, locked = Room(), replace(MODELS["TiM571"], password=0x1234)
    for more, state, why in (("", "faulty", "refuses the password"), (", intensity = false", "connected", "TiM571")):
        async with cola(room, locked, "B", more) as (_, toml):
            floor = rig(toml, more=QUICK)
            async with floor.agent():
                await floor.state(state, why, timeout_s=60.0)
