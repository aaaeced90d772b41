"""Barcode scanners in serial mode: one line per code, CR, LF or both at its end, an AIM identifier before it if set so.

EAN-13, EAN-8, UPC-A and the GTIN of GS1 symbols come out as digits with a right check digit; everything else as a
``Misread``, so that whoever scans can be told at once.
"""

from __future__ import annotations

import re
import time
from collections.abc import Callable
from dataclasses import dataclass

from tms_agents.devices.lines import LineParser
from tms_agents.devices.listening import ListeningSession

#: Lengths of EAN-8, UPC-A, EAN-13 and GTIN-14.
_LENGTHS = (8, 12, 13, 14)
_LONGEST_LINE = 200
_WRITTEN = re.compile(r"(?:\([0-9]{2,4}\)[^(]*)*?\(01\)([0-9]{14})|https?://\S+?/01/([0-9]{8,14})(?:[/?#]|$)")
_GROUP_SEPARATOR = "\x1d"
#: AIM symbology identifier: ], a letter, a digit or letter. ISO/IEC 15424.
_AIM = re.compile(r"\](?P<symbology>[A-Za-z])(?P<modifier>[0-9A-Za-z])")
#: AIM identifiers of symbols whose text is a GS1 element string: GS1-128, DataBar, DataMatrix, QR, DotCode.
_GS1 = {"]C1", "]e0", "]d2", "]Q3", "]J1"}
#: Lengths of the elements, identifier included, that need no separator behind them. GS1 General Specifications, 7.8.
_FIXED_LENGTHS = {
    **dict.fromkeys(("00",), 20),
    **dict.fromkeys(("01", "02", "03"), 16),
    "04": 18,
    **dict.fromkeys(("11", "12", "13", "14", "15", "16", "17", "18", "19"), 8),
    "20": 4,
    **dict.fromkeys(("31", "32", "33", "34", "35", "36"), 10),
    "41": 16,
}


@dataclass(frozen=True, slots=True)
class Scan:
    """A code as its digits: 8 (EAN-8), 12 (UPC-A), 13 (EAN-13, JAN) or 14 (a GTIN with a packaging level)."""

    code: str


@dataclass(frozen=True, slots=True)
class Misread:
    """A line that is no product code, and why."""

    text: str
    why: str


def check_digit(digits: str) -> str:
    """The last digit of the GTIN that begins with ``digits``."""
    weighted = sum(int(digit) * (3 if place % 2 == 0 else 1) for place, digit in enumerate(reversed(digits)))
    return str(-weighted % 10)


def decode(line: str) -> Scan | Misread:
    """The product code of a scanned line, with or without AIM identifier."""
    aim = _AIM.match(line.strip())
    text = line.strip()[aim.end() if aim else 0 :].lstrip(_GROUP_SEPARATOR)
    if aim and aim.group() == "]E3":  # EAN-13 and its add-on of two or five digits
        text = text[:13]
    code = text
    # without an identifier: no product code is longer than 14 digits; a Digital Link may be in any 2D code
    if text.startswith("http") or (aim.group() in _GS1 if aim else len(text) > max(_LENGTHS)):
        code = _gtin(text) or ""
    if len(code) not in _LENGTHS or not (code.isascii() and code.isdigit()):
        return Misread(line, "no product code (EAN, JAN, UPC: 8, 12, 13 or 14 digits)")
    if check_digit(code[:-1]) != code[-1]:
        return Misread(line, f"misread: the check digit of {code} is wrong")
    # a GTIN-14 of packaging level 0 is the EAN-13 with a zero before it
    return Scan(code[1:] if len(code) == 14 and code[0] == "0" else code)


def product_code(line: str) -> str | None:
    """The digits of the product code of a scanned line, None where there is none or it was misread."""
    found = decode(line)
    return found.code if isinstance(found, Scan) else None


def _gtin(elements: str) -> str | None:
    """The value of application identifier 01: in an element string, in one as printed, in a GS1 Digital Link."""
    if found := _WRITTEN.match(elements):
        return found[1] or found[2]
    at = 0
    while at < len(elements):
        if elements.startswith("01", at):
            return elements[at + 2 : at + 16]
        length = _FIXED_LENGTHS.get(elements[at : at + 2])
        if length is None:
            end = elements.find(_GROUP_SEPARATOR, at)
            if end < 0:
                return None
            at = end + 1
        else:
            at += length
            at += elements.startswith(_GROUP_SEPARATOR, at)
    return None


class ScannerSession(ListeningSession[Scan | Misread]):
    """A scanner says nothing while nobody scans."""

    def __init__(self, *, idle_s: float = 1.0, clock: Callable[[], float] = time.monotonic) -> None:
        self._lines = LineParser(_LONGEST_LINE)
        super().__init__(self._lines, idle_s=idle_s, clock=clock)

    def _heard(self, data: bytes) -> list[Scan | Misread]:
        lines = self._lines.feed(data)
        self.frames += len(lines)
        return [decode(line.decode("ascii", "replace")) for line in lines]
