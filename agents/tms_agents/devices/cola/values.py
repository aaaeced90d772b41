"""Values inside telegrams: numbers and texts in a row, as text (CoLa A) or binary (CoLa B), read and written alike.

CoLa A writes whole numbers as hex digits without leading zeros, negative ones as two's complement of their width, and
real numbers as the hex digits of their IEEE 754 bits; CoLa B sends the bytes, high byte first.
"""

from __future__ import annotations

import struct
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from tms_agents.devices.cola.framing import Dialect, Telegram

#: u8, i16, u16, i32, u32, f32: characters of ``struct``.
Kind = Literal["B", "h", "H", "i", "I", "f"]
_SIZES = {"B": 1, "h": 2, "H": 2, "i": 4, "I": 4, "f": 4}
_BLANK = 0x20
_REPLIES = (b"sRA", b"sWA", b"sAN", b"sEA")


class Writer:
    """Builds the payload of one telegram: ``Writer("A", "sMN", "Run").put("B", 1).telegram()``."""

    def __init__(self, dialect: Dialect, verb: str, name: str = "") -> None:
        self._dialect = dialect
        self._parts = [f"{verb} {name}".strip().encode("ascii")]

    def put(self, kind: Kind, *values: float) -> Writer:
        for value in values:
            raw = struct.pack(f">{kind}", value if kind == "f" else int(value))
            self._parts.append(raw if self._dialect == "B" else b"%X" % int.from_bytes(raw, "big"))
        return self

    def text(self, text: str) -> Writer:
        """A text with its length before it."""
        raw = text.encode("ascii")
        self.put("H", len(raw))
        self._parts.append(raw)
        return self

    def raw(self, text: str) -> Writer:
        """A text without its length, such as the name of a channel."""
        self._parts.append(text.encode("ascii"))
        return self

    def array(self, kind: Literal["B", "H"], values: NDArray[np.integer]) -> Writer:
        if self._dialect == "B":
            self._parts.append(values.astype(f">u{_SIZES[kind]}").tobytes())
        else:
            self._parts += [b"%X" % value for value in values.tolist()]
        return self

    def telegram(self) -> Telegram:
        if self._dialect == "A":
            return Telegram(b" ".join(self._parts), "A")
        head, *values = self._parts
        # replies have the blank behind the name even where nothing follows, commands have not
        blank = b" " if values or head[:3] in _REPLIES else b""
        return Telegram(head + blank + b"".join(values), "B")


class Reader:
    """Reads the values of one telegram in their order. Every method raises ``ValueError`` where there is none."""

    def __init__(self, telegram: Telegram) -> None:
        self._dialect = telegram.dialect
        self._data, self._at = telegram.payload, 3
        self.verb = telegram.payload[:3].decode("ascii", "replace")
        #: Empty for ``sFA``, which has an error number only, in CoLa B with or without a blank before it.
        self.name = ""
        if self.verb != "sFA" or len(self._data) == 6 or self._dialect == "A":
            self._at = 4
        if self.verb != "sFA":
            self.name = self._word()

    @property
    def rest(self) -> bytes:
        """What was not read yet."""
        return self._data[self._at :]

    def number(self, kind: Kind) -> float:
        size = _SIZES[kind]
        if self._dialect == "B":
            raw = self._data[self._at : self._at + size]
            self._at += size
        else:
            word = self._word()
            # a leading sign marks a decimal number
            value = int(word, 10) if word[:1] in ("+", "-") else int(word, 16)
            if not -(1 << 8 * size - 1) <= value < 1 << 8 * size:
                raise ValueError(f"{word} does not fit into {size} bytes")
            raw = (value % (1 << 8 * size)).to_bytes(size, "big")
        if len(raw) < size:
            raise ValueError("the telegram is shorter than it should be")
        value_of: float = struct.unpack(f">{kind}", raw)[0]
        return value_of

    def integer(self, kind: Kind) -> int:
        return int(self.number(kind))

    def text(self) -> str:
        """A text with its length before it."""
        return self.raw(self.integer("H"))

    def raw(self, length: int) -> str:
        """A text of known length."""
        raw = self._data[self._at : self._at + length]
        if len(raw) < length:
            raise ValueError("a text is shorter than it should be")
        self._at += length + (self._dialect == "A")
        return raw.decode("ascii", "replace")

    def array(self, kind: Literal["B", "H"], count: int) -> NDArray[np.uint16]:
        """(count,) whole numbers."""
        if self._dialect == "A":
            return self._hex_array(count)
        size = count * _SIZES[kind]
        if len(self._data) < self._at + size:
            raise ValueError(f"{count} values announced, fewer sent")
        values = np.frombuffer(self._data, f">u{_SIZES[kind]}", count, self._at)
        self._at += size
        return values.astype(np.uint16)

    def _word(self) -> str:
        """Up to the next blank."""
        end = self._data.find(b" ", self._at)
        end = len(self._data) if end < 0 else end
        word = self._data[self._at : end].decode("ascii", "replace")
        if not word:
            raise ValueError("the telegram is shorter than it should be")
        self._at = min(end + 1, len(self._data))
        return word

    def _hex_array(self, count: int) -> NDArray[np.uint16]:
        if not count:
            return np.zeros(0, np.uint16)
        # no value has more than four digits
        text = np.frombuffer(self._data, np.uint8, -1, self._at)[: 5 * count]
        blanks = np.flatnonzero(text == _BLANK)[:count]
        ends = np.append(blanks, len(text))[:count]  # the last value may end the telegram
        if len(ends) < count:
            raise ValueError(f"{count} values announced, fewer sent")
        starts = np.append(0, ends[:-1] + 1)
        lengths = ends - starts
        digits = _DIGITS[text[: ends[-1]]]
        digits[blanks[: np.searchsorted(blanks, ends[-1])]] = 0
        if lengths.min() < 1 or lengths.max() > 4 or (digits == _NO_DIGIT).any():
            raise ValueError("values that are no hex numbers")
        place = np.repeat(ends, np.append(lengths[:-1] + 1, lengths[-1])) - np.arange(ends[-1]) - 1
        values = np.add.reduceat(digits << (4 * np.maximum(place, 0)), starts)
        self._at = min(self._at + int(ends[-1]) + 1, len(self._data))
        return values.astype(np.uint16)


_NO_DIGIT = 99
_DIGITS = np.full(256, _NO_DIGIT, np.int64)
for _value, _digit in enumerate(b"0123456789ABCDEF"):
    _DIGITS[_digit] = _value
for _value, _digit in enumerate(b"abcdef"):
    _DIGITS[_digit] = 10 + _value
