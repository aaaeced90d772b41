"""Text lines out of a byte stream, in bounded memory."""

from __future__ import annotations

import re

from tms_agents.devices.framing import FrameBuffer

_LINE_END = re.compile(rb"[\r\n]+")


class LineParser(FrameBuffer):
    """Incremental: feed bytes as they come, get whole lines without their CR and LF; empty lines are left out.

    A line longer than ``longest`` bytes is dropped whole, to its end; ``skipped`` counts the bytes dropped. At most
    ``longest`` bytes are held.
    """

    def __init__(self, longest: int = 200) -> None:
        super().__init__()
        self._longest = longest
        self._overlong = False

    def feed(self, data: bytes) -> list[bytes]:
        *ended, rest = _LINE_END.split(data)
        lines = []
        for part in ended:
            line = bytes(self._buffer + part)
            if self._overlong or len(line) > self._longest:
                self.skipped += len(line)
            elif line:
                lines.append(line)
            self._buffer.clear()
            self._overlong = False
        self._buffer += rest
        if self._overlong or len(self._buffer) > self._longest:
            super().expire()
            self._overlong = True
        return lines

    def expire(self) -> None:
        super().expire()
        self._overlong = False
