"""Where the robot's state lines come from: a TCP or Unix socket, UDP datagrams, or standard input."""

from __future__ import annotations

import asyncio
import contextlib
import os
import sys
from collections import deque
from collections.abc import AsyncGenerator, Sequence
from dataclasses import dataclass
from typing import Annotated, Literal

from pydantic import Field

from tms_agents.config import LocalPath, Section
from tms_agents.devices.transport import DeviceState, Link, Opener, Stream, tcp
from tms_agents.hand.states import StateLines, StateMessage
from tms_agents.readers import Port

#: Datagrams that wait; beyond this the oldest is worth less than the newest.
_MAX_DATAGRAMS = 1000


class TcpStates(Section):
    """The robot listens, the agent connects."""

    kind: Literal["tcp"]
    host: str
    port: Port


class UnixStates(Section):
    kind: Literal["unix"]
    path: LocalPath


class UdpStates(Section):
    """The agent listens; each datagram holds one or more whole lines."""

    kind: Literal["udp"]
    host: str = "127.0.0.1"
    port: Annotated[int, Field(ge=0, le=65535)]


class StdinStates(Section):
    kind: Literal["stdin"]


StateSource = Annotated[TcpStates | UnixStates | UdpStates | StdinStates, Field(discriminator="kind")]


async def open_states(
    source: StateSource, *, silent_after_s: float
) -> AsyncGenerator[Sequence[StateMessage] | DeviceState, None]:
    """Messages in groups, and the state of this input like that of any device: for ever, through every failure."""
    link = Link(_opener(source), StateLines, name=_name(source), silent_after_s=silent_after_s, tick_s=0.1)
    async with contextlib.aclosing(link.listen()) as items:
        async for item in items:
            yield item


def _opener(source: StateSource) -> Opener:
    match source:
        case TcpStates():
            return tcp(source.host, source.port)
        case UnixStates():
            return lambda: _unix(str(source.path))
        case UdpStates():
            return lambda: _udp(source.host, source.port)
        case StdinStates():
            return _stdin


def _name(source: StateSource) -> str:
    match source:
        case TcpStates() | UdpStates():
            return f"robot state {source.kind} {source.host}:{source.port}"
        case UnixStates():
            return f"robot state {source.path}"
        case StdinStates():
            return "robot state on standard input"


async def _unix(path: str) -> Stream:
    reader, writer = await asyncio.open_unix_connection(path)
    return Stream(reader, writer.transport, writer.close)


class _Listening(Stream):
    """A stream of which nobody reads what we write."""

    def write(self, data: bytes) -> None:
        assert not data

    def unsent(self) -> int:
        return 0


async def _stdin() -> Stream:
    """Standard input, which must be a pipe or a terminal."""
    loop = asyncio.get_running_loop()
    reader = asyncio.StreamReader()
    # A copy: closing it leaves standard input for the next attempt.
    pipe = os.fdopen(os.dup(sys.stdin.fileno()), "rb", 0)
    transport, _ = await loop.connect_read_pipe(lambda: asyncio.StreamReaderProtocol(reader), pipe)
    return _Listening(reader, asyncio.WriteTransport(), transport.close)


async def _udp(host: str, port: int) -> Stream:
    loop = asyncio.get_running_loop()
    inbox = _Inbox()
    transport, _ = await loop.create_datagram_endpoint(lambda: inbox, local_addr=(host, port))
    return _Datagrams(asyncio.StreamReader(), asyncio.WriteTransport(), transport.close, inbox)


class _Inbox(asyncio.DatagramProtocol):
    def __init__(self) -> None:
        self.waiting: deque[bytes] = deque(maxlen=_MAX_DATAGRAMS)
        self.came = asyncio.Event()

    def datagram_received(self, data: bytes, addr: object) -> None:
        self.waiting.append(data)
        self.came.set()


@dataclass(slots=True)
class _Datagrams(_Listening):
    """Datagrams as lines, also where the robot leaves out the newline."""

    inbox: _Inbox

    async def read(self) -> bytes:
        await self.inbox.came.wait()
        self.inbox.came.clear()
        data = b"".join(one + b"\n" for one in self.inbox.waiting)
        self.inbox.waiting.clear()
        return data
