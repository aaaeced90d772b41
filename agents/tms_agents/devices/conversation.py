"""One connection of a session, run by callbacks of the event loop: most turns wake nobody.

A turn is: read what is there, let the session take it, tick it, send what it wants to say. Something to read makes a
turn, and so does the time at which the session wants its next tick. Only readings, states and the end wake the task
that listens, and readings may wait for others to come (``gather_s``): a computer that was asleep takes several times as
long for a piece of work as one that does the same work again.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Sequence
from typing import Generic, TypeVar

from tms_agents.devices.beat import on_the_beat
from tms_agents.devices.sessions import DeviceState, Noted, Paced, Polled, Session
from tms_agents.devices.streams import Stream

T = TypeVar("T")

_SHORTEST_TICK_S = 0.001
#: Readings that nobody took: beyond this the device is not read any more.
_MOST_WAITING = 1000


class Conversation(Generic[T]):
    """``alive`` and ``silence`` judge the state of the device; ``tick_s`` is the longest time between two ticks.

    ``gather_s`` tells how long readings may wait before the listener is woken. Times are those of the event loop.
    """

    def __init__(
        self,
        session: Session[T],
        stream: Stream,
        *,
        alive: Callable[[], list[DeviceState]],
        silence: Callable[[float], list[DeviceState]],
        tick_s: float,
        gather_s: Callable[[], float] = lambda: 0.0,
    ) -> None:
        self._loop = asyncio.get_running_loop()
        self._session, self._stream, self._alive, self._silence = session, stream, alive, silence
        self._tick_s, self._gather_s = tick_s, gather_s
        self._paced = session if isinstance(session, Paced) else None
        self._polled = isinstance(session, Polled)
        self._noted, self._note = (session if isinstance(session, Noted) else None), ""
        self._heard: list[Sequence[T] | DeviceState] = []
        self._told_at, self._waiting = 0.0, 0
        self._well = self._urgent = False
        self._listener: asyncio.Future[None] | None = None
        self._timer: asyncio.TimerHandle | None = None
        self._due = self._alive_at = self._loop.time()
        self._frames = 0
        self._running, self._over = False, False
        self._error: Exception | None = None

    def begin(self) -> None:
        self._session.opened()
        self._stream.write(self._session.output())
        self._run()

    async def heard(self) -> list[Sequence[T] | DeviceState]:
        """What came since the last call, at least one thing; nothing at the end of the stream.

        Readings between two states are one group.

        Raises:
            DeviceFault, OSError: that ended it, after everything that came before.
        """
        if not self._heard and not self._over:
            self._listener = self._loop.create_future()
            await self._listener
        heard, self._heard, self._urgent, self._waiting = self._heard, [], False, 0
        self._told_at = self._loop.time()
        if not heard and self._error is not None:
            raise self._error
        if not self._running and not self._over:
            self._run()
        return heard

    def end(self) -> None:
        """No turn after this."""
        self._over = True
        self._pause()

    def _run(self) -> None:
        self._running = True
        if not self._polled:
            self._loop.add_reader(self._stream.fd, self._turn)
        self._schedule(self._loop.time(), self._wait_s())

    def _pause(self) -> None:
        if self._running and not self._polled:
            self._loop.remove_reader(self._stream.fd)
        self._running = False
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None

    def _turn(self) -> None:
        now = self._loop.time()
        try:
            self._look(now)
            if (wait_s := self._wait_s()) <= 0 and not self._over:
                self._look(now)
                wait_s = self._wait_s()
        except Exception as error:  # raised to the listener, whatever it is
            self._error = error
            self.end()
        if self._over or self._waiting >= _MOST_WAITING:
            self._pause()
            self._wake()
            return
        self._schedule(now, wait_s)
        if self._heard and (self._urgent or now - self._told_at >= self._gather_s() - _SHORTEST_TICK_S):
            self._wake()

    def _wake(self) -> None:
        if self._listener is not None and not self._listener.done():
            self._listener.set_result(None)

    def _look(self, now: float) -> None:
        session = self._session
        data = self._stream.read()
        if data == b"":
            self.end()
            return
        items = session.receive(data) if data else ()
        if session.frames > self._frames:
            self._alive_at, self._frames = now, session.frames
            if session.ready and (not self._well or (self._noted is not None and self._noted.note != self._note)):
                self._well, self._note = True, "" if self._noted is None else self._noted.note
                self._tell(self._alive())
        elif states := self._silence(now - self._alive_at):
            self._well = False
            self._tell(states)
        if items:
            self._waiting += len(items)
            last = self._heard[-1] if self._heard else None
            if isinstance(last, list):  # one group, so that the listener can tell how they lie in time
                last += items
            else:
                self._heard.append(list(items))
        session.tick()
        if output := session.output():
            self._stream.write(output)

    def _tell(self, states: list[DeviceState]) -> None:
        self._heard += states
        self._urgent = True

    def _wait_s(self) -> float:
        return self._tick_s if self._paced is None else min(self._tick_s, self._paced.tick_s)

    def _schedule(self, now: float, wait_s: float) -> None:
        """A timer that rings too early is left alone: it costs less than a new one at every byte."""
        self._due = on_the_beat(now + max(wait_s, _SHORTEST_TICK_S), wait_s)
        if self._timer is None or self._timer.when() > self._due:
            if self._timer is not None:
                self._timer.cancel()
            self._timer = self._loop.call_at(self._due, self._ring)

    def _ring(self) -> None:
        self._timer = None
        if self._due - self._loop.time() < _SHORTEST_TICK_S / 2:
            self._turn()
        else:
            self._timer = self._loop.call_at(self._due, self._ring)
