"""A tag reader that prints what it reads, for tests and demos; ``devices.emulation`` puts it behind a line."""

from __future__ import annotations

from typing import Literal


class TextReaderDevice:
    """With a line that has a ``tick_s`` the tags in its field are sent again and again."""

    def __init__(self, form: Literal["lines", "rdm6300"] = "lines", *, before: str = "", ending: str = "\r\n") -> None:
        self.tags: list[str] = []
        self._form, self._before, self._ending = form, before, ending

    def receive(self, data: bytes) -> bytes:
        return b""

    def tick(self) -> bytes:
        return b"".join(map(self.print, self.tags))

    def print(self, tag: str) -> bytes:
        """What the reader sends for one tag."""
        if self._form == "lines":
            return f"{self._before}{tag}{self._ending}".encode("ascii")
        check = 0
        for byte in bytes.fromhex(tag):
            check ^= byte
        return b"\x02" + f"{tag.upper()}{check:02X}".encode("ascii") + b"\x03"
