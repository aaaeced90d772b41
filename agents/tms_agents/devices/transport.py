"""Byte streams to devices and the link that keeps one alive: the only place of the drivers that does I/O.

A driver is a ``Session``: it is told what arrived, returns readings, and collects what to send. ``Link`` opens the
stream, feeds sessions, reconnects with backoff, and reports the device as connected, silent or faulty.
"""

from __future__ import annotations

import asyncio
import contextlib
import os
from abc import ABC, abstractmethod
from collections.abc import AsyncGenerator, Awaitable, Callable, Sequence
from dataclasses import dataclass
from typing import Generic, Literal, Protocol, TypeVar, runtime_checkable

from tms_client.flows import Retry

T = TypeVar("T")
T_co = TypeVar("T_co", covariant=True)

#: Commands waiting to be taken by the device: beyond this it is stuck.
_MAX_UNSENT_BYTES = 1 << 16
_READ_BYTES = 1 << 16
_SHORTEST_TICK_S = 0.001
_LAST_WORD_S = 0.1


class DeviceFault(Exception):
    """The device refuses or answers nonsense; the text says why. The link starts anew."""


@dataclass(frozen=True, slots=True)
class DeviceState:
    state: Literal["connected", "silent", "faulty"]
    why: str = ""


class Session(Protocol[T_co]):
    """The protocol of one connection, without I/O. Each method may raise ``DeviceFault``."""

    #: Valid frames so far: the sign of life. ``ready``: the device is set up and delivers.
    frames: int
    ready: bool

    def opened(self) -> None:
        """The stream is open."""

    def receive(self, data: bytes) -> Sequence[T_co]:
        """Take bytes in pieces of any size; returns the readings they complete."""

    def tick(self) -> None:
        """Called several times a second, more often where the session is ``Paced``: poll, keep alive."""

    def output(self) -> bytes:
        """Bytes to send now; each is given out once."""

    def closing(self) -> bytes:
        """What to send before the stream is closed on our side."""


@runtime_checkable
class Paced(Protocol):
    """A session that has to be ticked every ``tick_s`` seconds to keep its pace."""

    tick_s: float


@runtime_checkable
class Polled(Paced, Protocol):
    """A paced session whose input is looked at once per tick, not at every byte: far fewer turns of the event loop."""

    polled: bool


@dataclass(slots=True)
class Stream:
    """An open byte stream. ``read`` returns b"" at its end."""

    reader: asyncio.StreamReader
    transport: asyncio.WriteTransport
    close_all: Callable[[], None]

    async def read(self) -> bytes:
        try:
            return await self.reader.read(_READ_BYTES)
        except OSError:  # a serial device that was pulled out
            return b""

    def write(self, data: bytes) -> None:
        if self.unsent() > _MAX_UNSENT_BYTES:
            raise DeviceFault("the device takes no commands")
        if data:
            self.transport.write(data)

    async def close(self) -> None:
        self.close_all()
        await asyncio.sleep(0)  # transports close in the next turn of the loop
        if self.unsent():  # a last word that nobody takes must not keep a dead line open
            await asyncio.sleep(_LAST_WORD_S)
            self.transport.abort()
            await asyncio.sleep(0)

    def unsent(self) -> int:
        """Bytes that the line has not taken yet."""
        return self.transport.get_write_buffer_size()


Opener = Callable[[], Awaitable[Stream]]


def tcp(host: str, port: int, timeout_s: float = 5.0) -> Opener:
    async def open_() -> Stream:
        async with asyncio.timeout(timeout_s):
            reader, writer = await asyncio.open_connection(host, port)
        return Stream(reader, writer.transport, writer.close)

    return open_


def serial(device: str, baud: int, *, parity: str = "N", bits: int = 8, stop_bits: int = 1) -> Opener:
    """A serial line or a pseudo terminal, through pyserial (which sets it up) and asyncio (which waits for it)."""

    async def open_() -> Stream:
        from serial import Serial

        # exclusive: two programs reading one line would each get half of it
        port = Serial(device, baud, bytesize=bits, parity=parity, stopbits=stop_bits, timeout=0, exclusive=True)
        port.reset_input_buffer()
        loop = asyncio.get_running_loop()
        reader = asyncio.StreamReader()
        source, _ = await loop.connect_read_pipe(lambda: asyncio.StreamReaderProtocol(reader), port)
        sink, _ = await loop.connect_write_pipe(asyncio.BaseProtocol, os.fdopen(os.dup(port.fileno()), "wb", 0))

        def close() -> None:
            source.close()
            sink.close()

        return Stream(reader, sink, close)

    return open_


