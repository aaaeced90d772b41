"""Text lines out of a byte stream, in bounded memory."""

from __future__ import annotations

import re

_LINE_END = re.compile(rb"[\r\n]+")


class LineParser:
    """Incremental: feed bytes as they come, get whole lines without their CR and LF; empty lines are left out.

    A line longer than ``longest`` bytes is dropped whole, to its end; ``skipped`` counts the bytes dropped. At most
    ``longest`` bytes are held.
    """

    def __init__(self, longest: int = 200) -> None:
        self._longest = longest
        self._buffer = b""
        self._overlong = False
        self.skipped = 0

    def feed(self, data: bytes) -> list[bytes]:
        *ended, rest = _LINE_END.split(data)
        lines = []
        for part in ended:
            line = self._buffer + part
            if self._overlong or len(line) > self._longest:
                self.skipped += len(line)
            elif line:
                lines.append(line)
            self._buffer, self._overlong = b"", False
        self._buffer += rest
        if self._overlong or len(self._buffer) > self._longest:
            self._overlong = True
            self.skipped += len(self._buffer)
            self._buffer = b""
        return lines

    def expire(self) -> None:
        """Forget the line that has begun: its end will not come, or not in time."""
        self.skipped += len(self._buffer)
        self._buffer, self._overlong = b"", False

    @property
    def pending(self) -> int:
        """Bytes of an incomplete line."""
        return len(self._buffer)
