"""The bytes of a map tile: a square of cells, its layers compressed, named by its content.

A map is a grid of tiles of ``SIDE`` x ``SIDE`` cells. Tile (i, j) holds the columns from ``SIDE * i`` and the rows from
``SIDE * j`` on, counted from the map's origin towards +x and +y; i and j may be negative, so a map grows every way.
Planes are row by row, the lowest y first. On the wire a tile is one byte that says which planes follow, and these as
one zlib stream; JSON carries it in base64.
"""

from __future__ import annotations

import base64
import binascii
import hashlib
import zlib
from typing import NamedTuple

#: Cells along an edge, and in a tile.
SIDE = 64
CELLS = SIDE * SIDE
#: Occupancy is p = byte / ``FULL``; ``UNKNOWN`` is a cell that nothing is known of.
FULL, UNKNOWN = 254, 255
#: Little-endian planes of received light intensity, in this order: mean and variance (float32), count (uint32).
INTENSITY_PLANES = ("<f4", "<f4", "<u4")
_INTENSITY_BYTES = 12 * CELLS
_OCCUPANCY, _WITH_INTENSITY = 1, 3
#: No packed tile is larger: what zlib adds to incompressible planes is a few bytes in 16 kB.
MAX_PACKED = 1 + CELLS + _INTENSITY_BYTES + 100
MAX_TEXT = 4 * ((MAX_PACKED + 2) // 3)


class TileError(ValueError):
    """These bytes are no tile."""


class Planes(NamedTuple):
    """``occupancy``: ``CELLS`` bytes. ``intensity``: the three planes one after the other, empty where unmeasured."""

    occupancy: bytes
    intensity: bytes = b""

    @property
    def digest(self) -> str:
        """SHA-256 of the content in hex, whatever the compressor made of it."""
        return hashlib.sha256(bytes([_layers(self)]) + self.occupancy + self.intensity).hexdigest()


def pack(planes: Planes) -> bytes:
    """Raises ``TileError`` where a plane has another size."""
    if len(planes.occupancy) != CELLS or len(planes.intensity) not in (0, _INTENSITY_BYTES):
        raise TileError(f"a tile has {SIDE} x {SIDE} cells")
    return bytes([_layers(planes)]) + zlib.compress(planes.occupancy + planes.intensity, 6)


def unpack(data: bytes) -> Planes:
    """What was packed; never makes more bytes than a tile has, whatever the stream promises. Raises ``TileError``."""
    if not data or data[0] not in (_OCCUPANCY, _WITH_INTENSITY):
        raise TileError("it does not begin with its layers: 1 (occupancy) or 3 (occupancy and intensity)")
    size = CELLS + (_INTENSITY_BYTES if data[0] == _WITH_INTENSITY else 0)
    stream = zlib.decompressobj()
    try:
        content = stream.decompress(data[1:], size + 1)
    except zlib.error as error:
        raise TileError(f"its zlib stream is damaged: {error}") from None
    if len(content) != size:
        found = f"more than {size}" if len(content) > size else str(len(content))
        raise TileError(f"its layers have {found} bytes instead of {size}")
    if not stream.eof or stream.unused_data:
        raise TileError("its zlib stream ends too early or is followed by other bytes")
    return Planes(content[:CELLS], content[CELLS:])


def to_text(data: bytes) -> str:
    return base64.b64encode(data).decode("ascii")


def from_text(text: str) -> bytes:
    """Raises ``TileError``."""
    try:
        return base64.b64decode(text, validate=True)
    except (binascii.Error, ValueError):
        raise TileError("it is not base64") from None


def _layers(planes: Planes) -> int:
    return _WITH_INTENSITY if planes.intensity else _OCCUPANCY
