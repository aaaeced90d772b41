"""What the parsers of byte streams have in common."""

from __future__ import annotations


class FrameBuffer:
    """Bytes of a frame that has begun. Subclasses feed it, keep it short and count in ``skipped`` what they drop."""

    def __init__(self) -> None:
        self._buffer = bytearray()
        self.skipped = 0

    def expire(self) -> None:
        """The line is idle: what has begun will not end, or not in time."""
        self.skipped += len(self._buffer)
        self._buffer.clear()

    @property
    def pending(self) -> int:
        """Bytes of an incomplete frame."""
        return len(self._buffer)
