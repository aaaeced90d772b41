"""SCIP links over real TCP and pseudo terminals: scans, states, faults, recovery, the speed of a serial line."""

from __future__ import annotations

import asyncio
import contextlib
import os
import termios
from collections.abc import AsyncIterator

import numpy as np
import pytest
from link_listening import QUICK, on_a_line, states, until
from scip_conversation import room

from tms_agents.devices.cola import ColaDevice, ColaSession
from tms_agents.devices.emulation import PtyLine
from tms_agents.devices.scans import Scan
from tms_agents.devices.scip import MODELS, ScipDevice, ScipLink, ScipSettings, scip_serial
from tms_agents.devices.transport import DeviceState, Link, Opener

TIMEOUT_S = 20.0


def sensor(model: str) -> ScipDevice:
    seen = room(MODELS[model].parameters.steps)
    return ScipDevice(lambda: seen, model, boot_s=0.05)


def link(opener: Opener, settings: ScipSettings | None = None, *, silent_after_s: float = 5.0) -> ScipLink:
    return ScipLink(opener, settings, name="floor", silent_after_s=silent_after_s, retry=QUICK)


def scans(seen) -> list[Scan]:
    return [item for item in seen if isinstance(item, Scan)]


async def dark(device: ScipDevice) -> bool:
    """Whether the laser is off within a moment."""
    for _ in range(200):
        if not device.laser_on:
            return True
        await asyncio.sleep(0.02)
    return False


@pytest.mark.parametrize("line", ["pty", "tcp"])
@pytest.mark.parametrize("model", ["URG-04LX", "UST-20LX"])
async def test_scans_arrive_and_the_laser_goes_off_afterwards(line, model):
    device = sensor(model)
    async with on_a_line(line, device, 115200, tick_s=0.005) as (_, opener):
        seen = await until(link(opener), lambda seen: len(scans(seen)) >= 5, timeout_s=TIMEOUT_S)
        ranges, light = room(device.model.parameters.steps)
        for scan in scans(seen):
            np.testing.assert_allclose(scan.ranges, ranges)
            assert scan.intensities is None or np.array_equal(scan.intensities, light)
        assert await dark(device)
    (state,) = [item for item in seen if isinstance(item, DeviceState)]
    note = ", without intensity: the model has none" if model == "URG-04LX" else ""
    assert state == DeviceState("connected", f"floor: {device.model.product} {device.model.serial}{note}")


async def test_a_cable_that_is_pulled_out_and_put_back():
    device = sensor("URG-04LX-UG01")
    async with on_a_line("pty", device, tick_s=0.005) as (line, opener):

        def pull(item):
            if isinstance(item, Scan) and not happened:
                line.hang_up()
                device.power_cycle()
                happened.append("out")
            elif isinstance(item, DeviceState) and item.state == "faulty" and happened == ["out"]:
                line.plug_in()
                happened.append("in")

        def back(seen):
            return states(seen)[-1] == "connected" and "faulty" in states(seen) and isinstance(seen[-1], Scan)

        happened: list[str] = []
        seen = await until(link(opener), back, pull, timeout_s=TIMEOUT_S)
    assert states(seen)[0] == "connected" and len(scans(seen)) >= 2


async def test_a_cut_connection_and_a_hardware_fault_say_why():
    device = sensor("UST-10LX")
    async with on_a_line("tcp", device, tick_s=0.005) as (line, opener):

        def harm(item):
            if isinstance(item, Scan) and not device.broken:
                device.broken = "53"
            elif isinstance(item, DeviceState) and item.state == "faulty":
                device.broken = ""
                line.hang_up()

        def back(seen):
            return "faulty" in states(seen) and isinstance(seen[-1], Scan) and not device.broken

        seen = await until(link(opener), back, harm, timeout_s=TIMEOUT_S)
    whys = [item.why for item in seen if isinstance(item, DeviceState) and item.state == "faulty"]
    assert whys[0] == "floor: ME: status 53 hardware fault; its state: Laser trouble."


async def test_a_sensor_that_falls_silent_and_comes_back():
    device = sensor("UTM-30LX")
    async with on_a_line("tcp", device, tick_s=0.005) as (_, opener):

        def hush(item):
            device.silent = isinstance(item, Scan) and "silent" not in said
            if isinstance(item, DeviceState):
                said.append(item.state)

        said: list[str] = []
        seen = await until(
            link(opener, silent_after_s=0.8),
            lambda seen: "silent" in states(seen) and states(seen)[-1] == "connected" and isinstance(seen[-1], Scan),
            hush,
            timeout_s=TIMEOUT_S,
        )
    assert "connected" in states(seen)[: states(seen).index("silent")]


