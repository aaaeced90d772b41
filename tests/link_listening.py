"""Emulated devices on a line of either kind, and listening to their link until something is heard."""

from __future__ import annotations

import asyncio
import contextlib
import inspect
import random
from collections.abc import AsyncIterator, Callable
from typing import Any

from tms_agents.devices.emulation import EmulatedDevice, PtyLine, TcpLine
from tms_agents.devices.loads import LoadSample
from tms_agents.devices.transport import DeviceState, Opener, serial, tcp
from tms_client import Retry

#: Reconnects at once.
QUICK = Retry(first_s=0.02, cap_s=0.05, random=random.Random(1))


@contextlib.asynccontextmanager
async def on_a_line(
    kind: str, device: EmulatedDevice, baud: int = 9600, *, tick_s: float | None = None
) -> AsyncIterator[tuple[PtyLine | TcpLine, Opener]]:
    """The device behind a pseudo terminal ("pty") or a port ("tcp"): its line, and what opens it."""
    if kind == "pty":
        async with PtyLine(device, tick_s=tick_s) as terminal:
            yield terminal, serial(terminal.path, baud)
    else:
        async with TcpLine(device, tick_s=tick_s) as port:
            yield port, tcp("127.0.0.1", port.port)


async def until(link, wanted: Callable[[list[Any]], object], act=None, timeout_s: float = 8.0) -> list[Any]:
    """All items and states until those so far are ``wanted``; ``act`` is called after each, and awaited if it must."""
    seen: list[Any] = []
    async with asyncio.timeout(timeout_s), contextlib.aclosing(link.listen()) as items:
        async for arrived in items:
            for item in [arrived] if isinstance(arrived, DeviceState) else arrived:
                seen.append(item)
                if wanted(seen):
                    return seen
                done = act(item) if act else None
                if inspect.isawaitable(done):
                    await done
    raise AssertionError("the link ended")


def samples(seen) -> list[LoadSample]:
    return [item for item in seen if isinstance(item, LoadSample)]


def states(seen) -> list[str]:
    return [item.state for item in seen if isinstance(item, DeviceState)]
