"""A TR3 for tests and demos: behind a pseudo terminal or a TCP port, byte for byte."""

from __future__ import annotations

import asyncio
import contextlib
import os
import pty
import tty

from tms_agents.devices.tr3.codec import ACK, INVENTORY, MODE, NACK, READ, UID, Frame, FrameParser


class Tr3Device:
    """The reader without its line: bytes in, bytes out.

    A UID is reported once per antenna until the antenna is switched, as the real one does. ``silent`` and
    ``nack_next`` play faults.
    """

    def __init__(self, antennas: int = 2) -> None:
        self.tags: dict[int, list[str]] = {antenna: [] for antenna in range(antennas)}
        self.antenna = 0
        self.rf_on = True
        self.silent = False
        self.nack_next = 0
        self.heard: list[Frame] = []
        self._reported: set[str] = set()
        self._parser = FrameParser()

    def see(self, uid: str, antenna: int = 0) -> None:
        """A tag (UID in hex, as printed) comes before an antenna."""
        self.tags[antenna].append(uid.upper())

    def lose(self, uid: str) -> None:
        for tags in self.tags.values():
            with contextlib.suppress(ValueError):
                tags.remove(uid.upper())

    def receive(self, data: bytes) -> bytes:
        """The answer to what the host sent."""
        answer = b"".join(reply.encode() for frame in self._parser.feed(data) for reply in self._answer(frame))
        return b"" if self.silent else answer

    def _answer(self, frame: Frame) -> list[Frame]:
        self.heard.append(frame)
        if self.nack_next:
            self.nack_next -= 1
            return [Frame(NACK, b"\x44")]
        if frame.command == MODE and frame.data[:1] == b"\x9c" and len(frame.data) == 2:
            if frame.data[1] not in self.tags:
                return [Frame(NACK, b"\x44")]
            if frame.data[1] != self.antenna:
                self.antenna = frame.data[1]
                self._reported.clear()
            return [Frame(ACK, frame.data)]
        if frame.command == MODE and frame.data[:1] == b"\x9e" and len(frame.data) == 2:
            self.rf_on = bool(frame.data[1])
            return [Frame(ACK, frame.data)]
        if frame.command == MODE and len(frame.data) == 4:
            return [Frame(ACK)]
        if frame.command == READ and frame.data == b"\x90":
            return [Frame(ACK, b"\x90130060828")]
        if frame.command == INVENTORY and frame.data[:1] == b"\xf0":
            new = [uid for uid in self.tags[self.antenna] if uid not in self._reported and self.rf_on]
            self._reported.update(new)
            return [Frame(ACK, bytes([0xF0, len(new)]))] + [
                Frame(UID, b"\x00" + bytes.fromhex(uid)[::-1]) for uid in new
            ]
        return [Frame(NACK, b"\x44")]


class PtyLine:
    """Puts a device behind a pseudo terminal; ``path`` is what the driver opens."""

    def __init__(self, device: Tr3Device) -> None:
        self.device = device
        self.path = ""

    def inject(self, data: bytes) -> None:
        """Send bytes as they are: garbage, half a frame, RDLOOP frames."""
        os.write(self._master, data)

    async def __aenter__(self) -> PtyLine:
        self._master, self._slave = pty.openpty()
        tty.setraw(self._slave)
        os.set_blocking(self._master, False)
        self.path = os.ttyname(self._slave)
        asyncio.get_running_loop().add_reader(self._master, self._serve)
        return self

    async def __aexit__(self, *_: object) -> None:
        asyncio.get_running_loop().remove_reader(self._master)
        os.close(self._slave)
        os.close(self._master)

    def _serve(self) -> None:
        with contextlib.suppress(BlockingIOError):
            if answer := self.device.receive(os.read(self._master, 4096)):
                os.write(self._master, answer)


class TcpLine:
    """Puts a device behind a TCP port, as the LAN models are."""

    def __init__(self, device: Tr3Device, host: str = "127.0.0.1", port: int = 0) -> None:
        self.device, self.host, self.port = device, host, port
        self._writers: set[asyncio.StreamWriter] = set()
        self._idle = asyncio.Event()
        self._idle.set()

    def hang_up(self) -> None:
        """Cut all connections as a pulled cable does."""
        for writer in self._writers:
            writer.transport.abort()

    async def __aenter__(self) -> TcpLine:
        self._server = await asyncio.start_server(self._serve, self.host, self.port)
        self.port = self._server.sockets[0].getsockname()[1]
        return self

    async def __aexit__(self, *_: object) -> None:
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
