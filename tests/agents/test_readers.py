"""Any reader opens the same way: sections of the configuration against emulated devices."""

from __future__ import annotations

import asyncio

from pydantic import TypeAdapter

from tms_agents.devices.emulation import PtyLine, TcpLine
from tms_agents.devices.llrp.emulator import LlrpEmulator
from tms_agents.devices.tags import RoundEnd
from tms_agents.devices.text_reader_emulator import TextReaderDevice
from tms_agents.devices.thingmagic.emulator import ThingMagicDevice
from tms_agents.devices.tr3.emulator import Tr3Device
from tms_agents.devices.transport import DeviceState
from tms_agents.readers import ReaderSource, can_pause, open_reader

UID, EPC = "E00401004E17F97A", "30352B2E4401D3000000007B"


async def first_read(section: dict[str, object]) -> tuple[list[str], str, bool]:
    """States and the tag until the first read, and whether a round ended (waited for where rounds are told)."""
    source = TypeAdapter(ReaderSource).validate_python(section)
    states, tag, rounds = [], "", False
    arrivals = open_reader(source)
    async with asyncio.timeout(10):
        async for _, item in arrivals:
            if isinstance(item, DeviceState):
                states.append(item.state)
                continue
            for one in item:
                if isinstance(one, RoundEnd):
                    rounds = True
                else:
                    tag = one.read.tag
            if tag and (rounds or not can_pause(source)):
                break
    await arrivals.aclose()
    return states, tag, rounds


async def test_tr3_on_both_kinds_of_line():
    device = Tr3Device()
    device.see(UID)
    async with PtyLine(device) as line:
        found = await first_read({"kind": "tr3-serial", "device": line.path, "poll_s": 0.05})
    assert found == (["connected"], UID, True)
    async with TcpLine(device) as line:
        found = await first_read({"kind": "tr3-tcp", "host": line.host, "port": line.port, "poll_s": 0.05})
    assert found == (["connected"], UID, True)


async def test_thingmagic():
    device = ThingMagicDevice()
    device.see(EPC)
    async with PtyLine(device) as line:
        found = await first_read({"kind": "thingmagic", "device": line.path, "read_ms": 20, "poll_s": 0.05})
    assert found == (["connected"], EPC, True)


async def test_a_reader_that_prints():
    device = TextReaderDevice()
    device.tags.append(UID)
    async with PtyLine(device, tick_s=0.02) as line:
        assert await first_read({"kind": "text-serial", "device": line.path}) == (["connected"], UID, False)
    device = TextReaderDevice("rdm6300")
    device.tags.append("0A1B2C3D4E")
    async with TcpLine(device, tick_s=0.02) as line:
        section = {"kind": "text-tcp", "host": line.host, "port": line.port, "form": "rdm6300"}
        assert await first_read(section) == (["connected"], "0A1B2C3D4E", False)


async def test_llrp():
    async with LlrpEmulator(period_s=0.02) as reader:
        reader.see(EPC)
        states, tag, rounds = await first_read({"kind": "llrp", "host": "127.0.0.1", "port": reader.port})
    assert (states, tag, rounds) == (["connected"], EPC, False)
