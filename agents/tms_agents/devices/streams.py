"""Open byte streams to devices: a file descriptor that never blocks, of a serial line, a socket or a pipe.

asyncio's own streams cost a task switch and several objects per read. A board of load cells answers two hundred times
a second, so here a read is one system call, made by who was told that there is something to read.
"""

from __future__ import annotations

import asyncio
import os
import socket
from collections.abc import Awaitable, Callable

from tms_agents.devices.sessions import DeviceFault

#: Commands waiting to be taken by the device: beyond this it is stuck.
_MAX_UNSENT_BYTES = 1 << 16
_READ_BYTES = 1 << 16
_LAST_WORD_S = 0.1


class Stream:
    """Owns ``fd`` from now on; ``release`` closes it."""

    def __init__(self, fd: int, release: Callable[[], object]) -> None:
        os.set_blocking(fd, False)
        self.fd = fd
        self._release = release
        self._unsent = bytearray()
        self._broken = False

    def read(self) -> bytes | None:
        """What is there; None where that is nothing, b"" at the end of the stream."""
        if self._broken:
            return b""
        try:
            return os.read(self.fd, _READ_BYTES)
        except BlockingIOError:
            return None
        except OSError:  # a serial device that was pulled out, a connection that was reset
            return b""

    def write(self, data: bytes) -> None:
        """Send now what the line takes, the rest as soon as it takes more.

        Raises:
            DeviceFault: too much waits already.
        """
        if self._broken:
            return
        if len(self._unsent) > _MAX_UNSENT_BYTES:
            raise DeviceFault("the device takes no commands")
        if data and not self._unsent:
            data = data[self._send(data) :]
            if data and not self._broken:
                asyncio.get_running_loop().add_writer(self.fd, self._send_rest)
        self._unsent += data

    def unsent(self) -> int:
        """Bytes that the line has not taken yet."""
        return 0 if self._broken else len(self._unsent)

    async def close(self) -> None:
        """Gives a last word a moment to leave, not more: a dead line must not be kept open by it."""
        try:
            for _ in range(10):
                if not self.unsent():
                    break
                await asyncio.sleep(_LAST_WORD_S / 10)
        finally:
            asyncio.get_running_loop().remove_writer(self.fd)
            self._release()

    def _send(self, data: bytes | bytearray) -> int:
        try:
            return os.write(self.fd, data)
        except BlockingIOError:
            return 0
        except OSError:  # the next read tells of the end
            self._broken = True
            return 0

    def _send_rest(self) -> None:
        del self._unsent[: self._send(self._unsent)]
        if not self.unsent():
            asyncio.get_running_loop().remove_writer(self.fd)


Opener = Callable[[], Awaitable[Stream]]


def tcp(host: str, port: int, timeout_s: float = 5.0) -> Opener:
    async def open_() -> Stream:
        async with asyncio.timeout(timeout_s):
            connection = await _connected(host, port)
        connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        return Stream(connection.fileno(), connection.close)

    return open_


def serial(device: str, baud: int, *, parity: str = "N", bits: int = 8, stop_bits: int = 1) -> Opener:
    """A serial line or a pseudo terminal, set up by pyserial."""

    async def open_() -> Stream:
        from serial import Serial

        # exclusive: two programs reading one line would each get half of it. inter_byte_timeout: VMIN = 1, so that a
        # read of nothing is told from the end of the line.
        port = Serial(
            device,
            baud,
            bytesize=bits,
            parity=parity,
            stopbits=stop_bits,
            timeout=0,
            inter_byte_timeout=0,
            exclusive=True,
        )
        port.reset_input_buffer()
        return Stream(port.fileno(), port.close)

    return open_


async def _connected(host: str, port: int) -> socket.socket:
    """The first address of the host that answers."""
    loop = asyncio.get_running_loop()
    refused: OSError = OSError(f"{host} has no address")
    for family, kind, protocol, _, address in await loop.getaddrinfo(host, port, type=socket.SOCK_STREAM):
        connection = socket.socket(family, kind, protocol)
        try:
            connection.setblocking(False)
            await loop.sock_connect(connection, address)
        except OSError as error:
            connection.close()
            refused = error
        except BaseException:
            connection.close()
            raise
        else:
            return connection
    raise refused
