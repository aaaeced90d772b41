"""The link that keeps a device alive: with streams and conversations the only place of the drivers that does I/O.

A driver is a ``Session``: it is told what arrived, returns readings, and collects what to send. ``Link`` opens the
stream, has a conversation, reconnects with backoff, and reports the device as connected, silent or faulty. Everything
happens in the event loop; there are no threads.
"""

from __future__ import annotations

import asyncio
import contextlib
from abc import ABC, abstractmethod
from collections.abc import AsyncGenerator, Callable, Sequence
from typing import Generic, Literal, TypeVar

from tms_agents.devices.conversation import Conversation
from tms_agents.devices.sessions import DeviceFault, DeviceState, Noted, Paced, Patient, Polled, Session
from tms_agents.devices.streams import Opener, Stream, serial, tcp
from tms_client.flows import Retry

__all__ = [
    "DeviceFault",
    "DeviceLink",
    "DeviceState",
    "Link",
    "Noted",
    "Opener",
    "Paced",
    "Patient",
    "Polled",
    "Session",
    "Stream",
    "serial",
    "tcp",
]

T = TypeVar("T")


class DeviceLink(ABC, Generic[T]):
    """Readings and states of one device, for as long as the caller listens; how it is asked is for subclasses.

    Nothing for ``silent_after_s`` seconds is "silent", for three times as long a fault; after a fault it connects anew.
    A fault stays told until the device delivers, or there is another one: silence says less than it does.
    """

    def __init__(self, *, name: str, silent_after_s: float, retry: Retry | None) -> None:
        self._name, self._silent_after_s = name, silent_after_s
        self._retry = retry or Retry(first_s=0.2, cap_s=10.0)
        self._state: DeviceState | None = None

    async def listen(self) -> AsyncGenerator[Sequence[T] | DeviceState, None]:
        """Readings in the groups they arrive in, and the state whenever it changes."""
        failures = 0
        while True:
            try:
                async with contextlib.aclosing(self._connection()) as items:
                    async for item in items:
                        if isinstance(item, DeviceState) and item.state == "connected":
                            failures = 0
                        yield item
                why = "the connection was closed by the device"
            except (OSError, ValueError, DeviceFault) as error:  # ValueError: an impossible baud rate or host name
                why = str(error) or type(error).__name__
            for state in self._change("faulty", f"{self._name}: {why}"):
                yield state
            failures += 1
            await asyncio.sleep(self._retry.pause(failures))

    @abstractmethod
    def _connection(self) -> AsyncGenerator[Sequence[T] | DeviceState, None]:
        """One connection to its end; a fault of the device is raised."""

    def _alive(self) -> list[DeviceState]:
        return self._change("connected", self._name)

    def _silence(self, lasts_s: float) -> list[DeviceState]:
        """What is to be said of a silence so long. Raises ``DeviceFault`` where it is too long."""
        if lasts_s > 3 * self._silent_after_s:
            raise DeviceFault(f"nothing for {3 * self._silent_after_s:g} s")
        if lasts_s > self._silent_after_s and (self._state is None or self._state.state != "faulty"):
            return self._change("silent", f"{self._name}: nothing for {self._silent_after_s:g} s")
        return []

    def _change(self, state: Literal["connected", "silent", "faulty"], why: str) -> list[DeviceState]:
        new = DeviceState(state, why[:500])
        if new == self._state:
            return []
        self._state = new
        return [new]


class Link(DeviceLink[T]):
    """The link of a ``Session`` over a byte stream.

    It ticks every ``tick_s`` seconds, or as often as the session wants it if that is more often. Readings may wait for
    others for ``gather_s``, which can be changed at any time; states never wait.
    """

    gather_s = 0.0

    def __init__(
        self,
        opener: Opener,
        session: Callable[[], Session[T]],
        *,
        name: str,
        silent_after_s: float = 10.0,
        tick_s: float = 0.2,
        retry: Retry | None = None,
    ) -> None:
        super().__init__(name=name, silent_after_s=silent_after_s, retry=retry)
        self._open, self._session, self._tick_s = opener, session, tick_s
        self._noted: Noted | None = None

    async def _connection(self) -> AsyncGenerator[Sequence[T] | DeviceState, None]:
        session = self._session()  # before the stream: settings that cannot be leave nothing open
        self._noted = session if isinstance(session, Noted) else None
        stream = await self._open()
        conversation = Conversation(
            session,
            stream,
            alive=self._alive,
            silence=self._silence,
            tick_s=self._tick_s,
            gather_s=lambda: self.gather_s,
        )
        try:
            conversation.begin()
            while heard := await conversation.heard():
                for item in heard:
                    yield item
        finally:
            conversation.end()
            with contextlib.suppress(DeviceFault):
                stream.write(session.closing())
            await stream.close()

    def _alive(self) -> list[DeviceState]:
        note = self._noted.note if self._noted is not None else ""
        return self._change("connected", f"{self._name}: {note}" if note else self._name)