class DeviceLink(ABC, Generic[T]):
    """Readings and states of one device, for as long as the caller listens; how it is asked is for subclasses.

    Nothing for ``silent_after_s`` seconds is "silent", for three times as long a fault; after a fault it connects anew.
    """

    def __init__(self, *, name: str, silent_after_s: float, retry: Retry | None) -> None:
        self._name, self._silent_after_s = name, silent_after_s
        self._retry = retry or Retry(first_s=0.2, cap_s=10.0)
        self._state: DeviceState | None = None

    async def listen(self) -> AsyncGenerator[Sequence[T] | DeviceState, None]:
        """Readings in the groups they arrive in, and the state whenever it changes."""
        failures = 0
        while True:
            try:
                async with contextlib.aclosing(self._connection()) as items:
                    async for item in items:
                        if isinstance(item, DeviceState) and item.state == "connected":
                            failures = 0
                        yield item
                why = "the connection was closed by the device"
            except (OSError, ValueError, DeviceFault) as error:  # ValueError: an impossible baud rate or host name
                why = str(error) or type(error).__name__
            for state in self._change("faulty", f"{self._name}: {why}"):
                yield state
            failures += 1
            await asyncio.sleep(self._retry.pause(failures))

    @abstractmethod
    def _connection(self) -> AsyncGenerator[Sequence[T] | DeviceState, None]:
        """One connection to its end; a fault of the device is raised."""

    def _alive(self) -> list[DeviceState]:
        return self._change("connected", self._name)

    def _silence(self, lasts_s: float) -> list[DeviceState]:
        """What is to be said of a silence so long. Raises ``DeviceFault`` where it is too long."""
        if lasts_s > 3 * self._silent_after_s:
            raise DeviceFault(f"nothing for {3 * self._silent_after_s:g} s")
        if lasts_s > self._silent_after_s:
            return self._change("silent", f"{self._name}: nothing for {self._silent_after_s:g} s")
        return []

    def _change(self, state: Literal["connected", "silent", "faulty"], why: str) -> list[DeviceState]:
        new = DeviceState(state, why[:500])
        if new == self._state:
            return []
        self._state = new
        return [new]


class Link(DeviceLink[T]):
    """The link of a ``Session`` over a byte stream.

    It ticks every ``tick_s`` seconds, or as often as the session wants it if that is more often.
    """

    def __init__(
        self,
        opener: Opener,
        session: Callable[[], Session[T]],
        *,
        name: str,
        silent_after_s: float = 10.0,
        tick_s: float = 0.2,
        retry: Retry | None = None,
    ) -> None:
        super().__init__(name=name, silent_after_s=silent_after_s, retry=retry)
        self._open, self._session, self._tick_s = opener, session, tick_s

    async def _connection(self) -> AsyncGenerator[Sequence[T] | DeviceState, None]:
        session = self._session()  # before the stream: settings that cannot be leave nothing open
        stream = await self._open()
        tick_s = self._tick_s
        if isinstance(session, Paced):
            tick_s = min(tick_s, max(session.tick_s, _SHORTEST_TICK_S))
        clock = asyncio.get_running_loop().time
        alive, frames = clock(), 0
        try:
            session.opened()
            stream.write(session.output())
            due, polled = clock(), isinstance(session, Polled)
            tick_s = session.tick_s if isinstance(session, Polled) else tick_s
            while True:
                if polled:
                    due = max(due + tick_s, clock())
                    await asyncio.sleep(due - clock())
                    data = await _within(_SHORTEST_TICK_S, stream.read())
                else:
                    data = await _within(tick_s, stream.read())
                if data == b"":
                    return
                items = session.receive(data) if data else ()
                if session.frames > frames:
                    alive, frames = clock(), session.frames
                    states = self._alive() if session.ready else []
                else:
                    states = self._silence(clock() - alive)
                for state in states:
                    yield state
                if items:
                    yield items
                session.tick()
                stream.write(session.output())
        finally:
            with contextlib.suppress(DeviceFault):
                stream.write(session.closing())
            await stream.close()


async def _within(seconds: float, awaitable: Awaitable[bytes]) -> bytes | None:
    """The result, or None where it took longer."""
    try:
        async with asyncio.timeout(seconds):
            return await awaitable
    except TimeoutError:
        return None
