"""CoLa telegrams: text between 02 and 03 (A), or four times 02, length, payload and the XOR of the payload (B).

Lengths and numbers of CoLa B are sent high byte first; the length counts the payload only. A payload is the same in
both as far as it is text: a verb of three letters, a blank, a name, then values.
Source: SICK 8014631, telegram listing.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from tms_agents.devices.framing import FrameBuffer

Dialect = Literal["A", "B"]
#: Longest payload: five echoes with intensities of 2,880 beams as text need some 150,000 characters; two echoes fit.
MAX_PAYLOAD = 1 << 16
MAX_FRAME = MAX_PAYLOAD + 9
_STX, _ETX = 0x02, 0x03
_START = b"\x02\x02\x02\x02"
_FIRST = ord("s")  # of every verb
#: Characters of text; what else is inside a telegram of CoLa A shows that it is none.
_NOT_TEXT = bytes(byte for byte in range(256) if not 0x20 <= byte < 0x7F)


@dataclass(frozen=True, slots=True)
class Telegram:
    payload: bytes
    dialect: Dialect

    def encode(self) -> bytes:
        if self.dialect == "A":
            return bytes([_STX]) + self.payload + bytes([_ETX])
        return _START + len(self.payload).to_bytes(4, "big") + self.payload + bytes([xor(self.payload)])


def xor(payload: bytes | bytearray | memoryview) -> int:
    return int(np.bitwise_xor.reduce(np.frombuffer(payload, np.uint8)))


class FrameParser(FrameBuffer):
    """Incremental: feed bytes as they come, get whole telegrams of either dialect, those of CoLa B with a right sum.

    Everything else is skipped and counted in ``skipped``; at most ``MAX_FRAME`` bytes are held.
    """

    def feed(self, data: bytes) -> list[Telegram]:
        telegrams: list[Telegram] = []
        for start in range(0, len(data), MAX_FRAME):
            self._buffer += data[start : start + MAX_FRAME]
            telegrams += self._cut()
        return telegrams

    def resume(self) -> list[Telegram]:
        """The line is idle: what looks like the beginning of a telegram is none; returns those behind it."""
        telegrams: list[Telegram] = []
        while self._buffer:
            del self._buffer[0]
            self.skipped += 1
            telegrams += self._cut()
        return telegrams

    def _cut(self) -> list[Telegram]:
        buffer, at = self._buffer, 0
        telegrams: list[Telegram] = []
        while True:
            start = buffer.find(_STX, at)
            start = len(buffer) if start < 0 else start
            self.skipped += start - at
            at = start
            if at == len(buffer):
                break
            binary = len(buffer) > at + 1 and buffer.startswith(_START[: len(buffer) - at], at)
            end = self._end_of_binary(at) if binary else self._end_of_text(at)
            if end is None:  # not all of it has come
                break
            if end > at:
                telegrams.append(self._telegram(at, end, binary))
                at = end
            else:
                self.skipped += 1
                at += 1
        del buffer[:at]
        return telegrams

    def _telegram(self, at: int, end: int, binary: bool) -> Telegram:
        payload = self._buffer[at + 8 : end - 1] if binary else self._buffer[at + 1 : end - 1]
        return Telegram(bytes(payload), "B" if binary else "A")

    def _end_of_binary(self, at: int) -> int | None:
        """Where the telegram at ``at`` ends; None if it goes on, ``at`` if there is none."""
        buffer = self._buffer
        size = int.from_bytes(buffer[at + 4 : at + 8], "big")
        if len(buffer) < at + 9:
            return None
        if not 1 <= size <= MAX_PAYLOAD or buffer[at + 8] != _FIRST:
            return at
        end = at + size + 9
        if len(buffer) < end:
            return None
        with memoryview(buffer) as view:
            return end if xor(view[at + 8 : end - 1]) == buffer[end - 1] else at

    def _end_of_text(self, at: int) -> int | None:
        buffer = self._buffer
        if len(buffer) < at + 2:
            return None
        if buffer[at + 1] != _FIRST:
            return at
        end = buffer.find(_ETX, at, at + MAX_PAYLOAD + 2)
        text = buffer[at + 1 : end if end >= 0 else at + MAX_PAYLOAD + 2]
        if len(text.translate(None, _NOT_TEXT)) < len(text):
            return at
        if end >= 0:
            return end + 1
        return at if len(text) > MAX_PAYLOAD else None
