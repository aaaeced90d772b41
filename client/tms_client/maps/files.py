"""What ``tms slam run`` and ``map_server`` write, read for an upload."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np

from tms_client.errors import TownError
from tms_client.maps.cells import Floats, Intensity
from tms_client.maps.ros import Grid, read_map


class Recorded(NamedTuple):
    grid: Grid
    intensity: Intensity | None


def read_folder(path: Path) -> Recorded:
    """A map from a folder with ``map.yaml``, or from such a file itself.

    Of a folder, ``map.npy`` counts where it is there: probabilities (H, W), row 0 with the lowest y, NaN unknown,
    instead of the image's three values; and ``imap.npy``, the mean of the received light (H, W), NaN unmeasured, or
    mean, variance and count (3, H, W).

    Raises:
        TownError: something is missing, cannot be read, or does not fit together.
    """
    if not path.is_dir():
        return Recorded(read_map(path), None)
    grid = read_map(path / "map.yaml")
    shape = grid.occupancy.shape
    if (path / "map.npy").exists():
        grid = grid._replace(occupancy=_array(path / "map.npy", [shape]))
    if not (path / "imap.npy").exists():
        return Recorded(grid, None)
    layers = _array(path / "imap.npy", [shape, (3, *shape)])
    if layers.ndim == 2:
        measured = np.isfinite(layers)
        return Recorded(
            grid, Intensity(layers, np.where(measured, 0, np.nan).astype(np.float32), measured.astype(np.uint32))
        )
    count = np.nan_to_num(layers[2], nan=0.0)
    if (count < 0).any() or (count >= 2**32).any():
        raise TownError(f"{path / 'imap.npy'}: a count is negative or too large")
    return Recorded(grid, Intensity(layers[0], layers[1], count.astype(np.uint32)))


def _array(path: Path, shapes: list[tuple[int, ...]]) -> Floats:
    try:
        found = np.load(path, allow_pickle=False)
    except (OSError, ValueError, EOFError) as error:
        raise TownError(f"{path}: {error}") from error
    if not isinstance(found, np.ndarray) or found.dtype.kind not in "fiu" or found.shape not in shapes:
        wanted = " or ".join(str(shape) for shape in shapes)
        raise TownError(f"{path}: no array of numbers of the shape {wanted}, which the map's image has")
    return found.astype(np.float32)
