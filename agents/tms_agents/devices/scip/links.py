"""From an address to scans: the speed of a serial line, and links that say in words what they are linked to."""

from __future__ import annotations

import asyncio
import time
from collections.abc import Callable
from typing import TYPE_CHECKING

from tms_agents.devices.scans import Scan
from tms_agents.devices.scip.frames import Reply, ReplyParser
from tms_agents.devices.scip.session import ScipSession, ScipSettings
from tms_agents.devices.sessions import DeviceFault, DeviceState
from tms_agents.devices.streams import Opener, Stream
from tms_agents.devices.transport import Link
from tms_client.flows import Retry

if TYPE_CHECKING:
    from serial import Serial

#: Of the sensors with Ethernet.
PORT = 10940
#: Speeds that a serial line may have, the most likely ones first.
_BAUDS = (19200, 115200, 38400, 57600, 250000, 500000, 750000)
_REPLY_S, _SETTLE_S = 0.3, 0.15


class ScipLink(Link[Scan]):
    """A link whose state "connected" tells product and serial number, and what the sensor cannot do."""

    def __init__(
        self,
        opener: Opener,
        settings: ScipSettings | None = None,
        *,
        name: str,
        silent_after_s: float = 2.0,
        retry: Retry | None = None,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._latest: ScipSession | None = None

        def session() -> ScipSession:
            self._latest = ScipSession(settings, clock=clock)
            return self._latest

        super().__init__(opener, session, name=name, silent_after_s=silent_after_s, retry=retry)

    def _alive(self) -> list[DeviceState]:
        note = self._latest.note if self._latest is not None else ""
        return self._change("connected", f"{self._name}: {note}" if note else self._name)


def scip_serial(device: str, baud: int | None = None) -> Opener:
    """A serial line of a sensor, at whatever speed it has; it is set to ``baud`` where that is given and it can.

    USB is a line of any speed. The opener raises ``DeviceFault`` where nothing answers at any speed.
    """

    async def open_() -> Stream:
        from serial import Serial

        first = _BAUDS[0] if baud is None else baud
        # exclusive, inter_byte_timeout: as in streams.serial
        port = Serial(device, first, timeout=0, inter_byte_timeout=0, exclusive=True)
        stream = Stream(port.fileno(), port.close)
        try:
            found = await _find_speed(port, stream, first)
            if baud is not None and found != baud:
                await _set_speed(port, stream, baud)
        except BaseException:
            await stream.close()
            raise
        return stream

    return open_


async def _find_speed(port: Serial, stream: Stream, first: int) -> int:
    for baud in (first, *(one for one in _BAUDS if one != first)):
        port.baudrate = baud
        port.reset_input_buffer()
        if await _ask(stream, "QT") is not None:
            return baud
    raise DeviceFault("no answer to QT at any speed of the line")


async def _set_speed(port: Serial, stream: Stream, baud: int) -> None:
    command = f"SS{baud:06d}"
    reply = await _ask(stream, command)
    if reply is not None and len(reply.status) == 1:  # SCIP 1.1
        await _ask(stream, "SCIP2.0")
        reply = await _ask(stream, command)
    # anything else: the sensor has USB or Ethernet, or not that speed, and goes on with the one it has
    if reply is not None and reply.status == "00":
        port.baudrate = baud
        await asyncio.sleep(_SETTLE_S)
        if await _ask(stream, "QT") is None:
            raise DeviceFault(f"no answer at {baud} baud, which the sensor had accepted")


async def _ask(stream: Stream, command: str) -> Reply | None:
    """The reply to a command; None where nothing that is SCIP comes. Scans under way are passed over."""
    loop, parser, heard = asyncio.get_running_loop(), ReplyParser(), asyncio.Event()
    stream.write(b"\n" + command.encode() + b"\n")
    loop.add_reader(stream.fd, heard.set)
    other = None
    try:
        async with asyncio.timeout(_REPLY_S) as limit:
            while True:
                await heard.wait()
                heard.clear()
                data = stream.read()
                if data == b"":
                    return None
                for reply in parser.feed(data or b""):
                    if reply.command == command:
                        return reply
                    other = reply  # a sensor that measures: the speed is right, its answer will come
                    limit.reschedule(loop.time() + _REPLY_S)
    except TimeoutError:
        return other
    finally:
        loop.remove_reader(stream.fd)
