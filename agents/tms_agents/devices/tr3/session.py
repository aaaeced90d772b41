"""The host side of TR3: poll every antenna in turn, or listen to a reader in RDLOOP mode."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable, Sequence
from typing import Literal, NamedTuple

from tms_agents.devices.tags import TagRead
from tms_agents.devices.tr3.codec import (
    ACK,
    NACK,
    RDLOOP,
    UID,
    Frame,
    FrameParser,
    command_mode,
    inventory,
    rf_power,
    select_antenna,
)
from tms_agents.devices.transport import DeviceFault

Mode = Literal["inventory", "rdloop"]


class _Command(NamedTuple):
    frame: Frame
    antenna: int | None = None
    #: A refusal of this one does no harm (a reader without antenna switch).
    optional: bool = False


class Tr3Session:
    """``inventory``: every ``poll_s`` seconds select each antenna and ask for the tags in its field.

    A TR3 does not report a UID again until the antenna is switched, so one antenna alone is polled by way of the next
    one. ``rdloop``: send nothing and take the frames of a reader that was set to report by itself.
    """

    def __init__(
        self,
        *,
        antennas: Sequence[int] = (0,),
        mode: Mode = "inventory",
        poll_s: float = 0.2,
        reply_s: float = 0.5,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self.frames = 0
        self.ready = False
        self._antennas, self._poll_s, self._reply_s = tuple(antennas), poll_s, reply_s
        self._polls = mode == "inventory"
        self._clock = clock
        self._parser = FrameParser()
        self._output = bytearray()
        self._waiting: deque[_Command] = deque()
        self._current: _Command | None = None
        self._tags_to_come = 0
        self._since = self._next_poll = clock()

    def opened(self) -> None:
        if self._polls:
            self._waiting += [_Command(command_mode(), optional=True), _Command(rf_power(True), optional=True)]
            self._send_next()

    def receive(self, data: bytes) -> list[TagRead]:
        return self._take(self._parser.feed(data))

    def tick(self) -> None:
        """Give up a reply that does not come; start the next round when it is due."""
        now = self._clock()
        if not self._polls:
            return
        if self._current is not None and now - self._since > self._reply_s:
            self._parser.expire()
            self._current = None
            self._waiting.clear()
        if self._current is None and now >= self._next_poll:
            self._next_poll = now + self._poll_s
            if len(self._antennas) == 1:
                self._waiting.append(_Command(select_antenna(self._antennas[0] + 1), optional=True))
            for antenna in self._antennas:
                alone = len(self._antennas) == 1
                self._waiting.append(_Command(select_antenna(antenna), optional=alone))
                self._waiting.append(_Command(inventory(), antenna))
            self._send_next()

    def output(self) -> bytes:
        data = bytes(self._output)
        self._output.clear()
        return data

    def closing(self) -> bytes:
        return rf_power(False).encode() if self._polls else b""

    def _take(self, frames: list[Frame]) -> list[TagRead]:
        reads: list[TagRead] = []
        for frame in frames:
            self.frames += 1
            self._since = self._clock()
            uid = frame.uid()
            if uid is not None:
                self.ready = True
                antenna = self._current.antenna if self._current and frame.command == UID else None
                reads.append(TagRead(tag=uid, antenna=antenna or 0))
                if frame.command == UID:
                    self._tags_to_come -= 1
            elif frame.command == ACK:
                self._acknowledged(frame)
            elif frame.command == NACK and self._current is not None and not self._current.optional:
                raise DeviceFault(f"the reader refuses command {self._current.frame.command:02X}: {frame.refusal()}")
            if frame.command != RDLOOP and self._tags_to_come <= 0:
                self._send_next()
        return reads

    def _acknowledged(self, frame: Frame) -> None:
        if self._current is not None and self._current.antenna is not None and frame.data[:1] == b"\xf0":
            self._tags_to_come = frame.data[1] if len(frame.data) > 1 else 0
            self.ready = True

    def _send_next(self) -> None:
        self._tags_to_come = 0
        self._current = self._waiting.popleft() if self._waiting else None
        if self._current is not None:
            self._since = self._clock()
            self._output += self._current.frame.encode()
