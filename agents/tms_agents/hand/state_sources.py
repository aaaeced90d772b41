"""Where the robot's state lines come from: a TCP or Unix socket, UDP datagrams, or standard input."""

from __future__ import annotations

import asyncio
import contextlib
import os
import socket
import sys
from collections.abc import AsyncGenerator, Sequence
from typing import Annotated, Literal

from pydantic import Field

from tms_agents.config import LocalPath, Section
from tms_agents.devices.transport import DeviceState, Link, Opener, Stream, tcp
from tms_agents.hand.states import StateLines, StateMessage
from tms_agents.readers import Port


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
    connection = socket.socket(socket.AF_UNIX)
    try:
        connection.setblocking(False)
        await asyncio.get_running_loop().sock_connect(connection, path)
    except BaseException:
        connection.close()
        raise
    return Stream(connection.fileno(), connection.close)


class _Listening(Stream):
    """A stream of which nobody reads what we write."""

    def write(self, data: bytes) -> None:
        assert not data


async def _stdin() -> Stream:
    """Standard input, which must be a pipe or a terminal."""
    # A copy: closing it leaves standard input for the next attempt.
    pipe = os.dup(sys.stdin.fileno())
    return _Listening(pipe, lambda: os.close(pipe))


async def _udp(host: str, port: int) -> Stream:
    addresses = await asyncio.get_running_loop().getaddrinfo(host, port, type=socket.SOCK_DGRAM)
    family, kind, protocol, _, address = addresses[0]
    inbox = socket.socket(family, kind, protocol)
    try:
        inbox.bind(address)
    except BaseException:
        inbox.close()
        raise
    return _Datagrams(inbox.fileno(), inbox.close)


class _Datagrams(_Listening):
    """Datagrams as lines, also where the robot leaves out the newline."""

    def read(self) -> bytes | None:
        data = super().read()
        return None if data is None else data + b"\n"
