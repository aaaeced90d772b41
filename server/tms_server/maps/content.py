"""What a sent tile holds: checked before any of it is stored."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from tms_schemas.problem import ProblemItem
from tms_schemas.tiles import CELLS, INTENSITY_PLANES, SIDE, UNKNOWN, Planes, TileError, from_text, unpack
from tms_server.errors import Invalid

Plane = npt.NDArray[Any]
#: Cells of the rectangle around all that is known: what a picture of the map takes in bytes.
MAX_CELLS = 2**26
#: Digests of tiles that are wholly unknown: a version has no tile there.
BLANK = frozenset(
    Planes(bytes([UNKNOWN]) * CELLS, intensity).digest
    for intensity in (b"", bytes(CELLS * sum(np.dtype(dtype).itemsize for dtype in INTENSITY_PLANES)))
)


class Content(NamedTuple):
    """A good tile. ``known``: left, bottom, right, top of its known cells, the upper ends excluded."""

    digest: str
    body: bytes
    known: tuple[int, int, int, int]


def read_tiles(texts: Iterable[tuple[str, str]]) -> list[Content]:
    """Contents of tiles given as (where in the request, base64). Raises ``Invalid`` naming the bad ones."""
    found: list[Content] = []
    bad: list[ProblemItem] = []
    for where, text in texts:
        try:
            found.append(read_tile(from_text(text)))
        except TileError as error:
            bad.append(ProblemItem(where=where, why=str(error)))
    if bad:
        raise Invalid(f"{bad[0].where}: {bad[0].why}", items=bad[:100])
    return found


def read_tile(data: bytes) -> Content:
    """Raises ``TileError``."""
    planes = unpack(data)
    known = np.frombuffer(planes.occupancy, np.uint8) != UNKNOWN
    if planes.intensity:
        mean, variance, count = intensity_planes(planes)
        if not (np.isfinite(mean).all() and np.isfinite(variance).all() and (variance >= 0).all()):
            raise TileError("means and variances of its intensity must be finite, variances not negative")
        measured = count > 0
        if mean[~measured].any() or variance[~measured].any():
            raise TileError("a cell whose intensity was measured 0 times has mean and variance 0")
        known |= measured
    return Content(planes.digest, data, _extent(known.reshape(SIDE, SIDE)))


def intensity_planes(planes: Planes) -> list[Plane]:
    """Mean, variance and count, each of ``CELLS`` values."""
    found, offset = [], 0
    for dtype in INTENSITY_PLANES:
        found.append(np.frombuffer(planes.intensity, dtype, CELLS, offset))
        offset += CELLS * np.dtype(dtype).itemsize
    return found


def _extent(known: Plane) -> tuple[int, int, int, int]:
    rows, columns = np.flatnonzero(known.any(axis=1)), np.flatnonzero(known.any(axis=0))
    if not len(rows):
        return 0, 0, 0, 0
    return int(columns[0]), int(rows[0]), int(columns[-1]) + 1, int(rows[-1]) + 1
