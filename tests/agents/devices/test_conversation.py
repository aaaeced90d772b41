"""How a link talks to a session: when it looks and ticks, whom it wakes, what it leaves behind."""

from __future__ import annotations

import asyncio
import contextlib
import os
import socket

import pytest
from link_listening import QUICK, until

from tms_agents.devices import waiting
from tms_agents.devices.outgoing import Outgoing
from tms_agents.devices.streams import Stream
from tms_agents.devices.transport import DeviceFault, DeviceState, Link, tcp


class Echo(Outgoing):
    """Delivers what it receives; ticked ``every_s``."""

    def __init__(self, every_s: float = 0.2, *, again: int = 0, last_word: bytes = b"") -> None:
        super().__init__()
        self.frames, self.ready, self.ticks = 0, True, 0
        self.every_s, self.again, self.last_word = every_s, again, last_word
        self.log: list[str] = []

    @property
    def tick_s(self) -> float:
        return 0.0 if self.again else self.every_s

    def opened(self) -> None:
        pass

    def receive(self, data: bytes) -> list[bytes]:
        self.log.append("receive")
        self.frames += 1
        if b"fault" in data:
            raise DeviceFault("it says fault")
        return [data]

    def tick(self) -> None:
        self.log.append("tick")
        self.again = max(0, self.again - 1)

    def closing(self) -> bytes:
        return self.last_word


@contextlib.contextmanager
def a_line():
    ours, theirs = socket.socketpair()
    theirs.setblocking(False)

    async def open_() -> Stream:
        return Stream(ours.fileno(), ours.close)

    with theirs, ours:
        yield theirs, open_, ours


async def test_what_came_before_a_fault_is_delivered_before_it():
    with a_line() as (device, opener, _):
        device.send(b"one")

        def act(item):
            if item == b"one":
                device.send(b"fault")

        seen = await until(Link(opener, Echo, name="it", retry=QUICK), lambda seen: len(seen) == 3, act)
        assert seen == [DeviceState("connected", "it"), b"one", DeviceState("faulty", "it: it says fault")]


async def test_readings_wait_for_others_where_they_may_and_states_do_not():
    with a_line() as (device, opener, _):
        link = Link(opener, lambda: Echo(0.01), name="it", retry=QUICK)
        link.gather_s = 0.6
        groups = []
        async with asyncio.timeout(5), contextlib.aclosing(link.listen()) as items:
            device.send(b"0")
            async for item in items:
                groups.append(item)
                if len(groups) == 2:  # the state came at once, and the first reading with it
                    break
            assert groups == [DeviceState("connected", "it"), [b"0"]]
            turn = asyncio.ensure_future(anext(items))
            for number in b"12345":
                device.send(bytes([number]))
                await asyncio.sleep(0.01)
            assert not turn.done()
            assert await turn == [b"1", b"2", b"3", b"4", b"5"]


async def test_a_session_that_wants_a_second_look_gets_it_at_once():
    session = Echo(0.05, again=2)
    with a_line() as (device, opener, _):
        link = Link(opener, lambda: session, name="it", retry=QUICK)
        device.send(b"x")
        await until(link, lambda seen: b"x" in seen)
    assert session.log[:3] == ["receive", "tick", "tick"]


async def test_nothing_stays_behind_when_the_listener_goes():
    with a_line() as (device, opener, ours):
        link = Link(opener, lambda: Echo(last_word=b"bye"), name="it", retry=QUICK)
        device.send(b"x")
        listening = asyncio.create_task(until(link, lambda seen: False))
        await asyncio.sleep(0.05)
        listening.cancel()
        await asyncio.gather(listening, return_exceptions=True)
        assert device.recv(10) == b"bye" and device.recv(10) == b""
        assert ours.fileno() == -1


async def test_a_device_that_takes_no_commands_is_a_fault_in_bounded_memory():
    class Talker(Echo):
        def tick(self) -> None:
            self._output += bytes(30_000)

    with a_line() as (_, opener, _):
        link = Link(opener, lambda: Talker(0.001), name="it", retry=QUICK)
        seen = await until(link, lambda seen: bool(seen))
        assert seen == [DeviceState("faulty", "it: the device takes no commands")]


async def test_what_the_line_does_not_take_at_once_goes_out_later_in_order():
    ours, theirs = socket.socketpair()
    with ours, theirs:
        stream = Stream(ours.fileno(), ours.close)
        sent = os.urandom(60_000)
        ours.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, 4096)
        for start in range(0, len(sent), 6_000):
            stream.write(sent[start : start + 6_000])
        assert stream.unsent() > 0
        theirs.setblocking(False)
        got = b""
        async with asyncio.timeout(5):
            while len(got) < len(sent):
                got += await asyncio.get_running_loop().sock_recv(theirs, 65536)
        assert got == sent and stream.unsent() == 0
        await stream.close()


async def test_readings_that_nobody_takes_stop_the_reading_and_none_is_lost(monkeypatch):
    monkeypatch.setattr("tms_agents.devices.conversation._MOST_WAITING", 5)
    with a_line() as (device, opener, _):
        got: list[int] = []
        link = Link(opener, lambda: Echo(0.01), name="it", retry=QUICK)
        async with asyncio.timeout(5), contextlib.aclosing(link.listen()) as items:
            device.send(b"\0")
            assert isinstance(await anext(items), DeviceState)
            for number in range(1, 60):
                device.send(bytes([number]))
                await asyncio.sleep(0.001)  # nobody listens meanwhile
            while len(got) < 60:
                for data in await anext(items):
                    got += data
        assert got == list(range(60))


async def test_a_host_that_refuses_is_named_and_tried_again():
    with socket.create_server(("127.0.0.1", 0)) as server:
        port = server.getsockname()[1]
    seen = await until(Link(tcp("127.0.0.1", port), Echo, name="it", retry=QUICK), lambda seen: bool(seen))
    assert seen[0].state == "faulty" and "Connect call failed" in seen[0].why


@pytest.mark.parametrize(
    "scenario",
    [
        test_what_came_before_a_fault_is_delivered_before_it,
        test_readings_wait_for_others_where_they_may_and_states_do_not,
        test_a_session_that_wants_a_second_look_gets_it_at_once,
        test_nothing_stays_behind_when_the_listener_goes,
        test_a_device_that_takes_no_commands_is_a_fault_in_bounded_memory,
        test_what_the_line_does_not_take_at_once_goes_out_later_in_order,
    ],
)
def test_the_same_in_the_event_loop_of_the_agents(scenario):
    waiting.run(scenario())
