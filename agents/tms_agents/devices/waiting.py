"""Devices are served where the event loop waits: by one call, without handles, timers and turns of the loop.

A board of load cells answers two hundred times a second. Handing an answer through asyncio costs the computer more than
the board's question, its answer and all that is made of it, so a ``DeviceLoop`` does it itself while it waits for
everything else. There are no threads in this: a device is served only while the loop has nothing to do. In any other
event loop the same goes through its readers and timers.
"""

from __future__ import annotations

import asyncio
import math
import select
import selectors
import time
from collections.abc import Callable, Mapping
from typing import Any, Protocol

#: A timer of the event loop that rings so early is in time, seconds.
_EARLY_S = 0.0005

#: Serves a device, told whether there may be something to read; tells whether tasks of the loop have to go on now.
Turn = Callable[[bool], bool]


class Watch(Protocol):
    """A device that is watched. ``due`` (seconds, time of the loop): when it has its turn at the latest."""

    due: float

    def close(self) -> None:
        """No turn after this."""


def watch(fd: int | None, turn: Turn) -> Watch:
    """Call ``turn`` when there is something to read from ``fd``, and when it is ``due``. It must not raise."""
    loop = asyncio.get_running_loop()
    return loop.devices.watch(fd, turn) if isinstance(loop, DeviceLoop) else _ByLoop(loop, fd, turn)


def run(main: Any) -> Any:
    """Run a coroutine as ``asyncio.run`` does, in a ``DeviceLoop`` where the system can do that."""
    with asyncio.Runner(loop_factory=DeviceLoop if hasattr(select, "epoll") else None) as runner:
        return runner.run(main)


class DeviceLoop(asyncio.SelectorEventLoop):
    def __init__(self) -> None:
        self.devices = DeviceSelector()
        super().__init__(self.devices)


class DeviceSelector(selectors.BaseSelector):
    """What asyncio waits for, and the devices beside it: its ``select`` comes back only for what asyncio waits for."""

    def __init__(self) -> None:
        self._others = selectors.EpollSelector()
        self._epoll = select.epoll()
        self._epoll.register(self._others.fileno(), select.EPOLLIN)
        self._watches: tuple[_Direct, ...] = ()
        self._by_fd: dict[int, _Direct] = {}

    def watch(self, fd: int | None, turn: Turn) -> Watch:
        new = _Direct(self, fd, turn)
        if fd is not None:
            self._epoll.register(fd, select.EPOLLIN)
            self._by_fd[fd] = new
        self._watches += (new,)
        return new

    def forget(self, fd: int | None, old: _Direct) -> None:
        self._watches = tuple(one for one in self._watches if one is not old)
        if fd is not None and self._by_fd.get(fd) is old:
            del self._by_fd[fd]
            self._epoll.unregister(fd)

    def select(self, timeout: float | None = None) -> list[tuple[selectors.SelectorKey, int]]:
        if not self._watches:
            return self._others.select(timeout)
        clock, by_fd = time.monotonic, self._by_fd
        now = clock()
        end = math.inf if timeout is None else now + timeout
        while True:
            due = end
            for one in self._watches:
                if one.due < due:
                    due = one.due
            others = wanted = False
            wait_s = -1 if due == math.inf else max(due - now, 0.0)
            for fd, _ in self._epoll.poll(wait_s):
                if (found := by_fd.get(fd)) is None:
                    others = True
                elif found.turn(True):
                    wanted = True
            now = clock()
            for one in self._watches:
                if one.due <= now and one.turn(False):
                    wanted = True
            if others:
                return self._others.select(0)
            if wanted or now >= end:
                return []

    # what asyncio waits for

    def register(self, fileobj: Any, events: int, data: Any = None) -> selectors.SelectorKey:
        return self._others.register(fileobj, events, data)

    def unregister(self, fileobj: Any) -> selectors.SelectorKey:
        return self._others.unregister(fileobj)

    def modify(self, fileobj: Any, events: int, data: Any = None) -> selectors.SelectorKey:
        return self._others.modify(fileobj, events, data)

    def get_map(self) -> Mapping[Any, selectors.SelectorKey]:
        return self._others.get_map()

    def close(self) -> None:
        self._epoll.close()
        self._others.close()


class _Direct:
    __slots__ = ("_fd", "_selector", "due", "turn")

    def __init__(self, selector: DeviceSelector, fd: int | None, turn: Turn) -> None:
        self._selector, self._fd, self.turn = selector, fd, turn
        self.due = math.inf

    def close(self) -> None:
        self.due = math.inf
        self._selector.forget(self._fd, self)


class _ByLoop:
    """The same in any event loop."""

    def __init__(self, loop: asyncio.AbstractEventLoop, fd: int | None, turn: Turn) -> None:
        self._loop, self._fd, self._turn = loop, fd, turn
        self._timer: asyncio.TimerHandle | None = None
        self._due = math.inf
        if fd is not None:
            loop.add_reader(fd, turn, True)

    @property
    def due(self) -> float:
        return self._due

    @due.setter
    def due(self, due: float) -> None:
        """A timer that rings too early is left alone: it costs less than a new one at every byte."""
        self._due = due
        if self._timer is None or self._timer.when() > due:
            if self._timer is not None:
                self._timer.cancel()
            self._timer = self._loop.call_at(due, self._ring)

    def close(self) -> None:
        if self._fd is not None:
            self._loop.remove_reader(self._fd)
            self._fd = None
        if self._timer is not None:
            self._timer.cancel()

    def _ring(self) -> None:
        self._timer = None
        if self._due - self._loop.time() < _EARLY_S:
            self._due = -math.inf
            self._turn(True)
        else:
            self._timer = self._loop.call_at(self._due, self._ring)
