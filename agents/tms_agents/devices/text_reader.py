"""Tag readers that send what they read by themselves: hex digits in text lines, or RDM6300 frames."""

from __future__ import annotations

import re
import time
from collections.abc import Callable
from typing import Literal

from tms_agents.devices.framing import FrameBuffer
from tms_agents.devices.lines import LineParser
from tms_agents.devices.listening import ListeningSession
from tms_agents.devices.tags import TagRead

#: 8 and 14 digits: ISO 14443 UIDs of 4 and 7 bytes; 16: ISO 15693; 24: EPC of 96 bits.
_LENGTHS = (8, 14, 16, 24)
_LONGEST_LINE = 200
#: Blanks, colons, dashes between bytes, and words before the digits such as ``UID:`` are left out.
_HEX = re.compile(r"(?:^|[^0-9A-Za-z])(?:0x)?([0-9A-Fa-f]{2}(?:[ :-]?[0-9A-Fa-f]{2})*)[^0-9A-Za-z]*$")
_STX, _ETX = 0x02, 0x03
_RDM_LENGTH = 14

ByteOrder = Literal["as printed", "reversed"]


def tag_of_line(line: str, order: ByteOrder = "as printed") -> str | None:
    """The tag (upper-case hex) at the end of a line, None where it holds none of a known length."""
    found = _HEX.search(line)
    digits = re.sub("[ :-]", "", found[1]) if found else ""
    if len(digits) not in _LENGTHS:
        return None
    raw = bytes.fromhex(digits)
    return (raw[::-1] if order == "reversed" else raw).hex().upper()


class Rdm6300Parser(FrameBuffer):
    """RDM6300 (125 kHz): ``02``, ten hex digits of the tag, two of their XOR, ``03``; all else is skipped."""

    def feed(self, data: bytes) -> list[str]:
        """Tags as ten upper-case hex digits."""
        tags = []
        for byte in data:
            if byte == _STX:  # never a digit: a new frame, whatever was before it
                self.skipped += len(self._buffer)
                self._buffer.clear()
            elif not self._buffer:
                self.skipped += 1
                continue
            self._buffer.append(byte)
            if len(self._buffer) == _RDM_LENGTH:
                tag = _rdm_tag(bytes(self._buffer))
                self.skipped += 0 if tag else _RDM_LENGTH
                tags += [tag] if tag else []
                self._buffer.clear()
        return tags


def _rdm_tag(frame: bytes) -> str | None:
    if frame[-1] != _ETX or not re.fullmatch(rb"[0-9A-Fa-f]{12}", frame[1:-1]):
        return None
    *raw, check = bytes.fromhex(frame[1:-1].decode("ascii"))
    for byte in raw:
        check ^= byte
    return None if check else bytes(raw).hex().upper()


class TextReaderSession(ListeningSession[TagRead]):
    """Such a reader says nothing while there is no tag, and has no rounds.

    ``order``: some readers print the UID with its bytes reversed. ``garbled`` counts lines without a tag.
    """

    def __init__(
        self,
        *,
        form: Literal["lines", "rdm6300"] = "lines",
        order: ByteOrder = "as printed",
        antenna: int = 0,
        idle_s: float = 1.0,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._lines = LineParser(_LONGEST_LINE)
        self._rdm = Rdm6300Parser() if form == "rdm6300" else None
        super().__init__(self._rdm or self._lines, idle_s=idle_s, clock=clock)
        self.garbled = 0
        self._order, self._antenna = order, antenna

    def _heard(self, data: bytes) -> list[TagRead]:
        tags = self._rdm.feed(data) if self._rdm else self._tags(data)
        self.frames += len(tags)
        return [TagRead(tag=tag, antenna=self._antenna) for tag in tags]

    def _tags(self, data: bytes) -> list[str]:
        found = [tag_of_line(line.decode("ascii", "replace"), self._order) for line in self._lines.feed(data)]
        self.garbled += found.count(None)
        return [tag for tag in found if tag is not None]