@pytest.mark.parametrize("silent_after_s", [0.3, 1.0, 5.0])
async def test_nobody_answers(silent_after_s):
    device = sensor("UST-20LX")
    device.silent = True
    async with on_a_line("tcp", device) as (_, opener):
        (state,) = await until(link(opener, silent_after_s=silent_after_s), lambda seen: True, timeout_s=TIMEOUT_S)
    assert state == DeviceState("faulty", "floor: no answer to QT, in no version of SCIP")


async def test_another_protocol_at_the_port_is_told_by_what_was_asked_in_vain():
    sick = ColaDevice(lambda: (np.full(811, 2.0), None))
    async with on_a_line("tcp", sick, tick_s=0.01) as (_, opener):
        (state,) = await until(link(opener, silent_after_s=1.0), lambda seen: True, timeout_s=5.0)
    assert state == DeviceState("faulty", "floor: no answer to QT, in no version of SCIP")
    async with on_a_line("tcp", sensor("UST-20LX"), tick_s=0.005) as (_, opener):
        other = Link(opener, ColaSession, name="floor", silent_after_s=1.0, retry=QUICK)
        (state,) = await until(other, lambda seen: True, timeout_s=5.0)
    assert state == DeviceState("faulty", "floor: the scanner does not answer sRN SCdevicestate, in CoLa A or B")


async def test_a_refused_question_says_why():
    device = sensor("UST-20LX")
    device.refuse["PP"] = "0L"
    async with on_a_line("tcp", device) as (_, opener):
        (state,) = await until(link(opener), lambda seen: True, timeout_s=TIMEOUT_S)
    why = "floor: PP: status 0L abnormal state; its state: sensor is working normally"
    assert state == DeviceState("faulty", why)


@contextlib.asynccontextmanager
async def serial_line(model: str, baud: int) -> AsyncIterator[tuple[ScipDevice, PtyLine]]:
    """A sensor on a line whose speed counts: the terminal tells what the host has set."""
    device = sensor(model)
    device.baud = baud
    async with PtyLine(device, tick_s=0.005) as line:
        end = os.open(line.path, os.O_RDWR | os.O_NOCTTY)
        speeds = {getattr(termios, f"B{rate}"): rate for rate in (19200, 38400, 57600, 115200, 500000)}
        device.line_baud = lambda: speeds.get(termios.tcgetattr(end)[5], 0)
        try:
            yield device, line
        finally:
            os.close(end)


@pytest.mark.parametrize(
    ("has", "wanted", "gets"), [(19200, None, 19200), (57600, 115200, 115200), (500000, None, 500000)]
)
async def test_the_speed_of_a_serial_line_is_found_and_set(has, wanted, gets):
    async with serial_line("URG-04LX", has) as (device, line):
        seen = await until(
            link(scip_serial(line.path, wanted)), lambda seen: len(scans(seen)) >= 2, timeout_s=TIMEOUT_S
        )
        assert states(seen) == ["connected"] and device.baud == gets
        assert await dark(device)


async def test_a_line_of_a_sensor_that_measures_already():
    async with serial_line("URG-04LX", 57600) as (device, line):
        device.line_baud = None
        device.receive(b"SCIP2.0\nMD0044072501000\n")
        seen = await until(link(scip_serial(line.path)), lambda seen: len(scans(seen)) >= 2, timeout_s=TIMEOUT_S)
        assert states(seen) == ["connected"]


async def test_a_speed_that_the_sensor_does_not_have_is_not_insisted_on():
    async with serial_line("URG-04LX-UG01", 19200) as (device, line):
        device.line_baud = None  # USB
        seen = await until(
            link(scip_serial(line.path, 115200)), lambda seen: len(scans(seen)) >= 2, timeout_s=TIMEOUT_S
        )
    assert states(seen) == ["connected"]


async def test_no_speed_of_the_line_has_an_answer():
    async with serial_line("URG-04LX", 19200) as (device, line):
        device.silent = True
        (state,) = await until(link(scip_serial(line.path)), lambda seen: True, timeout_s=TIMEOUT_S)
    assert state == DeviceState("faulty", "floor: no answer to QT at any speed of the line")
