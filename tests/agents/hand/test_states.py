"""Lines of a robot's state: what is taken, what is left, what is too much."""

from __future__ import annotations

import asyncio
import json
import os
import sys

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tms_agents.devices.transport import DeviceFault, DeviceState
from tms_agents.hand.state_sources import StdinStates, TcpStates, UdpStates, UnixStates, open_states
from tms_agents.hand.states import StateLines, StateMessage

GOOD = {"t": 1.5, "joints": {"a": 0.1}, "base": [1, 2, 3], "gripper": {"left": {"closed": True, "opening_m": 0.03}}}


def line(value: object = GOOD) -> bytes:
    return json.dumps(value).encode() + b"\n"


def test_the_documented_line():
    (message,) = StateLines().receive(line(GOOD | {"base_sd": [0.1, 0.02]}))
    assert message.base == (1, 2, 3) and message.base_sd == (0.1, 0.02)
    assert message.gripper["left"].closed and message.gripper["left"].effort is None


@given(st.lists(st.integers(1, 40), max_size=60))
def test_lines_cut_anywhere(sizes):
    data, lines, found = line() * 5, StateLines(), []
    for size in sizes:
        found += lines.receive(data[:size])
        data = data[size:]
    assert len(found + lines.receive(data)) == 5 and lines.bad == 0


@pytest.mark.parametrize(
    "bad",
    [
        b"\n\nnonsense\n",
        b'{"griper": {}}\n',
        b'{"joints": {"a": NaN}}\n',
        b'{"joints": {"a": 1e999}}\n',
        b'{"base": [1, 2]}\n',
        b'{"gripper": {"left": {"opening_m": "wide"}}}\n',
        b"[]\n",
        b"\xff\xfe\n",
        b"{" * 100_000 + b"\n",
        b"[" * 60_000 + b"\n",
    ],
)
def test_a_bad_line_is_counted_and_the_next_one_taken(bad, caplog):
    lines = StateLines()
    assert lines.receive(bad) == [] and lines.bad == 1
    assert "bad line (1 so far)" in caplog.text
    assert len(lines.receive(line())) == 1


def test_a_line_without_end_fills_no_memory():
    lines = StateLines()
    for _ in range(100):
        lines.receive(b"x" * 10_000)
    assert len(lines._rest) <= 1 << 16
    assert len(lines.receive(b"\n" + line())) == 1


def test_a_stranger_on_the_line_is_a_fault():
    lines = StateLines()
    with pytest.raises(DeviceFault, match="50 bad lines in a row"):
        lines.receive(b"hello\n" * 60)


@given(st.binary(max_size=300))
def test_any_bytes(data):
    for message in StateLines().receive(data + b"\n"):
        assert isinstance(message, StateMessage)


async def heard(source, count: int) -> list[StateMessage]:
    found: list[StateMessage] = []
    async with asyncio.timeout(10):
        states = open_states(source, silent_after_s=5)
        async for item in states:
            if isinstance(item, DeviceState):
                continue
            found += item
            if len(found) >= count:
                await states.aclose()
                return found
    raise AssertionError


async def test_sockets(tmp_path):
    async def serve(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        writer.write(line() * 3)
        await writer.drain()
        await reader.read()
        writer.close()

    tcp = await asyncio.start_server(serve, "127.0.0.1", 0)
    unix = await asyncio.start_unix_server(serve, tmp_path / "robot")
    port = tcp.sockets[0].getsockname()[1]
    try:
        assert len(await heard(TcpStates(kind="tcp", host="127.0.0.1", port=port), 3)) == 3
        assert len(await heard(UnixStates(kind="unix", path=tmp_path / "robot"), 3)) == 3
    finally:
        tcp.close()
        unix.close()
        await asyncio.sleep(0.05)


async def test_datagrams_with_and_without_newline(unused_udp_port):
    task = asyncio.create_task(heard(UdpStates(kind="udp", port=unused_udp_port), 3))
    loop = asyncio.get_running_loop()
    transport, _ = await loop.create_datagram_endpoint(
        asyncio.DatagramProtocol, remote_addr=("127.0.0.1", unused_udp_port)
    )
    while not task.done():
        transport.sendto(line().rstrip())
        transport.sendto(line() * 2)
        await asyncio.sleep(0.02)
    transport.close()
    assert len(task.result()) >= 3


async def test_standard_input_is_a_pipe(monkeypatch):
    read_end, write_end = os.pipe()
    with os.fdopen(read_end, "rb", 0) as standard_input, os.fdopen(write_end, "wb", 0) as robot:
        monkeypatch.setattr(sys, "stdin", standard_input)
        robot.write(line() * 2)
        assert len(await heard(StdinStates(kind="stdin"), 2)) == 2
        robot.write(line())  # it can be opened again
        assert len(await heard(StdinStates(kind="stdin"), 1)) == 1
        await asyncio.sleep(0)
