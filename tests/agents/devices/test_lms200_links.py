"""An LMS2xx behind a real terminal whose rate counts, and behind a port: scans, states, a pulled cable."""

from __future__ import annotations

import asyncio

import numpy as np
import pytest
from link_listening import QUICK, on_a_line, states, until

from tms_agents.devices.emulation import PtyLine
from tms_agents.devices.lms200 import Lms200Device, Lms200Session, serial_line
from tms_agents.devices.scans import Scan
from tms_agents.devices.sessions import DeviceFault, DeviceState
from tms_agents.devices.transport import Link

RANGES = 1.5 + 0.01 * np.arange(361)


def scanner(**options) -> Lms200Device:
    return Lms200Device(lambda: (RANGES, None), **options)


def link(opener, **options) -> Link[Scan]:
    return Link(opener, lambda: Lms200Session(**options), name="scanner", retry=QUICK)


def scans(seen) -> list[Scan]:
    return [item for item in seen if isinstance(item, Scan)]


@pytest.mark.parametrize("kind", ["pty", "tcp"])
async def test_scans_come_over_a_line(kind):
    device = scanner()
    device.baud = 38400
    async with on_a_line(kind, device, 38400, tick_s=0.01) as (_, opener):
        seen = await until(link(opener), lambda seen: len(scans(seen)) == 3, timeout_s=20)
        assert states(seen) == ["connected"]
        for scan in scans(seen):
            np.testing.assert_allclose(scan.ranges, RANGES, atol=0.0006)
        async with asyncio.timeout(20):
            while device.streaming:  # the last word of the link
                await asyncio.sleep(0.01)


def at_the_rate_of_the_terminal(line: PtyLine, device: Lms200Device) -> None:
    device.host_baud = lambda: line.baud


@pytest.mark.parametrize(("at", "wanted"), [(9600, 38400), (38400, 38400), (19200, 9600), (500000, 38400)])
async def test_the_rate_is_found_and_changed(at, wanted):
    device = scanner()
    device.baud = at
    async with PtyLine(device, tick_s=0.01) as line:
        at_the_rate_of_the_terminal(line, device)
        opener = serial_line(line.path, wanted, patience_s=0.15, settle_s=0.0)
        seen = await until(link(opener, baud=wanted), lambda seen: scans(seen), timeout_s=20)
        assert device.baud == wanted and states(seen) == ["connected"]


async def test_after_a_power_cycle_it_is_found_at_its_old_rate():
    device = scanner()
    async with PtyLine(device, tick_s=0.01) as line:
        at_the_rate_of_the_terminal(line, device)
        opener = serial_line(line.path, patience_s=0.15, settle_s=0.0)
        cycled = False

        def cycle(item):
            nonlocal cycled
            if isinstance(item, Scan) and not cycled:
                cycled = True
                device.power_cycle()  # speaks at 9600 baud again, to a terminal at 38400

        listener = Link(opener, lambda: Lms200Session(silence_s=0.3), name="scanner", silent_after_s=0.3, retry=QUICK)
        seen = await until(
            listener, lambda seen: "faulty" in states(seen) and isinstance(seen[-1], Scan), cycle, timeout_s=20
        )
        assert states(seen)[0] == states(seen)[-1] == "connected" and device.baud == 38400


async def test_no_scanner_at_any_rate():
    device = scanner()
    device.silent = True
    async with PtyLine(device, tick_s=0.01) as line:
        with pytest.raises(DeviceFault, match="answers at none of its rates"):
            await serial_line(line.path, patience_s=0.03)()
        device.silent = False
        device.refuse = {0x20}
        at_the_rate_of_the_terminal(line, device)
        with pytest.raises(DeviceFault, match="answers at none of its rates"):
            await serial_line(line.path, patience_s=0.03)()
    with pytest.raises(ValueError, match="speaks at 9600, 19200, 38400, 500000 baud, not 115200"):
        serial_line("/dev/null", 115200)
    with pytest.raises(OSError):
        await serial_line("/dev/no-such-line", patience_s=0.03)()


async def test_a_pulled_cable_is_said_and_recovers():
    device = scanner()
    device.baud = 38400
    async with PtyLine(device, tick_s=0.01) as line:
        pulled = False

        def pull(item):
            nonlocal pulled
            if isinstance(item, Scan) and not pulled:
                pulled = True
                line.hang_up()
                asyncio.get_running_loop().call_later(0.15, line.plug_in)

        opener = serial_line(line.path, patience_s=0.3)
        seen = await until(
            link(opener), lambda seen: "faulty" in states(seen) and isinstance(seen[-1], Scan), pull, timeout_s=20
        )
        assert states(seen)[0] == states(seen)[-1] == "connected"
        assert any("closed" in item.why for item in seen if isinstance(item, DeviceState) and item.state == "faulty")
