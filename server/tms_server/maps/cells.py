"""The cells of a version as one array."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from tms_schemas.maps import Layer
from tms_schemas.tiles import FULL, SIDE, UNKNOWN, Planes, unpack
from tms_server.db.tables import MapRow
from tms_server.maps.content import intensity_planes
from tms_server.maps.service import AnySession, bounds_of, find_version
from tms_server.maps.tile_repository import TileRepository

#: As ``map_server`` has them by default: over the one a cell is occupied, under the other it is free.
OCCUPIED, FREE = 0.65, 0.196
Bytes = npt.NDArray[np.uint8]
Bounds = tuple[int, int, int, int]


class Cells(NamedTuple):
    """Row 0 has the lowest y; ``values`` (H, W) begin at cell ``bounds[:2]``."""

    bounds: Bounds
    values: npt.NDArray[Any]


class Raster(NamedTuple):
    """All that a picture of a version is made from, read from the database."""

    bounds: Bounds | None
    tiles: list[tuple[int, int, bytes]]

    def cells(self, layer: Layer = "occupancy") -> Cells:
        """Occupancy as stored (``UNKNOWN`` where nothing is known); intensity as float32, NaN where unmeasured."""
        if layer == "occupancy":
            return _assembled(self, _occupancy, np.uint8, UNKNOWN)
        return _assembled(self, lambda planes: _intensity(planes, layer), np.float32, np.nan)


async def raster(session: AnySession, row: MapRow, version: int | None) -> Raster:
    """Raises ``NotFound``."""
    found = await find_version(session, row, version)
    if found is None:
        return Raster(None, [])
    return Raster(bounds_of(found), list(await TileRepository(session, row.map).contents(found.version)))


def occupied(cells: Bytes) -> npt.NDArray[np.bool_]:
    found: npt.NDArray[np.bool_] = (cells > OCCUPIED * FULL) & (cells != UNKNOWN)
    return found


def free(cells: Bytes) -> npt.NDArray[np.bool_]:
    found: npt.NDArray[np.bool_] = cells < FREE * FULL
    return found


def tile_cells(body: bytes | None) -> Bytes:
    """Stored occupancy of a packed tile, (SIDE, SIDE); unknown where there is none."""
    return np.full((SIDE, SIDE), UNKNOWN, dtype=np.uint8) if body is None else _occupancy(unpack(body))


def _occupancy(planes: Planes) -> Bytes:
    return np.frombuffer(planes.occupancy, np.uint8).reshape(SIDE, SIDE)


def _intensity(planes: Planes, layer: Layer) -> npt.NDArray[np.float32]:
    if not planes.intensity:
        return np.full((SIDE, SIDE), np.nan, dtype=np.float32)
    mean, variance, count = intensity_planes(planes)
    values = {"mean": mean, "variance": variance, "count": count}[layer].astype(np.float32)
    return np.where(count > 0, values, np.nan).astype(np.float32).reshape(SIDE, SIDE)


def _assembled(raster: Raster, plane: Callable[[Planes], npt.NDArray[Any]], dtype: Any, blank: float) -> Cells:
    """A map of which nothing is known is one unknown cell: no picture is empty."""
    x0, y0, x1, y1 = bounds = raster.bounds or (0, 0, 1, 1)
    values = np.full((y1 - y0, x1 - x0), blank, dtype=dtype)
    for x, y, body in raster.tiles:
        left, bottom = x * SIDE - x0, y * SIDE - y0
        right, top = min(left + SIDE, x1 - x0), min(bottom + SIDE, y1 - y0)
        from_x, from_y = max(0, -left), max(0, -bottom)
        if left + from_x < right and bottom + from_y < top:
            part = plane(unpack(body))[from_y : top - bottom, from_x : right - left]
            values[bottom + from_y : top, left + from_x : right] = part
    return Cells(bounds, values)
