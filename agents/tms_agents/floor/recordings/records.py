"""The records of a recording: whatever is whole in a file, wherever else it is damaged.

``TMSSCAN1\\n``, then records: kind (1 byte), length and CRC-32 of the body (4 bytes each, little-endian), body. Kind S
describes a sensor, kind B is a block of its scans (``blocks``). Where a record cannot be read, the next one is looked
for byte by byte: a damaged byte costs its record, not the rest of the file.
"""

from __future__ import annotations

import os
import re
import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from typing import IO

MAGIC = b"TMSSCAN1\n"
HEAD = struct.Struct("<cII")
#: How the body of a block begins: sensor, scans, beams, what is in it.
BLOCK = struct.Struct("<HHIB")
#: No description and no block is longer (100 000 beams, 100 scans).
_MOST_TOLD, _MOST = 1 << 23, (1 << 26) - 1
#: How a record begins, as far as it can be told without its check sum: a length that can be, and what is compressed.
#: Of what is no record one place in 100 million looks like that, so that looking for the next one is quick.
_LIKELY = re.compile(
    rb"S.{3}\x00.{4}x[\x01\x5e\x9c\xda]|B.{3}[\x00-\x03].{4}.{8}[\x00-\x03]x[\x01\x5e\x9c\xda]", re.DOTALL
)
_LIKELY_BYTES = HEAD.size + BLOCK.size + 2
#: So much is looked through at once, at first: where much looks like a record the next one is near.
_WINDOW, _WIDEST = 1 << 12, 1 << 18


@dataclass(frozen=True, slots=True)
class Record:
    """``at``: where its body begins in the file."""

    kind: bytes
    at: int
    body: bytes


@dataclass(slots=True)
class Damage:
    """What of a file cannot be read; complete when all records were gone through."""

    #: Bytes with something readable after them.
    skipped: int = 0
    #: Scans that nobody can read because the description of their sensor is damaged.
    undescribed: int = 0
    #: Where the last whole record ends, and what is after it: mostly a record that was not written to its end.
    whole: int = 0
    tail: int = 0

    def in_words(self) -> str:
        """One line without a full stop; empty where all is well."""
        found = []
        if self.skipped:
            found.append(f"{self.skipped} bytes are damaged and were skipped")
        if self.undescribed:
            found.append(f"{self.undescribed} scans are lost because what describes their laser is damaged")
        if self.tail:
            found.append(f"its last {self.tail} bytes are no whole record and were left out")
        return "; ".join(found)


def records(file: IO[bytes], damage: Damage) -> Iterator[Record]:
    """All whole records, also while somebody appends others.

    Raises:
        ValueError: it is no recording.
    """
    size = file.seek(0, os.SEEK_END)
    file.seek(0)
    start = file.read(len(MAGIC))
    at = damage.whole = len(MAGIC) if start == MAGIC else 0
    begun = len(start) < len(MAGIC) and MAGIC.startswith(start)
    while at < size and not begun:
        if (record := _record(file, at, size)) is None:
            at = _next_likely(file, at + 1, size)
            continue
        damage.skipped += at - damage.whole
        at = damage.whole = record.at + len(record.body)
        yield record
    damage.tail = size - damage.whole
    if damage.whole == 0 and not begun:
        raise ValueError("it is no recording of scans")


def _record(file: IO[bytes], at: int, size: int) -> Record | None:
    """The record that begins there, if one does that is whole."""
    file.seek(at)
    if len(head := file.read(HEAD.size)) < HEAD.size:
        return None
    kind, length, check = HEAD.unpack(head)
    if kind not in (b"S", b"B") or length > size - at - HEAD.size:
        return None
    begin = file.read(min(length, BLOCK.size))
    if length > (_MOST_TOLD if kind == b"S" else _most_of_block(begin)):
        return None  # a length that cannot be is not read: that would take long where much is damaged
    body = begin + file.read(length - len(begin))
    if len(body) < length or zlib.crc32(body) != check:
        return None
    return Record(kind, at + HEAD.size, body)


def _most_of_block(begin: bytes) -> int:
    """How long a block that begins so can be: times, ranges and intensities, if nothing of them can be compressed."""
    if len(begin) < BLOCK.size:
        return 0
    _, scans, beams, _ = BLOCK.unpack(begin)
    whole = scans * (16 + 4 * beams)
    return int(min(_MOST, BLOCK.size + whole + whole // 1000 + 64))


def _next_likely(file: IO[bytes], at: int, size: int) -> int:
    """Where, from there on, a record may begin; the size of the file where none does."""
    wide = _WINDOW
    while at < size:
        file.seek(at)
        window = file.read(wide)
        if found := _LIKELY.search(window):
            return at + found.start()
        if len(window) < wide:
            break
        at += len(window) - _LIKELY_BYTES + 1
        wide = min(2 * wide, _WIDEST)
    return size
