"""Drivers against the emulators over real TCP and pseudo terminals: readings, states, faults, recovery."""

from __future__ import annotations

import asyncio
import time

import pytest
from link_listening import QUICK, on_a_line, states, until
from sllurp_client import sllurp_reads

from tms_agents.devices.emulation import PtyLine
from tms_agents.devices.llrp.emulator import LlrpEmulator
from tms_agents.devices.llrp.session import LlrpSession
from tms_agents.devices.scales import ScaleLineSession
from tms_agents.devices.tags import RoundEnd, TagItem, TagRead
from tms_agents.devices.tr3.codec import Frame
from tms_agents.devices.tr3.emulator import Tr3Device
from tms_agents.devices.tr3.session import Tr3Session
from tms_agents.devices.transport import DeviceState, Link, serial, tcp

EPC = "30352B2E4401D3000000007B"
UID = "E00401004E17F97A"


def llrp(port: int, **options) -> Link[TagRead]:
    options = {"silent_after_s": 0.5, "tick_s": 0.02, "retry": QUICK, **options}
    return Link(tcp("127.0.0.1", port), lambda: LlrpSession(keepalive_s=0.1), name="reader", **options)


def tr3(opener, **options) -> Link[TagItem]:
    options = {"silent_after_s": 0.5, "tick_s": 0.01, "retry": QUICK, **options}
    return Link(opener, lambda: Tr3Session(poll_s=0.02, reply_s=0.1), name="tr3", **options)


def is_read(seen) -> bool:
    return isinstance(seen[-1], TagRead)


async def test_llrp_reports_tags_and_is_kept_alive():
    async with LlrpEmulator(period_s=0.02) as reader:
        reader.see(EPC, antenna=3, rssi_dbm=-61)
        seen = await until(llrp(reader.port), lambda seen: reader.acknowledged >= 2)
        read = next(item for item in seen if isinstance(item, TagRead))
        assert (read.tag, read.antenna, read.rssi_dbm) == (EPC, 3, -61.0) and read.first_seen is not None
        assert states(seen) == ["connected"]
        assert reader.heard[:4] == ["SET_READER_CONFIG", "DELETE_ROSPEC", "ADD_ROSPEC", "ENABLE_ROSPEC"]
        await asyncio.sleep(0.05)
        assert reader.heard[-1] == "CLOSE_CONNECTION"


async def test_llrp_garbage_and_a_cut_cable():
    async with LlrpEmulator(period_s=0.02) as reader:
        reader.see(EPC)

        def disturb(item):
            if isinstance(item, TagRead) and reader.heard.count("ENABLE_ROSPEC") == 1:
                reader.inject(b"\xff\xfe garbage \xff")
                reader.hang_up()

        seen = await until(llrp(reader.port), lambda seen: is_read(seen) and "faulty" in states(seen), disturb)
        assert states(seen) == ["connected", "faulty", "connected"]


async def test_llrp_reader_falls_silent_and_comes_back():
    async with LlrpEmulator(period_s=0.02) as reader:
        reader.see(EPC)

        def hush(item):
            reader.silent = isinstance(item, TagRead)

        def back(seen):
            return is_read(seen) and "silent" in states(seen)

        seen = await until(llrp(reader.port, silent_after_s=0.2), back, hush)
        assert states(seen)[:2] == ["connected", "silent"] and states(seen)[-1] == "connected"


async def test_llrp_second_client_and_refused_commands_say_why():
    async with LlrpEmulator(period_s=0.02) as reader:
        reader.refuse = 2
        (state,) = await until(llrp(reader.port), lambda seen: True)
        assert state == DeviceState(
            "faulty", "reader: the reader refuses the connection: another client is connected already"
        )
        reader.refuse = 0
        reader.fail = {"ADD_ROSPEC"}
        (state,) = await until(llrp(reader.port), lambda seen: True)
        assert state.why == "reader: ADD_ROSPEC_RESPONSE: status 101 ADD_ROSPEC fails"


async def test_a_fault_stays_told_until_something_is_better():
    """Not "silent" at every new connection to a reader that refuses, or says nothing, after a while."""
    device = Tr3Device()
    device.see(UID)

    def change(item):
        if isinstance(item, TagRead):
            device.nack_next = 5  # a fault
        elif isinstance(item, DeviceState) and item.state == "faulty":
            device.silent = "format error" in item.why
            heard.append(item.why)

    heard: list[str] = []
    async with on_a_line("tcp", device) as (_, opener):
        seen = await until(tr3(opener, silent_after_s=0.2), lambda seen: len(heard) == 2 and is_read(seen), change)
    assert states(seen) == ["connected", "faulty", "faulty", "connected"]
    assert heard[0].endswith("format error") and heard[1] == "tr3: nothing for 0.6 s"


