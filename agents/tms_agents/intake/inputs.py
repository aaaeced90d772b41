"""Keyboard, scanner and reader as one stream of inputs, each with its time."""

from __future__ import annotations

import asyncio
import contextlib
import os
from collections.abc import AsyncGenerator, AsyncIterator, Coroutine
from dataclasses import dataclass
from typing import Any

from tms_agents.devices.scanner import Scan
from tms_agents.devices.transport import DeviceState
from tms_agents.intake.scanners import ScannerSource, open_scanner
from tms_agents.readers import ReaderSource, Seen, open_reader

_TICK_S = 0.1
_LONGEST_LINE = 1000
#: Inputs waiting while the server is asked; beyond it their sources wait.
_MOST_WAITING = 1000


@dataclass(frozen=True, slots=True)
class Line:
    text: str


@dataclass(frozen=True, slots=True)
class Scanned:
    code: str


@dataclass(frozen=True, slots=True)
class Read:
    tag: str


@dataclass(frozen=True, slots=True)
class Device:
    """A device is in a new state."""

    name: str
    state: DeviceState


@dataclass(frozen=True, slots=True)
class Tick:
    pass


@dataclass(frozen=True, slots=True)
class End:
    """The keyboard is at its end: a pipe that was read, Ctrl-D."""


Input = Line | Scanned | Read | Device | Tick | End
Queue = asyncio.Queue[tuple[float, Input]]


@contextlib.asynccontextmanager
async def inputs(*sources: AsyncGenerator[Input, None]) -> AsyncIterator[Queue]:
    """All sources, and ticks, in one bounded queue with the time (of the loop) at which each came.

    A source that fails ends the work with its error.
    """
    queue: Queue = asyncio.Queue(_MOST_WAITING)
    clock = asyncio.get_running_loop().time

    async def pump(source: AsyncGenerator[Input, None]) -> None:
        async with contextlib.aclosing(source):
            async for one in source:
                await queue.put((clock(), one))

    owner = asyncio.current_task()
    failure: list[BaseException] = []

    def ended(task: asyncio.Task[None]) -> None:
        if not task.cancelled() and (error := task.exception()) is not None:
            failure.append(error)
            assert owner is not None
            owner.cancel()

    tasks = [_task(pump(source), ended) for source in (*sources, _ticks())]
    try:
        yield queue
    except asyncio.CancelledError:
        if failure:
            raise failure[0] from None
        raise
    finally:
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)


async def keyboard(fd: int) -> AsyncGenerator[Input, None]:
    """Lines of a terminal, a pipe or a file, without making its descriptor non-blocking: the terminal's is shared."""
    rest = b""
    while data := await _some(fd):
        # Empty lines count: they answer a question.
        *lines, rest = (rest + data).replace(b"\r\n", b"\n").replace(b"\r", b"\n").split(b"\n")
        for line in lines:
            yield Line(line[:_LONGEST_LINE].decode(errors="replace"))
        rest = rest[: _LONGEST_LINE + 1]
    if rest:
        yield Line(rest.decode(errors="replace"))
    yield End()


async def reader(source: ReaderSource, silent_after_s: float) -> AsyncGenerator[Input, None]:
    """What a tag reader sees, through all its failures. Raises ``CommandError`` where a capture cannot be read."""
    async with contextlib.aclosing(open_reader(source, silent_after_s=silent_after_s)) as arrivals:
        async for _, arrived in arrivals:
            if isinstance(arrived, DeviceState):
                yield Device("reader", arrived)
                continue
            for one in arrived:
                if isinstance(one, Seen):
                    yield Read(one.read.tag)


async def scanner(source: ScannerSource) -> AsyncGenerator[Input, None]:
    """What a barcode scanner delivers, through all its failures."""
    async with contextlib.aclosing(open_scanner(source)) as arrivals:
        async for arrived in arrivals:
            if isinstance(arrived, DeviceState):
                yield Device("scanner", arrived)
                continue
            for one in arrived:
                yield Scanned(one.code if isinstance(one, Scan) else one.text)


async def _some(fd: int) -> bytes:
    loop = asyncio.get_running_loop()
    ready = loop.create_future()
    try:
        loop.add_reader(fd, _set, ready)
    except PermissionError:  # a file: always ready
        ready.set_result(None)
    try:
        await ready
    finally:
        with contextlib.suppress(PermissionError):
            loop.remove_reader(fd)
    try:
        return os.read(fd, 4096)
    except OSError:  # the terminal was closed
        return b""


def _set(ready: asyncio.Future[None]) -> None:
    if not ready.done():
        ready.set_result(None)


async def _ticks() -> AsyncGenerator[Input, None]:
    while True:
        await asyncio.sleep(_TICK_S)
        yield Tick()


def _task(work: Coroutine[Any, Any, None], ended: Any) -> asyncio.Task[None]:
    task = asyncio.ensure_future(work)
    task.add_done_callback(ended)
    return task
