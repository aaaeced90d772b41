"""Emulated devices behind a real pseudo terminal or TCP port: what the byte-level emulators have in common.

An emulator is an ``EmulatedDevice``: bytes of the host in, bytes of the device out. The lines play what happens to
cables: ``inject`` garbage, ``hang_up`` (pulled out), ``plug_in`` again.
"""

from __future__ import annotations

import asyncio
import contextlib
import os
import pty
import tempfile
import termios
import tty
from abc import ABC, abstractmethod
from pathlib import Path
from typing import Protocol, runtime_checkable

_RATES = (9600, 19200, 38400, 57600, 115200, 230400, 460800, 500000, 921600)


class EmulatedDevice(Protocol):
    def receive(self, data: bytes) -> bytes:
        """The answer to what the host sent, in pieces of any size."""


@runtime_checkable
class StreamingDevice(EmulatedDevice, Protocol):
    """A device that also speaks by itself, if the line has a ``tick_s``."""

    def tick(self) -> bytes:
        """What the device sends by itself now; called every ``tick_s`` of its line."""


class _Line(ABC):
    def __init__(self, device: EmulatedDevice, tick_s: float | None) -> None:
        self.device, self._tick_s = device, tick_s

    @abstractmethod
    def inject(self, data: bytes) -> None:
        """Send bytes as they are: garbage, half a frame, what a device sends by itself."""

    async def __aenter__(self) -> None:
        self._ticking = asyncio.create_task(self._tick())

    async def __aexit__(self, *_: object) -> None:
        self._ticking.cancel()
        await asyncio.gather(self._ticking, return_exceptions=True)

    async def _tick(self) -> None:
        if self._tick_s is None or not isinstance(self.device, StreamingDevice):
            return
        while True:
            await asyncio.sleep(self._tick_s)
            if data := self.device.tick():
                self.inject(data)


class PtyLine(_Line):
    """Puts a device behind a pseudo terminal; ``path`` is what the driver opens.

    ``path`` is a link that leads to the present terminal, as /dev/serial/by-id does, so that a device that was pulled
    out comes back under its name. What nobody reads is lost, as on a real line.
    """

    def __init__(self, device: EmulatedDevice, *, tick_s: float | None = None) -> None:
        super().__init__(device, tick_s)
        self.path = ""
        self._ends: tuple[int, int] | None = None

    @property
    def baud(self) -> int:
        """The rate that the host has set; 0 where it is none of the usual ones, or the cable is out."""
        speed = termios.tcgetattr(self._ends[0])[4] if self._ends else 0
        return next((rate for rate in _RATES if speed == getattr(termios, f"B{rate}", None)), 0)

    def inject(self, data: bytes) -> None:
        with contextlib.suppress(BlockingIOError):
            if self._ends:
                os.write(self._ends[0], data)

    def hang_up(self) -> None:
        """Pull the cable: the terminal and its name go away."""
        if self._ends:
            asyncio.get_running_loop().remove_reader(self._ends[0])
            Path(self.path).unlink()
            for end in self._ends:
                os.close(end)
        self._ends = None

    def plug_in(self) -> None:
        master, slave = self._ends = pty.openpty()
        tty.setraw(slave)
        os.set_blocking(master, False)
        Path(self.path).symlink_to(os.ttyname(slave))
        asyncio.get_running_loop().add_reader(master, self._serve, master)

    async def __aenter__(self) -> PtyLine:  # type: ignore[override]
        self._folder = tempfile.TemporaryDirectory(prefix="tms-line-")
        self.path = f"{self._folder.name}/tty"
        self.plug_in()
        await super().__aenter__()
        return self

    async def __aexit__(self, *_: object) -> None:
        await super().__aexit__()
        self.hang_up()
        self._folder.cleanup()

    def _serve(self, master: int) -> None:
        with contextlib.suppress(BlockingIOError):
            if answer := self.device.receive(os.read(master, 4096)):
                self.inject(answer)


class TcpLine(_Line):
    """Puts a device behind a TCP port, as network models are."""

    def __init__(
        self, device: EmulatedDevice, host: str = "127.0.0.1", port: int = 0, *, tick_s: float | None = None
    ) -> None:
        super().__init__(device, tick_s)
        self.host, self.port = host, port
        self._writers: set[asyncio.StreamWriter] = set()
        self._idle = asyncio.Event()
        self._idle.set()

    def inject(self, data: bytes) -> None:
        for writer in self._writers:
            if writer.transport.get_write_buffer_size() < 1 << 16:
                writer.write(data)

    def hang_up(self) -> None:
        """Cut all connections as a pulled cable does."""
        for writer in self._writers:
            writer.transport.abort()

    async def __aenter__(self) -> TcpLine:  # type: ignore[override]
        self._server = await asyncio.start_server(self._serve, self.host, self.port)
        self.port = self._server.sockets[0].getsockname()[1]
        await super().__aenter__()
        return self

    async def __aexit__(self, *_: object) -> None:
        await super().__aexit__()
        self._server.close()
        self.hang_up()
        await self._idle.wait()

    async def _serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        self._writers.add(writer)
        self._idle.clear()
        try:
            with contextlib.suppress(ConnectionError):
                while data := await reader.read(4096):
                    writer.write(self.device.receive(data))
        finally:
            self._writers.discard(writer)
            writer.close()
            if not self._writers:
                self._idle.set()
