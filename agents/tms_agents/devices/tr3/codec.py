"""TR3 frames: ``02 address command length data... 03 sum 0D``, sum = low byte of all bytes from 02 to 03.

Frames are cut by their length, never at 0D, which data may contain. Source: Takaya TDR-MNL-PRC communication protocol.
"""

from __future__ import annotations

from dataclasses import dataclass

ACK, NACK, UID, RDLOOP = 0x30, 0x31, 0x49, 0x4C
MODE, READ, INVENTORY = 0x4E, 0x4F, 0x78
_STX, _ETX, _CR = 0x02, 0x03, 0x0D
_AROUND = 7  # bytes of a frame that are not data
MAX_FRAME = _AROUND + 255
SUM_ERROR, FORMAT_ERROR = 0x42, 0x44
_NACK_REASONS = {SUM_ERROR: "sum error", FORMAT_ERROR: "format error"}


@dataclass(frozen=True, slots=True)
class Frame:
    command: int
    data: bytes = b""
    address: int = 0

    def encode(self) -> bytes:
        body = bytes([_STX, self.address, self.command, len(self.data)]) + self.data + bytes([_ETX])
        return body + bytes([sum(body) & 0xFF, _CR])

    def uid(self) -> str | None:
        """UID as printed (upper-case hex, most significant byte first) of a UID or RDLOOP frame, else None."""
        if self.command == UID and len(self.data) >= 9:  # DSFID, then the UID, least significant byte first
            return self.data[8:0:-1].hex().upper()
        if self.command == RDLOOP and len(self.data) >= 8:  # the UID, then user memory
            return self.data[7::-1].hex().upper()
        return None

    def refusal(self) -> str | None:
        """Why the reader refuses a command, None where it does not."""
        if self.command != NACK:
            return None
        return _NACK_REASONS.get(self.refusal_code, f"refusal code {self.refusal_code:02X}")

    @property
    def refusal_code(self) -> int:
        return self.data[-1] if self.data else 0


class FrameParser:
    """Incremental: feed bytes as they come, get whole frames with a right sum.

    Everything else is skipped byte by byte and counted in ``skipped``; fewer than ``MAX_FRAME`` bytes are held.
    """

    def __init__(self) -> None:
        self._buffer = bytearray()
        self.skipped = 0

    def feed(self, data: bytes) -> list[Frame]:
        frames = []
        for start in range(0, len(data), MAX_FRAME):
            self._buffer += data[start : start + MAX_FRAME]
            frames += self._cut()
        return frames

    def expire(self) -> list[Frame]:
        """The line is idle: what looks like the beginning of a frame is none; returns the frames behind it."""
        frames: list[Frame] = []
        while self._buffer:
            del self._buffer[0]
            self.skipped += 1
            frames += self._cut()
        return frames

    @property
    def pending(self) -> int:
        """Bytes of an incomplete frame."""
        return len(self._buffer)

    def _cut(self) -> list[Frame]:
        frames: list[Frame] = []
        buffer, at = self._buffer, 0
        while True:
            start = buffer.find(_STX, at)
            self.skipped += (start if start >= 0 else len(buffer)) - at
            at = start if start >= 0 else len(buffer)
            if start < 0:
                break
            if len(buffer) - at < 4 or len(buffer) - at < _AROUND + buffer[at + 3]:
                break
            end = at + _AROUND + buffer[at + 3]
            raw = buffer[at:end]
            if raw[-3] == _ETX and raw[-1] == _CR and sum(raw[:-2]) & 0xFF == raw[-2]:
                frames.append(Frame(raw[2], bytes(raw[4:-3]), raw[1]))
                at = end
            else:
                at += 1
                self.skipped += 1
        del buffer[:at]
        return frames


def command_mode() -> Frame:
    """Leave any mode in which the reader sends by itself."""
    return Frame(MODE, bytes([0x00, 0x00, 0x00, 0x1C]))


def read_version() -> Frame:
    """Of the firmware; answered without a field."""
    return Frame(READ, b"\x90")


def rf_power(on: bool) -> Frame:
    return Frame(MODE, bytes([0x9E, on]))


def select_antenna(antenna: int) -> Frame:
    return Frame(MODE, bytes([0x9C, antenna]))


#: The two ways to ask for Inventory2 with anti-collision: a model takes one or both (00: TR3, 40: TR3XM).
INVENTORY_OPTIONS = (0x00, 0x40)


def inventory(option: int = INVENTORY_OPTIONS[0]) -> Frame:
    """Inventory2: answered by ``ACK F0 n`` and n UID frames."""
    return Frame(INVENTORY, bytes([0xF0, option, 0x01]))


def acknowledges(reply: Frame, command: Frame) -> bool:
    """Whether ``reply`` is the ACK of ``command`` and not a late one of an earlier command.

    The reader repeats the sub-command (and the antenna) in its ACK; some models leave the data out.
    """
    if reply.command != ACK:
        return False
    if command.command == INVENTORY:
        return reply.data[:1] == b"\xf0" and len(reply.data) >= 2
    if command.data[:1] == b"\x9c":
        return reply.data[:2] == command.data[:2]
    return reply.data[:1] in (b"", command.data[:1])
