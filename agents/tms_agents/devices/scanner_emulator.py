"""A barcode scanner in serial mode for tests and demos; ``devices.emulation`` puts it behind a line."""

from __future__ import annotations

from typing import Literal

Ending = Literal["\r", "\n", "\r\n"]
#: AIM identifiers by the length of the code.
_AIM = {8: "]E4", 12: "]E0", 13: "]E0"}


class ScannerDevice:
    """``scan`` gives the bytes that the scanner sends for a code, as its settings say; it obeys no command."""

    def __init__(self, *, ending: Ending = "\r", aim: bool = False) -> None:
        self.ending, self.aim = ending, aim

    def receive(self, data: bytes) -> bytes:
        return b""

    def scan(self, digits: str) -> bytes:
        """An EAN, JAN or UPC code; a UPC-A with AIM identifier is sent as EAN-13, as scanners do."""
        if self.aim and len(digits) == 12:
            digits = f"0{digits}"
        return f"{_AIM.get(len(digits), '') if self.aim else ''}{digits}{self.ending}".encode("ascii")
