"""One connection of a session, served while the event loop waits (``devices.waiting``): most turns wake nobody.

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
from tms_agents.devices.sessions import Asking, DeviceState, Noted, Paced, Patient, Polled, Prompt, Session
from tms_agents.devices.streams import Stream
from tms_agents.devices.waiting import Watch, watch

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
        self._patient = session if isinstance(session, Patient) else None
        self._polled = isinstance(session, Polled)
        self._prompt: Prompt[T] | None = session if isinstance(session, Prompt) else None
        self._asking: Asking[T] | None = session if isinstance(session, Asking) else None
        self._noted, self._note = (session if isinstance(session, Noted) else None), ""
        self._heard: list[Sequence[T] | DeviceState] = []
        self._told_at, self._waiting = 0.0, 0
        self._well = self._urgent = False
        self._listener: asyncio.Future[None] | None = None
        self._watch: Watch | None = None
        self._alive_at = self._loop.time()
        self._frames = 0
        self._over = False
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
        if not self._over and not (self._heard and (self._watch is None or self._ripe(self._loop.time()))):
            self._listener = self._loop.create_future()
            await self._listener
        heard, self._heard, self._urgent, self._waiting = self._heard, [], False, 0
        self._told_at = self._loop.time()
        if not heard and self._error is not None:
            raise self._error
        if self._watch is None and not self._over:
            self._run()
        return heard

    def end(self) -> None:
        """No turn after this."""
        self._over = True
        self._pause()

    def _run(self) -> None:
        self._watch = watch(None if self._polled else self._stream.fd, self._turn)
        self._schedule(self._watch, self._loop.time(), self._wait_s())

    def _pause(self) -> None:
        if self._watch is not None:
            self._watch.close()
            self._watch = None

    def _turn(self, readable: bool) -> bool:
        try:
            now = self._loop.time()
            if (asking := self._asking) is None:
                if self._prompt is not None:
                    self._prompt.prompt = self._gather_s() <= 0
                self._take(now, self._stream.read() if readable or self._polled else None)
            elif not (data := self._stream.read()):
                asking.prompt = self._gather_s() <= 0
                asking.nothing_by(now)
                self._take(now, data)
            elif (question := asking.answered(data)) is None:
                self._take(now, data)
            else:
                if question:
                    self._stream.write(question)
                if (question or not asking.prompt) and self._watch is not None and now < self._watch.due:
                    return False
            if (wait_s := self._wait_s()) <= 0 and not self._over:
                self._take(now, self._stream.read())
                wait_s = self._wait_s()
        except Exception as error:  # raised to the listener, whatever it is
            self._error = error
            self.end()
        if self._watch is None or self._waiting >= _MOST_WAITING:
            self._pause()
            return self._wake()
        self._schedule(self._watch, now, wait_s)
        return self._wake() if self._heard and self._ripe(now) else False

    def _ripe(self, now: float) -> bool:
        """Whether what was heard may go to the listener."""
        return self._urgent or now - self._told_at >= self._gather_s() - _SHORTEST_TICK_S

    def _wake(self) -> bool:
        if self._listener is None or self._listener.done():
            return False
        self._listener.set_result(None)
        return True

    def _take(self, now: float, data: bytes | None) -> None:
        session = self._session
        items: Sequence[T] = ()
        if data:
            items = session.receive(data)
        elif data is not None:
            self.end()
            return
        if session.frames > self._frames:
            self._alive_at, self._frames = now, session.frames
            if session.ready and (not self._well or (self._noted is not None and self._noted.note != self._note)):
                self._well, self._note = True, "" if self._noted is None else self._noted.note
                self._tell(self._alive())
        elif (self._patient is None or now - self._alive_at > self._patient.quiet_s) and (
            states := self._silence(now - self._alive_at)
        ):
            self._well = False
            self._tell(states)
        if items:
            self._add(items)
        session.tick()
        if self._prompt is not None and (items := self._prompt.finished()):
            self._add(items)
        if output := session.output():
            self._stream.write(output)

    def _add(self, items: Sequence[T]) -> None:
        self._waiting += len(items)
        last = self._heard[-1] if self._heard else None
        if isinstance(last, list):  # one group, so that the listener can tell how they lie in time
            last += items
        else:
            self._heard.append(list(items))

    def _tell(self, states: list[DeviceState]) -> None:
        self._heard += states
        self._urgent = True

    def _wait_s(self) -> float:
        return self._tick_s if self._paced is None else min(self._tick_s, self._paced.tick_s)

    def _schedule(self, watch: Watch, now: float, wait_s: float) -> None:
        """A turn too early is left as it is: it costs less than to find the right moment after every byte."""
        latest = now + max(wait_s, _SHORTEST_TICK_S)
        if not now < watch.due <= latest:
            watch.due = on_the_beat(latest, wait_s)
