"""What happens to polled readers in the field, over real terminals and sockets: state and reason, recovery, truth.

Each reader has one tag at its first antenna and none at its second. Whatever is done to it, no other tag may come, and
no round may end with another result.
"""

from __future__ import annotations

import asyncio
import contextlib
from dataclasses import dataclass, field

import pytest
from device_conversation import rounds
from link_listening import QUICK, on_a_line

from tms_agents.devices.emulation import PtyLine
from tms_agents.devices.tags import RoundEnd, TagItem
from tms_agents.devices.thingmagic import messages as m
from tms_agents.devices.thingmagic.emulator import ThingMagicDevice
from tms_agents.devices.thingmagic.session import ThingMagicSession
from tms_agents.devices.tr3.emulator import Tr3Device
from tms_agents.devices.tr3.session import Tr3Session
from tms_agents.devices.transport import DeviceState, Link

TAG = "E00401004E17F97A"
SILENT_AFTER_S = 0.35


def tr3() -> tuple[Tr3Device, tuple[int, int], object]:
    device = Tr3Device()
    device.see(TAG)
    return device, (0, 1), lambda: Tr3Session(antennas=(0, 1), poll_s=0.02, reply_s=0.08)


def thingmagic() -> tuple[ThingMagicDevice, tuple[int, int], object]:
    device = ThingMagicDevice()
    device.see(TAG)
    return device, (1, 2), lambda: ThingMagicSession(antennas=(1, 2), poll_s=0.02, read_ms=10, reply_s=0.08)


@dataclass
class Listener:
    """Follows a link; ``until`` waits for a state, or for so many rounds more."""

    link: Link[TagItem]
    items: list[TagItem] = field(default_factory=list)
    states: list[DeviceState] = field(default_factory=list)
    news: asyncio.Event = field(default_factory=asyncio.Event)

    async def __aenter__(self) -> Listener:
        self.task = asyncio.create_task(self._listen())
        return self

    async def __aexit__(self, *_: object) -> None:
        self.task.cancel()
        await asyncio.gather(self.task, return_exceptions=True)

    async def _listen(self) -> None:
        async with contextlib.aclosing(self.link.listen()) as groups:
            async for group in groups:
                if isinstance(group, DeviceState):
                    self.states.append(group)
                else:
                    self.items += group
                self.news.set()

    async def until(self, state: str) -> None:
        await self._wait(lambda: bool(self.states) and self.states[-1].state == state)

    async def more_rounds(self, count: int = 4) -> None:
        wanted = self._ends() + count
        await self._wait(lambda: self._ends() >= wanted)

    def _ends(self) -> int:
        return sum(isinstance(item, RoundEnd) for item in self.items)

    async def _wait(self, wanted) -> None:
        async with asyncio.timeout(8):
            while not wanted():
                self.news.clear()
                await self.news.wait()


@pytest.fixture(params=["tr3 pty", "tr3 tcp", "thingmagic pty", "thingmagic tcp"])
async def at_work(request):
    """A reader, its line and a listener that has seen rounds; afterwards nothing untrue may have come."""
    reader, kind = request.param.split()
    make = {"tr3": tr3, "thingmagic": thingmagic}[reader]
    device, (first, second), session = make()
    async with on_a_line(kind, device, 38400) as (line, opener):
        link = Link(opener, session, name="reader", silent_after_s=SILENT_AFTER_S, tick_s=0.01, retry=QUICK)
        async with Listener(link) as listener:
            await listener.more_rounds()
            yield device, line, listener
            await listener.more_rounds()
    truth = {first: {TAG}, second: set()}
    assert all(tags == truth[antenna] for antenna, tags in rounds(listener.items))
    assert listener.states[-1] == DeviceState("connected", "reader")


async def test_the_cable_is_pulled_and_plugged_in_again(at_work):
    _, line, listener = at_work
    line.hang_up()
    await listener.until("faulty")
    if isinstance(line, PtyLine):
        await asyncio.sleep(0.1)
        line.plug_in()
    await listener.until("connected")
    assert [state.state for state in listener.states][:2] == ["connected", "faulty"]
    assert "closed by the device" in listener.states[1].why


async def test_the_reader_falls_silent(at_work):
    device, _, listener = at_work
    device.silent = True
    await listener.until("silent")
    device.silent = False
    await listener.until("connected")
    assert [state.state for state in listener.states] == ["connected", "silent", "connected"]
    assert listener.states[1].why == f"reader: nothing for {SILENT_AFTER_S:g} s"


async def test_the_reader_refuses(at_work):
    device, _, listener = at_work
    if isinstance(device, Tr3Device):
        device.inventory_options = ()
    else:
        device.fail[m.READ_MULTIPLE] = 0x0504
    await listener.until("faulty")
    if isinstance(device, Tr3Device):
        assert listener.states[-1].why.endswith("format error")
        device.inventory_options = (0x00,)
    else:
        assert listener.states[-1].why == "reader: the reader refuses command 22 (antenna 1): status 0504 too hot"
        device.fail.clear()
    await listener.until("connected")


@pytest.mark.parametrize("cut", [1, 9])
async def test_the_reader_is_switched_off_and_on_in_the_middle_of_a_frame(at_work, cut):
    device, _, listener = at_work
    for cycles in (1, 2):
        device.power_cycle_after = cut
        await listener.more_rounds(6)
        assert device.power_cycles == cycles
    assert [state.state for state in listener.states] == ["connected"]


async def test_garbage_on_the_line(at_work):
    _, line, listener = at_work
    for garbage in (b"\x02\x00\x49\xf0", b"\xff\xf0\x22", bytes(range(256)), b"\x02\x00\x30\x02\xf0"):
        line.inject(garbage)
        await listener.more_rounds(3)
    assert [state.state for state in listener.states] == ["connected"]
