"""LMS2xx telegrams: ``02 address length body crc``, between them single bytes ``06`` (heard) and ``15`` (not heard).

Length and CRC are sent low byte first; the length counts the body: a command and its data, in replies also the status
byte. The host is heard by the address of the device (0 by default) and answered by 80 hex more.
Source: SICK 8007954, telegram listing LMS2xx.
"""

from __future__ import annotations

from dataclasses import dataclass

from tms_agents.devices.framing import FrameBuffer

_STX, _ACK, _NAK = 0x02, 0x06, 0x15
ACK, NAK = bytes([_ACK]), bytes([_NAK])
#: The longest body: 401 values with their indices need 808 bytes, the longest telegram of the manual has 812.
MAX_BODY = 814
_AROUND = 6
MAX_FRAME = MAX_BODY + _AROUND
_REPLIES = 0x80


def crc(data: bytes | bytearray) -> int:
    """The check sum of a telegram from its 02 to the end of its body; not one of the usual CRC-16."""
    value = before = 0
    for byte in data:
        value = ((value & 0x7FFF) << 1) ^ (0x8005 if value & 0x8000 else 0) ^ (before << 8 | byte)
        before = byte
    return value


@dataclass(frozen=True, slots=True)
class Frame:
    """``body``: the command, its data, in replies the status byte as well."""

    body: bytes
    address: int = 0

    def encode(self) -> bytes:
        head = bytes([_STX, self.address]) + len(self.body).to_bytes(2, "little") + self.body
        return head + crc(head).to_bytes(2, "little")

    @property
    def code(self) -> int:
        return self.body[0]

    @property
    def data(self) -> bytes:
        """What a reply says, without its status byte."""
        return self.body[1:-1]

    @property
    def status(self) -> int:
        """The status byte of a reply."""
        return self.body[-1]


@dataclass(frozen=True, slots=True)
class Mark:
    """A byte between telegrams: what was sent last was heard, or arrived damaged."""

    heard: bool


class FrameParser(FrameBuffer):
    """Incremental: feed bytes as they come, get whole telegrams with a right check sum, and marks.

    ``replies``: telegrams of a device; otherwise those of a host. What is neither is skipped byte by byte and counted
    in ``skipped``; fewer than ``MAX_FRAME`` bytes are held. Marks are heard behind a telegram or after ``resume`` only:
    behind other bytes they would be parts of a telegram of which the beginning was missed.
    """

    def __init__(self, *, replies: bool = True) -> None:
        super().__init__()
        self._replies, self._in_step = replies, False

    def feed(self, data: bytes) -> list[Frame | Mark]:
        items: list[Frame | Mark] = []
        for start in range(0, len(data), MAX_FRAME):
            self._buffer += data[start : start + MAX_FRAME]
            items += self._cut()
        return items

    def resume(self) -> list[Frame | Mark]:
        """The line is idle: what looks like the beginning of a telegram is none; returns those behind it."""
        items: list[Frame | Mark] = []
        while self._buffer:
            del self._buffer[0]
            self.skipped += 1
            items += self._cut()
        self._in_step = True
        return items

    def _cut(self) -> list[Frame | Mark]:
        buffer, at, size = self._buffer, 0, len(self._buffer)
        items: list[Frame | Mark] = []
        while at < size:
            byte = buffer[at]
            if byte in (_ACK, _NAK) and self._replies and self._in_step:
                items.append(Mark(byte == _ACK))
                at += 1
                continue
            end = self._end(at) if byte == _STX else at
            if end > size:  # not all of it has come
                break
            if end > at and crc(buffer[at : end - 2]) == int.from_bytes(buffer[end - 2 : end], "little"):
                items.append(Frame(bytes(buffer[at + 4 : end - 2]), buffer[at + 1]))
                at, self._in_step = end, True
                continue
            self.skipped += 1
            at, self._in_step = at + 1, False
        del buffer[:at]
        return items

    def _end(self, at: int) -> int:
        """Where the telegram at ``at`` ends, at the least; ``at`` itself if there cannot be one."""
        buffer, seen = self._buffer, len(self._buffer) - at
        if seen > 1 and bool(buffer[at + 1] & _REPLIES) != self._replies:
            return at
        if seen < 4:
            return at + _AROUND
        length = buffer[at + 2] | buffer[at + 3] << 8
        # A reply has a code and a status byte.
        return at + length + _AROUND if 1 + self._replies <= length <= MAX_BODY else at
