"""ThingMagic frames: ``FF length command data crc`` of the host, ``FF length command status data crc`` of the reader.

Length counts the data alone, status and CRC are two bytes, big end first. Source: Mercury API, serial reader.
"""

from __future__ import annotations

from dataclasses import dataclass

from tms_agents.devices.framing import FrameBuffer

_START = 0xFF
_LONGEST_DATA = 250


@dataclass(frozen=True, slots=True)
class Command:
    code: int
    data: bytes = b""

    def encode(self) -> bytes:
        return _frame(bytes([len(self.data), self.code]) + self.data)


@dataclass(frozen=True, slots=True)
class Reply:
    code: int
    data: bytes = b""
    status: int = 0

    def encode(self) -> bytes:
        return _frame(bytes([len(self.data), self.code]) + self.status.to_bytes(2, "big") + self.data)


def crc(data: bytes) -> int:
    """CRC of everything between the start byte and the CRC itself.

    Polynomial 1021 and start FFFF like CCITT, but the message bits enter at the bottom of the register.
    """
    value = 0xFFFF
    for byte in data:
        value = (value << 4 ^ byte >> 4) & 0xFFFF ^ _CARRY[value >> 12]
        value = (value << 4 ^ byte & 0xF) & 0xFFFF ^ _CARRY[value >> 12]
    return value


def _carry(top: int) -> int:
    """What four bits leaving the register at its top add to it."""
    value = top << 12
    for _ in range(4):
        value = value << 1 & 0xFFFF ^ (0x1021 if value & 0x8000 else 0)
    return value


_CARRY = tuple(map(_carry, range(16)))


def _frame(body: bytes) -> bytes:
    return bytes([_START]) + body + crc(body).to_bytes(2, "big")


class _Parser(FrameBuffer):
    """Incremental: cuts bytes into frames with a right CRC and skips everything else, counted in ``skipped``."""

    #: Bytes of a frame that are not data, and of those between the length and the data.
    _around: int

    def _bodies(self, data: bytes) -> list[bytes]:
        """Frames without start byte and CRC; less than the longest frame is held."""
        bodies = []
        piece = _LONGEST_DATA + self._around
        for start in range(0, len(data), piece):
            self._buffer += data[start : start + piece]
            bodies += self._cut()
        return bodies

    def _cut(self) -> list[bytes]:
        bodies, buffer, at = [], self._buffer, 0
        while (start := buffer.find(_START, at)) >= 0:
            self.skipped += start - at
            at = start
            if len(buffer) - at < 2:
                break
            end = at + buffer[at + 1] + self._around
            if buffer[at + 1] <= _LONGEST_DATA:
                if len(buffer) < end:
                    break
                body = bytes(buffer[at + 1 : end - 2])
                if crc(body) == int.from_bytes(buffer[end - 2 : end], "big"):
                    bodies.append(body)
                    at = end
                    continue
            at += 1
            self.skipped += 1
        else:
            self.skipped += len(buffer) - at
            at = len(buffer)
        del buffer[:at]
        return bodies


class ReplyParser(_Parser):
    """The host's ear."""

    _around = 7

    def feed(self, data: bytes) -> list[Reply]:
        return [Reply(body[1], body[4:], int.from_bytes(body[2:4], "big")) for body in self._bodies(data)]


class CommandParser(_Parser):
    """The reader's ear."""

    _around = 5

    def feed(self, data: bytes) -> list[Command]:
        return [Command(body[1], body[2:]) for body in self._bodies(data)]
