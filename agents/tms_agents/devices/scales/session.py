"""The host side of an ASCII scale: ask again and again, or have it send by itself."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable
from typing import Literal

from tms_agents.devices.lines import LineParser
from tms_agents.devices.loads import LoadSample
from tms_agents.devices.outgoing import Outgoing
from tms_agents.devices.scales.dialects import DIALECTS, Answer, Dialect, DialectName, Mode, Reading, parse_line
from tms_agents.devices.scales.parity import add_even_parity, strip_even_parity
from tms_agents.devices.transport import DeviceFault

#: So many refusals without a reading in between are a fault; one may be a bit that fell over.
_REFUSALS = 3
_MAX_COMMANDS = 8


class ScaleLineSession(Outgoing):
    """Delivers a ``LoadSample`` of one cell, in grams, for every weight line.

    ``poll`` asks ``poll_s`` after the last question, at the earliest when it was answered or after ``reply_s``.
    ``stream`` has the scale send by itself and says so again when it sends nothing for ``reply_s`` (it was switched off
    and on); OpenScale needs no command for that. ``zero_first`` zeroes the scale when the connection is made;
    ``command`` does so later. ``software_parity``: the line is 7E1, but the port or converter only does 8N1.

    The lines have no check sum. What two weight lines of one scale have in common is unit, number of decimals and of
    columns, with zero-padded numbers that of digits; a line that differs in that from the one before it is left out
    and counted in ``doubtful``: half a line, a lost character, the first line, or a change of units.

    Raises:
        ValueError: ``zero_first`` or ``command`` where the dialect has no such command.
    """

    def __init__(
        self,
        dialect: DialectName | Dialect,
        *,
        mode: Mode = "poll",
        poll_s: float = 0.1,
        reply_s: float = 1.0,
        zero_first: bool = False,
        software_parity: bool = False,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        super().__init__()
        self.frames = 0
        self.ready = False
        self.tick_s = min(0.05, poll_s / 2)
        self.doubtful = 0
        self._dialect = dialect if isinstance(dialect, Dialect) else DIALECTS[dialect]
        self._mode, self._poll_s, self._reply_s = mode, poll_s, reply_s
        self._parity, self._clock = software_parity, clock
        self._lines = LineParser()
        self._commands: deque[bytes] = deque()
        self._sent: bytes | None = None
        self._sent_at = self._asked_at = self._heard_at = float("-inf")
        self._shape: tuple[object, ...] | None = None
        self._refusals = 0
        if zero_first:
            self.command("zero")

    def command(self, name: Literal["zero", "tare"]) -> None:
        """Have the scale zeroed or tared next; if it refuses, that is a fault."""
        command = self._dialect.zero if name == "zero" else self._dialect.tare
        if not command:
            raise ValueError(f"this scale has no {name} command")
        if len(self._commands) < _MAX_COMMANDS:
            self._commands.append(command)

    def opened(self) -> None:
        self._next(self._clock())

    def receive(self, data: bytes) -> list[LoadSample]:
        if self._parity:
            data = strip_even_parity(data)
        samples = []
        for line in self._lines.feed(data):
            said = parse_line(self._dialect, line)
            if isinstance(said, Reading):
                samples += self._reading(said)
            elif isinstance(said, Answer):
                self._answer(said)
        return samples

    def tick(self) -> None:
        now = self._clock()
        if self._sent is not None and now - self._sent_at > self._reply_s:
            self._lines.expire()
            if self._sent not in self._asking and not self._dialect.silent_commands:
                raise DeviceFault(f"the scale does not answer {self._sent.decode().strip()}")
            self._sent = None
        if self._sent is None:
            self._next(now)

    def output(self) -> bytes:
        data = super().output()
        return add_even_parity(data) if self._parity else data

    def closing(self) -> bytes:
        if self._mode == "poll":
            return b""
        return add_even_parity(self._dialect.stop) if self._parity else self._dialect.stop

    @property
    def pending(self) -> int:
        """Bytes of an incomplete line."""
        return self._lines.pending

    @property
    def _asking(self) -> tuple[bytes, bytes]:
        return self._dialect.ask, self._dialect.stream

    def _next(self, now: float) -> None:
        if self._commands:
            self._send(self._commands.popleft(), now)
        elif self._mode == "poll" and now - self._asked_at >= self._poll_s:
            self._asked_at = now
            self._send(self._dialect.ask, now)
        elif self._mode == "stream" and self._dialect.stream and now - self._heard_at > self._reply_s:
            self._send(self._dialect.stream, now)

    def _send(self, command: bytes, now: float) -> None:
        self._output += command
        self._sent, self._sent_at = command, now

    def _reading(self, reading: Reading) -> list[LoadSample]:
        self.frames += 1
        self.ready = True
        self._refusals = 0
        self._heard_at = self._clock()
        if self._sent in self._asking:
            self._sent = None
        if reading.shape and reading.shape != self._shape:
            self._shape = reading.shape
            self.doubtful += 1
            return []
        return [reading.sample]

    def _answer(self, answer: Answer) -> None:
        self.frames += 1
        command, self._sent = self._sent, None
        if not answer.refusal:
            return
        self._refusals += 1
        asked = command in self._asking or command is None
        if not asked or self._refusals >= _REFUSALS:
            name = (command or b"a command").decode("ascii").strip()
            raise DeviceFault(f"the scale refuses {name}: {answer.refusal}")
