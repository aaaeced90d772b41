"""The half of a session that speaks."""

from __future__ import annotations


class Outgoing:
    """Collects in ``_output`` what is to be sent; each byte is given out once. Nothing is said at the end."""

    def __init__(self) -> None:
        self._output = bytearray()

    def output(self) -> bytes:
        if not self._output:
            return b""
        data = bytes(self._output)
        self._output.clear()
        return data

    def closing(self) -> bytes:
        return b""
