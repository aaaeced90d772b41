"""Sessions that ask an antenna reader one command after the other: what all makes have in common."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Callable, Sequence
from typing import Generic, Protocol, TypeVar

from tms_agents.devices.outgoing import Outgoing
from tms_agents.devices.tags import Field, TagItem

Command = TypeVar("Command")
Reply = TypeVar("Reply")
Reply_co = TypeVar("Reply_co", covariant=True)


class Parser(Protocol[Reply_co]):
    @property
    def pending(self) -> int:
        """Bytes of an incomplete reply."""

    def feed(self, data: bytes) -> Sequence[Reply_co]: ...

    def expire(self) -> object:
        """The line is idle: what has begun will not end."""


class PollingReader(Outgoing, ABC, Generic[Command, Reply]):
    """One command is under way at a time, the others wait; every ``poll_s`` seconds a cycle is due.

    A reply that does not come within ``reply_s`` makes the session start over. ``pause`` and ``resume`` switch the
    RF field off and on.
    """

    def __init__(
        self,
        parser: Parser[Reply],
        *,
        poll_s: float,
        reply_s: float,
        field: Field | None,
        clock: Callable[[], float],
    ) -> None:
        super().__init__()
        self.frames = 0
        self.ready = False
        self.tick_s = min(0.1, poll_s / 2)
        self.field = field or Field()
        self.field.is_off = False
        self._parser, self._poll_s, self._reply_s, self._clock = parser, poll_s, reply_s, clock
        self._waiting: deque[Command] = deque()
        self._current: Command | None = None
        self._since = self._next_poll = clock()

    def pause(self) -> None:
        """Radiate no more after the command under way; ``field.is_off`` tells when that is reached."""
        self.field.pause()

    def resume(self) -> None:
        self.field.resume()

    def opened(self) -> None:
        self.tick()

    def receive(self, data: bytes) -> list[TagItem]:
        items: list[TagItem] = []
        for reply in self._parser.feed(data):
            self.frames += 1
            self._since = self._clock()
            items += self._take(reply)
        self._advance()
        return items

    def tick(self) -> None:
        """Give up a reply that does not come; start the next cycle when it is due."""
        if self._clock() - self._since > self._patience_s() and (self._current or self._parser.pending):
            self._parser.expire()
            if self._current is not None:
                self._start_over()
        self._advance()

    @property
    def pending(self) -> int:
        """Bytes of an incomplete reply."""
        return self._parser.pending

    def _advance(self) -> None:
        """Send the next command, if none is under way."""
        if self._current is not None:
            return
        self._plan()
        if self._waiting:
            self._current = self._waiting.popleft()
            self._since = self._clock()
            self._output += self._encode(self._current)

    def _is_due(self) -> bool:
        """Whether it is time for the next cycle; says so once."""
        if self._waiting or self._clock() < self._next_poll:
            return False
        self._next_poll = self._clock() + self._poll_s
        return True

    def _patience_s(self) -> float:
        """How long the reply to the command under way may take."""
        return self._reply_s

    @abstractmethod
    def _take(self, reply: Reply) -> Sequence[TagItem]:
        """What a reply says; it is for this to declare the command under way as done."""

    @abstractmethod
    def _plan(self) -> None:
        """Let the commands wait that are due; none is under way."""

    @abstractmethod
    def _start_over(self) -> None:
        """A reply is missing: whatever is known of the reader may be wrong."""

    @abstractmethod
    def _encode(self, command: Command) -> bytes:
        """The bytes of a command."""
