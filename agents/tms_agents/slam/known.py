"""A finished map as a robot looks it up: how far each place is from a surface, where it may stand, what nobody saw."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from zipfile import BadZipFile

import numpy as np
from scipy import ndimage

from tms_agents.slam.distance import LARGEST_RADIUS
from tms_agents.slam.geometry import Bytes, Floats, Ints
from tms_agents.slam.tiles import MASK, SHIFT, SIDE

#: What is nearer to a surface than this is at that surface, even where nobody saw it (m).
BEHIND_M = 0.2
#: A robot's axle is at least so far from surfaces (m).
CLEARANCE_M = 0.15
#: Code of cells of which nothing is known; squared distances are below it.
UNSEEN = 254


class MapError(ValueError):
    """Nobody can find the way in this map; the text says why in one line."""


@dataclass(frozen=True, slots=True, eq=False)
class KnownMap:
    """``codes`` (H, W): squared distance in cells to the nearest surface, at most that of the field's reach, or
    `UNSEEN`; row 0 lowest. ``directory`` and ``tiles`` are the same field for the matcher, without gaps.

    ``frame`` is x, y (m) of the lower left corner and cells per m, ``metres`` (256,) the distance of each code.
    ``standing`` (F, 2) are the cells (x, y) where a robot may be. ``occupancy`` (H, W) as given.
    """

    codes: Bytes
    directory: Ints
    tiles: Bytes
    frame: Floats
    metres: Floats
    standing: Ints
    occupancy: Floats

    @property
    def resolution(self) -> float:
        return float(1.0 / self.frame[2])

    @property
    def free_m2(self) -> float:
        """Area where a robot may be."""
        return float(len(self.standing) / self.frame[2] ** 2)


def known_map(occupancy: Floats, origin: tuple[float, float], resolution: float, reach_m: float = 0.5) -> KnownMap:
    """``occupancy`` (H, W): probability, NaN unknown, row 0 with the lowest y, whose left corner is ``origin`` (m).

    Raises:
        MapError: nothing in it is occupied, or nothing is free.
    """
    occupied, free = occupancy > 0.5, occupancy < 0.5
    if not occupied.any():
        raise MapError("nothing in the map is occupied")
    radius = int(np.clip(round(reach_m / resolution), 2, LARGEST_RADIUS))
    margin = radius + 1
    occupied, free = np.pad(occupied, margin), np.pad(free, margin)
    apart = ndimage.distance_transform_edt(~occupied)
    squared = np.minimum(np.square(apart).round(), radius**2).astype(np.uint8)
    codes = np.where(free | (apart * resolution < BEHIND_M), squared, UNSEEN).astype(np.uint8)
    standing = np.argwhere(free & (apart * resolution >= CLEARANCE_M))[:, ::-1]
    if not len(standing):
        raise MapError("there is no free place in the map where a robot could be")
    directory, tiles = _tiled(squared, radius**2)
    frame = np.array([origin[0] - margin * resolution, origin[1] - margin * resolution, 1.0 / resolution])
    metres = np.minimum(np.sqrt(np.arange(256.0)), radius) * resolution
    return KnownMap(codes, directory, tiles, frame, metres, standing.astype(np.int32), occupancy)


def read_npz(path: Path) -> tuple[Floats, tuple[float, float], float]:
    """(occupancy, origin, resolution) of the ``map.npz`` that `write_map` wrote.

    Raises:
        MapError: it is no such file.
        OSError: it cannot be read.
    """
    try:
        with np.load(path, allow_pickle=False) as layers:
            occupancy = np.asarray(layers["occupancy"], dtype=np.float64)
            x, y = (float(one) for one in layers["origin"])
            resolution = float(layers["resolution"])
    except (ValueError, KeyError, TypeError, EOFError, BadZipFile) as error:
        raise MapError(f"no map of tms slam run ({error})") from error
    if occupancy.ndim != 2 or not (np.isfinite([x, y]).all() and 0 < resolution < np.inf):
        raise MapError("no map of tms slam run (its arrays have other shapes)")
    return occupancy, (x, y), resolution


def _tiled(squared: Bytes, farthest: int) -> tuple[Ints, Bytes]:
    """The field (H, W) cut into tiles: (directory (h, w), tiles (h * w, cells))."""
    height, width = (-(-size // SIDE) for size in squared.shape)
    padded = np.full((height * SIDE, width * SIDE), farthest, dtype=np.uint8)
    padded[: squared.shape[0], : squared.shape[1]] = squared
    tiles = padded.reshape(height, SIDE, width, SIDE).swapaxes(1, 2).reshape(height * width, (MASK + 1) << SHIFT)
    directory = np.arange(height * width, dtype=np.int32).reshape(height, width)
    return directory, np.ascontiguousarray(tiles)
