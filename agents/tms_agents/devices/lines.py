"""Text lines out of a byte stream, in bounded memory."""

from __future__ import annotations

from tms_agents.devices.framing import FrameBuffer


class LineParser(FrameBuffer):
    """Incremental: feed bytes as they come, get whole lines without their CR and LF; empty lines are left out.

    A line longer than ``longest`` bytes is dropped whole, to its end; ``skipped`` counts the bytes dropped. At most
    ``longest`` bytes are held.
    """

    def __init__(self, longest: int = 200) -> None:
        super().__init__()
        self._longest = longest
        self._overlong = False

    @property
    def between(self) -> bool:
        """Whether the next byte begins a line."""
        return not self._buffer and not self._overlong

    def feed(self, data: bytes) -> list[bytes]:
        data = bytes(self._buffer) + data
        self._buffer.clear()
        ended = data.splitlines()
        rest = ended.pop() if data and data[-1] not in b"\r\n" else b""
        if self._overlong and ended:  # the end of the line that was dropped
            self.skipped += len(ended.pop(0))
            self._overlong = False
        lines = []
        for line in ended:
            if len(line) > self._longest:
                self.skipped += len(line)
            elif line:
                lines.append(line)
        self._buffer += rest
        if self._overlong or len(rest) > self._longest:
            super().expire()
            self._overlong = True
        return lines

    def expire(self) -> None:
        super().expire()
        self._overlong = False
