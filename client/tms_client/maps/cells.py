"""Between arrays and tiles. Row 0 of every array has the lowest y."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from tms_client.errors import TownError
from tms_schemas.tiles import CELLS, FULL, INTENSITY_PLANES, SIDE, UNKNOWN, Planes

#: (i, j) of a tile, and (column, row) of a cell, from the map's origin.
Place = tuple[int, int]
Floats = npt.NDArray[np.float32]
#: How far from the grid of the map an array may lie, in cells.
_ALIGNED = 1e-3


@dataclass(frozen=True, slots=True, eq=False)
class Intensity:
    """Received light, (H, W) each: mean and variance, NaN where nothing was measured, and how often it was."""

    mean: Floats
    variance: Floats
    count: npt.NDArray[np.uint32]


class Window(NamedTuple):
    """Part of a map: ``corner`` is the cell of the arrays' [0, 0]."""

    corner: Place
    occupancy: Floats
    intensity: Intensity | None


def corner_of(
    origin: tuple[float, float], map_origin: tuple[float, float], resolution: float, *, snap: bool = False
) -> Place:
    """The cell whose lower left corner is ``origin`` (metres in the map frame).

    Args:
        snap: take the nearest where there is none, which shifts the map by up to half a cell.

    Raises:
        TownError: ``origin`` is not on the grid of the map.
    """
    cells = [(at - zero) / resolution for at, zero in zip(origin, map_origin, strict=True)]
    x, y = (round(one) for one in cells)
    off = max(abs(one - whole) for one, whole in zip(cells, (x, y), strict=True))
    if off > _ALIGNED and not snap:
        raise TownError(
            f"the origin {origin[0]:g}, {origin[1]:g} is {off:.2f} cells off the grid of the map, "
            f"which begins at {map_origin[0]:g}, {map_origin[1]:g}; snap shifts it to the nearest cell"
        )
    return x, y


