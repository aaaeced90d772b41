"""Numbers and sums of SCIP: six bits per character, big end first, each plus 0x30; a sum character ends every line.

Source: Hokuyo, Communication Protocol Specification for SCIP2.0, C-42-03320B.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Chars = NDArray[np.uint8]

#: Characters of data in a line; its sum and the line feed follow.
BLOCK = 64
_STRIDE = BLOCK + 2
_LF = 0x0A
_BASE = 0x30


def checksum(text: bytes) -> int:
    """The character that ends a line of this text."""
    return (sum(text) & 0x3F) + _BASE


def decode(chars: Chars, width: int) -> NDArray[np.int32]:
    """Values (n,) of ``n * width`` characters; ``width`` is 2, 3 or 4.

    Raises:
        ValueError: a character that encodes nothing, or a part of a value.
    """
    if len(chars) % width:
        raise ValueError(f"{len(chars)} characters are no whole number of values")
    if not encodes_values(chars):
        raise ValueError("a character that encodes nothing")
    columns = (chars - np.uint8(_BASE)).reshape(-1, width).T.astype(np.int32)
    values: NDArray[np.int32] = columns[0]
    for column in columns[1:]:
        values = values << 6 | column
    return values


def encodes_values(chars: Chars) -> bool:
    """Whether every character stands for six bits."""
    # what is below the base wraps to more than six bits
    return not chars.size or int((chars - np.uint8(_BASE)).max()) <= 0x3F


def encode(values: NDArray[np.integer], width: int) -> bytes:
    """Characters of values (n,), each limited to what ``width`` characters hold."""
    limited = np.clip(values, 0, (1 << 6 * width) - 1).astype(np.int64)
    shifts = np.arange(width - 1, -1, -1) * 6
    chars: Chars = ((limited[:, None] >> shifts & 0x3F) + _BASE).astype(np.uint8)
    return chars.tobytes()


def join_blocks(lines: bytes) -> Chars:
    """The characters of data lines (each ended by a line feed) without their sums, which are verified.

    Raises:
        ValueError: a sum is wrong, a line is too long or too short.
    """
    raw = np.frombuffer(lines, np.uint8)
    whole = len(raw) // _STRIDE
    blocks, last = raw[: whole * _STRIDE].reshape(whole, _STRIDE), raw[whole * _STRIDE :]
    if len(last) and (len(last) < 3 or last[-1] != _LF):
        raise ValueError("a cut data line")
    data = blocks[:, :BLOCK]
    right = (data.sum(axis=1) & 0x3F) + _BASE == blocks[:, BLOCK]
    if not right.all() or (blocks[:, -1] != _LF).any():
        raise ValueError("a data line with a wrong sum")
    if not len(last):
        return data.ravel()
    if (int(last[:-2].sum()) & 0x3F) + _BASE != last[-2]:
        raise ValueError("a data line with a wrong sum")
    return np.concatenate((data.ravel(), last[:-2]))


def cut_blocks(chars: bytes) -> bytes:
    """The data lines of these characters: the inverse of ``join_blocks``."""
    raw = np.frombuffer(chars, np.uint8)
    whole = len(raw) // BLOCK
    blocks = np.empty((whole, _STRIDE), np.uint8)
    blocks[:, :BLOCK] = raw[: whole * BLOCK].reshape(whole, BLOCK)
    blocks[:, BLOCK] = (blocks[:, :BLOCK].sum(axis=1) & 0x3F) + _BASE
    blocks[:, -1] = _LF
    last = chars[whole * BLOCK :]
    return blocks.tobytes() + (last + bytes([checksum(last), _LF]) if last else b"")
