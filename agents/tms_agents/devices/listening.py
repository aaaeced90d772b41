"""Sessions that only listen: to devices that speak when something happens and are quiet otherwise."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import Generic, TypeVar

from tms_agents.devices.framing import FrameBuffer
from tms_agents.devices.outgoing import Outgoing

T = TypeVar("T")


class ListeningSession(Outgoing, ABC, Generic[T]):
    """The open line is all the life such a device shows: it alone makes it connected.

    What has begun and goes no further for ``idle_s`` is dropped.
    """

    def __init__(self, parser: FrameBuffer, *, idle_s: float, clock: Callable[[], float]) -> None:
        super().__init__()
        self.frames = 0
        self.ready = True
        self.tick_s = 0.05
        self._parser, self._idle_s, self._clock = parser, idle_s, clock
        self._since = clock()

    def opened(self) -> None:
        self.frames += 1

    def receive(self, data: bytes) -> list[T]:
        self._since = self._clock()
        return self._heard(data)

    def tick(self) -> None:
        if self._parser.pending and self._clock() - self._since > self._idle_s:
            self._parser.expire()
        self.frames += 1

    @property
    def pending(self) -> int:
        """Bytes of something that has begun."""
        return self._parser.pending

    @abstractmethod
    def _heard(self, data: bytes) -> list[T]:
        """The readings that these bytes complete."""
