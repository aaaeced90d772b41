"""The board behind real terminals and ports: readings, states, a pulled cable."""

from __future__ import annotations

import asyncio
import math

import pytest
from link_listening import QUICK, on_a_line, samples, states, until

from tms_agents.devices import waiting
from tms_agents.devices.emulation import PtyLine, TcpLine
from tms_agents.devices.loadboard import RosTmsBoardBurst, RosTmsBoardSession
from tms_agents.devices.loadboard.emulator import RosTmsBoardDevice
from tms_agents.devices.loads import LoadSample
from tms_agents.devices.transport import DeviceState, Link, serial, tcp


def board(opener, **options) -> Link[LoadSample]:
    options = {"silent_after_s": 0.5, "retry": QUICK, **options}
    return Link(opener, RosTmsBoardSession, name="board", **options)


@pytest.mark.parametrize("kind", ["pty", "tcp"])
async def test_counts_come_over_a_line(kind):
    device = RosTmsBoardDevice(lambda t: [10, -20, 30.4, 123456])
    async with on_a_line(kind, device, 115200) as (_, opener):
        seen = await until(board(opener), lambda seen: len(samples(seen)) == 5)
        assert states(seen) == ["connected"]
        assert {sample.values for sample in samples(seen)} == {(10.0, -20.0, 30.0, 123456.0)}
        assert set(device.heard) == set("0123")


async def test_the_board_is_asked_at_its_pace_whatever_the_tick_of_the_link():
    async with PtyLine(RosTmsBoardDevice(lambda t: [1, 2, 3, 4])) as line:
        link = board(serial(line.path, 115200), tick_s=1.0)
        assert len(samples(await until(link, lambda seen: len(samples(seen)) == 30))) == 30  # in less than 8 seconds


@pytest.mark.parametrize("kind", ["pty", "tcp"])
async def test_all_cells_asked_at_once_over_a_line(kind):
    device = RosTmsBoardDevice(lambda t: [10, -20, 30.4, 123456])
    async with on_a_line(kind, device, 115200) as (_, opener):
        link = Link(opener, lambda: RosTmsBoardBurst(quiet_s=0.1), name="board", retry=QUICK)
        seen = await until(link, lambda seen: len(samples(seen)) == 30)
        assert states(seen) == ["connected"]
        assert {sample.values for sample in samples(seen)} == {(10.0, -20.0, 30.0, 123456.0)}


async def test_a_pulled_cable_is_said_and_recovers_without_restart():
    device = RosTmsBoardDevice(lambda t: [1, 2, 3, 4])
    async with PtyLine(device) as line:
        pulled = False

        def pull(item):
            nonlocal pulled
            if isinstance(item, LoadSample) and not pulled:
                pulled = True
                line.hang_up()
                asyncio.get_running_loop().call_later(0.15, line.plug_in)

        def back(seen):
            return "faulty" in states(seen) and isinstance(seen[-1], LoadSample)

        seen = await until(board(serial(line.path, 115200)), back, pull)
        assert states(seen)[0] == "connected" and states(seen)[-1] == "connected"
        whys = [item.why for item in seen if isinstance(item, DeviceState) and item.state == "faulty"]
        assert any("closed" in why for why in whys) and any("No such file" in why for why in whys)


async def test_garbage_a_power_cycle_and_silence_on_a_real_line():
    device = RosTmsBoardDevice(lambda t: [100, 200, 300, 400], boot_s=0.1)
    async with TcpLine(device, tick_s=0.005) as line:
        count = 0

        def disturb(item):
            nonlocal count
            count += isinstance(item, LoadSample)
            if count == 3:
                line.inject(b"\xff999\r\n7")
            if count == 6:
                device.power_cycle()
            if count == 9 and isinstance(item, LoadSample):
                device.silent = True
            if isinstance(item, DeviceState) and item.state == "silent":
                device.silent = False

        seen = await until(
            board(tcp("127.0.0.1", line.port)),
            lambda seen: count > 9 and "silent" in states(seen) and isinstance(seen[-1], LoadSample),
            disturb,
        )
        assert states(seen) == ["connected", "silent", "connected"]
        for sample in samples(seen):
            assert all(math.isnan(v) or v == w for v, w in zip(sample.values, (100, 200, 300, 400), strict=True))


@pytest.mark.parametrize(
    "scenario",
    [
        lambda: test_counts_come_over_a_line("pty"),
        lambda: test_counts_come_over_a_line("tcp"),
        lambda: test_all_cells_asked_at_once_over_a_line("pty"),
        test_the_board_is_asked_at_its_pace_whatever_the_tick_of_the_link,
        test_a_pulled_cable_is_said_and_recovers_without_restart,
        test_garbage_a_power_cycle_and_silence_on_a_real_line,
    ],
)
def test_the_same_in_the_event_loop_of_the_agents(scenario):
    waiting.run(scenario())
