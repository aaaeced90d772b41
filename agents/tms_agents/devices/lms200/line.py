"""Opens the serial line of an LMS2xx, which may speak at any of its rates, and makes it speak at the wanted one.

Switched on it speaks at 9600 baud, unless set up otherwise, and keeps the rate it was last switched to until then.
"""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager

from tms_agents.devices import streams
from tms_agents.devices.lms200 import messages as m
from tms_agents.devices.lms200.codec import Frame, FrameParser
from tms_agents.devices.sessions import DeviceFault

_LOOK_S = 0.01


def serial_line(device: str, baud: int = 38400, *, patience_s: float = 1.0, settle_s: float = 0.25) -> streams.Opener:
    """An opener for ``transport.Link``: the line at ``baud`` (9600, 19200, 38400 or, on RS-422, 500000).

    Every rate is given ``patience_s`` seconds for an answer, the wanted one first. After a change of the rate the
    device is left alone for ``settle_s``.

    Raises:
        ValueError: no such rate.
        DeviceFault: when opened; no answer at any rate, or it refuses the wanted one.
    """
    if baud not in m.BAUD_CODES:
        raise ValueError(f"an LMS2xx speaks at {', '.join(map(str, sorted(m.BAUD_CODES)))} baud, not {baud}")

    async def open_() -> streams.Stream:
        for rate in dict.fromkeys([baud, 9600, *m.BAUD_CODES]):
            try:
                async with _line(device, rate) as line:
                    if not await _obeys(line, m.ON_REQUEST, patience_s):
                        continue
                    if rate == baud:
                        break
                    if not await _obeys(line, m.BAUD_CODES[baud], patience_s):
                        raise DeviceFault(f"the scanner speaks at {rate} baud and refuses {baud}")
                    break
            except (ValueError, OSError):
                if rate == baud:  # otherwise a rate that the adapter does not know
                    raise
        else:
            raise DeviceFault("the scanner answers at none of its rates")
        if rate != baud:
            await asyncio.sleep(settle_s)
        return await streams.serial(device, baud)()

    return open_


@asynccontextmanager
async def _line(device: str, rate: int) -> AsyncIterator[streams.Stream]:
    stream = await streams.serial(device, rate)()
    try:
        yield stream
    finally:
        await stream.close()


async def _obeys(line: streams.Stream, mode: int, patience_s: float) -> bool:
    """Whether the device answers that it has switched to ``mode``. Raises: OSError, the line has ended."""
    parser = FrameParser()
    line.write(Frame(m.switch_mode(mode)).encode())
    for _ in range(round(patience_s / _LOOK_S)):
        await asyncio.sleep(_LOOK_S)
        data = line.read()
        if data == b"":
            raise OSError("the line was closed")
        for item in parser.feed(data or b""):
            if isinstance(item, Frame) and item.code == m.reply_to(m.SWITCH_MODE):
                return item.data[:1] == b"\x00"
    return False