def split(corner: Place, occupancy: npt.ArrayLike, intensity: Intensity | None = None) -> dict[Place, Planes]:
    """Tiles of arrays whose [0, 0] is the cell ``corner``; wholly unknown ones are left out.

    Args:
        occupancy: (H, W) probabilities, NaN where nothing is known.

    Raises:
        TownError: another shape, a probability outside 0 to 1, or an intensity that is none.
    """
    cells = quantised(occupancy)
    planes: list[npt.NDArray[Any]] = [] if intensity is None else _checked(intensity, cells.shape)
    blanks = [UNKNOWN] + [0] * len(planes)
    known = cells != UNKNOWN if not planes else (cells != UNKNOWN) | (planes[2] > 0)
    x0, y0 = corner
    height, width = cells.shape
    found: dict[Place, Planes] = {}
    for j in range(y0 // SIDE, -(-(y0 + height) // SIDE)):
        for i in range(x0 // SIDE, -(-(x0 + width) // SIDE)):
            left, bottom = i * SIDE - x0, j * SIDE - y0
            inside = (
                slice(max(0, bottom), min(height, bottom + SIDE)),
                slice(max(0, left), min(width, left + SIDE)),
            )
            if not known[inside].any():
                continue
            raw = []
            for plane, blank in zip([cells, *planes], blanks, strict=True):
                tile = np.full((SIDE, SIDE), blank, dtype=plane.dtype)
                down, right = max(0, -bottom), max(0, -left)
                part = plane[inside]
                tile[down : down + part.shape[0], right : right + part.shape[1]] = part
                raw.append(tile.tobytes())
            measured = planes and bool((planes[2][inside] > 0).any())
            found[(i, j)] = Planes(raw[0], b"".join(raw[1:]) if measured else b"")
    return found


def join(tiles: Mapping[Place, Planes]) -> Window:
    """The smallest arrays that hold all known cells; empty ones where there are none."""
    if not tiles:
        return Window((0, 0), np.zeros((0, 0), np.float32), None)
    i0, j0 = (min(place[axis] for place in tiles) for axis in (0, 1))
    i1, j1 = (max(place[axis] for place in tiles) + 1 for axis in (0, 1))
    shape = ((j1 - j0) * SIDE, (i1 - i0) * SIDE)
    cells = np.full(shape, UNKNOWN, dtype=np.uint8)
    planes = [np.zeros(shape, dtype=dtype) for dtype in INTENSITY_PLANES] if _any_intensity(tiles) else []
    for (i, j), tile in tiles.items():
        at = (slice((j - j0) * SIDE, (j - j0 + 1) * SIDE), slice((i - i0) * SIDE, (i - i0 + 1) * SIDE))
        cells[at] = np.frombuffer(tile.occupancy, np.uint8).reshape(SIDE, SIDE)
        for k, plane in enumerate(planes if tile.intensity else ()):
            plane[at] = np.frombuffer(tile.intensity, plane.dtype, CELLS, 4 * CELLS * k).reshape(SIDE, SIDE)
    known = (cells != UNKNOWN) | (planes[2] > 0) if planes else cells != UNKNOWN
    rows, columns = np.flatnonzero(known.any(axis=1)), np.flatnonzero(known.any(axis=0))
    inside = (slice(rows[0], rows[-1] + 1), slice(columns[0], columns[-1] + 1))
    corner = (i0 * SIDE + int(columns[0]), j0 * SIDE + int(rows[0]))
    return Window(corner, probabilities(cells[inside]), _intensity([plane[inside] for plane in planes]))


def quantised(occupancy: npt.ArrayLike) -> npt.NDArray[np.uint8]:
    """Probabilities as they are stored, to the nearest of 255 steps. Raises ``TownError``."""
    given = np.asarray(occupancy, dtype=np.float64)
    if given.ndim != 2:
        raise TownError(f"occupancy is (height, width), not {given.shape}")
    unknown = np.isnan(given)
    if ((given < 0) | (given > 1)).any():
        raise TownError("occupancy is a probability from 0 to 1, or NaN where nothing is known")
    return np.where(unknown, UNKNOWN, np.round(np.where(unknown, 0.0, given) * FULL)).astype(np.uint8)


def probabilities(cells: npt.NDArray[np.uint8]) -> Floats:
    """The inverse: float32, NaN where nothing is known."""
    values = (np.arange(256) / FULL).astype(np.float32)
    values[UNKNOWN] = np.nan
    found: Floats = values[cells]
    return found


def _any_intensity(tiles: Mapping[Place, Planes]) -> bool:
    return any(tile.intensity for tile in tiles.values())


def _checked(intensity: Intensity, shape: tuple[int, ...]) -> list[npt.NDArray[Any]]:
    """Planes as they are stored: all 0 where nothing was measured."""
    mean, variance, count = (np.asarray(plane) for plane in (intensity.mean, intensity.variance, intensity.count))
    if not mean.shape == variance.shape == count.shape == shape:
        raise TownError("the layers of the intensity have the shape of the occupancy")
    measured = count > 0
    finite = all(np.isfinite(plane[measured]).all() for plane in (mean, variance))
    if not finite or (variance[measured] < 0).any():
        raise TownError("where the intensity was measured, its mean is finite and its variance finite and not negative")
    stored = (np.where(measured, mean, 0), np.where(measured, variance, 0), np.where(measured, count, 0))
    return [plane.astype(dtype) for plane, dtype in zip(stored, INTENSITY_PLANES, strict=True)]


def _intensity(planes: list[npt.NDArray[Any]]) -> Intensity | None:
    if not planes:
        return None
    mean, variance, count = planes
    unmeasured = count == 0
    values = [np.where(unmeasured, np.float32(np.nan), plane).astype(np.float32) for plane in (mean, variance)]
    return Intensity(values[0], values[1], count.astype(np.uint32))