async def test_nobody_listens():
    (state,) = await until(llrp(9), lambda seen: True)
    assert state.state == "faulty" and "Connect call failed" in state.why


async def test_sllurp_accepts_the_emulator():
    async with LlrpEmulator(period_s=0.05) as reader:
        reader.see(EPC)
        assert await sllurp_reads(reader.port, antennas=[1]) == {(EPC, 1)}
    assert "GET_READER_CAPABILITIES" in reader.heard


@pytest.mark.parametrize("line", ["pty", "tcp"])
async def test_tr3_polls_its_antennas(line):
    device = Tr3Device()
    device.see(UID, antenna=0)
    device.see("E00401508747FFC8", antenna=1)
    async with on_a_line(line, device, 38400) as (_, opener):
        link = Link(opener, lambda: Tr3Session(antennas=(0, 1), poll_s=0.02), name="tr3", tick_s=0.01, retry=QUICK)
        seen = await until(link, lambda seen: len(seen) == 7)
        reads = {(item.tag, item.antenna) for item in seen if isinstance(item, TagRead)}
        assert reads == {(UID, 0), ("E00401508747FFC8", 1)}
        assert states(seen) == ["connected"]
        await asyncio.sleep(0.05)
        assert not device.rf_on  # left quiet


async def test_tr3_one_antenna_is_read_again_and_again():
    """The reader does not repeat a UID until the antenna is switched: the driver sees to that."""
    device = Tr3Device()
    device.see(UID)
    async with PtyLine(device) as line:
        seen = await until(tr3(serial(line.path, 38400)), lambda seen: seen.count(RoundEnd(0)) == 4)
        assert [item.tag for item in seen if isinstance(item, TagRead)] == [UID] * 4


async def test_tr3_garbage_silence_and_nack():
    device = Tr3Device()
    device.see(UID)
    async with PtyLine(device) as line:
        link = tr3(serial(line.path, 38400), silent_after_s=0.2)
        reads = 0

        def disturb(item):
            nonlocal reads
            reads += isinstance(item, TagRead)
            if reads == 2:
                line.inject(b"\x02\x00\x49\xf0 half a frame")
            if reads == 4 and isinstance(item, TagRead):
                device.silent = True
            if isinstance(item, DeviceState) and item.state == "silent":
                device.silent = False
            if reads == 6 and isinstance(item, TagRead):
                device.nack_next = 5

        seen = await until(link, lambda seen: reads >= 7 and "faulty" in states(seen) and is_read(seen), disturb)
        assert states(seen) == ["connected", "silent", "connected", "faulty", "connected"]
        why = next(item.why for item in seen if isinstance(item, DeviceState) and item.state == "faulty")
        assert why == "tr3: the reader refuses command 02 00 78 03 F0 40 01 03 B1 0D: format error"


async def test_tr3_rdloop_is_listened_to():
    device = Tr3Device()
    frame = Frame(0x4C, bytes.fromhex(UID)[::-1] + bytes(16)).encode()
    async with PtyLine(device) as line:
        link = Link(serial(line.path, 38400), lambda: Tr3Session(mode="rdloop"), name="tr3", tick_s=0.01)
        stop = time.monotonic() + 5

        async def transmit():
            while time.monotonic() < stop:
                line.inject(frame)
                await asyncio.sleep(0.02)

        sender = asyncio.create_task(transmit())
        seen = await until(link, is_read)
        sender.cancel()
        assert seen[-1].tag == UID and device.heard == []


async def test_no_such_serial_port(tmp_path):
    (state,) = await until(tr3(serial(str(tmp_path / "tty"), 38400)), lambda seen: True)
    assert state.state == "faulty" and "No such file" in state.why


async def test_settings_that_cannot_be_are_said_before_anything_is_opened():
    opened = []

    async def opener():
        opened.append(True)
        raise OSError("opened")

    link = Link(opener, lambda: ScaleLineSession("openscale", zero_first=True), name="scale", retry=QUICK)
    (state,) = await until(link, lambda seen: True)
    assert state == DeviceState("faulty", "scale: this scale has no zero command") and not opened
