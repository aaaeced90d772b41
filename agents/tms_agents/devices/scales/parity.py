"""Seven data bits and even parity in eight-bit bytes: what such a line carries, seen as 8N1.

For adapters and network converters that know only 8N1; a serial port that can do 7E1 does this in hardware.
"""

from __future__ import annotations

_WITH_PARITY = bytes(byte & 0x7F | (byte & 0x7F).bit_count() % 2 << 7 for byte in range(256))
_WITHOUT = bytes(byte & 0x7F for byte in range(256))
_WRONG = bytes(byte for byte in range(256) if byte.bit_count() % 2)


def add_even_parity(text: bytes) -> bytes:
    return text.translate(_WITH_PARITY)


def strip_even_parity(data: bytes) -> bytes:
    """The text; a byte with wrong parity becomes ``?``, which is part of no line of a scale."""
    if any(byte in _WRONG for byte in data):
        data = bytes(0x3F if byte in _WRONG else byte for byte in data)
    return data.translate(_WITHOUT)
