"""The light of a finished map, in the cells of its grid."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tms_agents.slam.geometry import Floats, transform
from tms_agents.slam.gridmap import GridMap
from tms_agents.slam.light.scans import LightScan


@dataclass(frozen=True, slots=True, eq=False)
class GridLight:
    """Per cell (H, W) of a `GridMap`: ``mean`` and ``variance`` of the light that came back from there (log intensity
    less that of a usual surface, NaN where none did), each beam by its precision; ``count`` of the beams."""

    mean: Floats
    variance: Floats
    count: NDArray[np.int64]

    def reflectance(self) -> Floats:
        """(H, W) how bright a cell is in comparison with a usual surface (1), NaN where unknown."""
        shares: Floats = np.exp(self.mean)
        return shares


def grid_light(grid: GridMap, path: Floats, scans: Sequence[LightScan]) -> GridLight:
    """Of ``scans`` seen from ``path`` (K, 3)."""
    shape = grid.cells.shape
    count, known, light, squares = (np.zeros(shape[0] * shape[1]) for _ in range(4))
    for pose, scan in zip(path, scans, strict=True):
        cells = np.floor((transform(pose, scan.points) - grid.origin) / grid.resolution).astype(np.int64)
        inside = ((cells >= 0) & (cells < (shape[1], shape[0]))).all(axis=1)
        places = cells[inside, 1] * shape[1] + cells[inside, 0]
        precision, seen = 1.0 / np.square(scan.deviation[inside]), scan.light[inside]
        np.add.at(count, places, 1.0)
        np.add.at(known, places, precision)
        np.add.at(light, places, precision * seen)
        np.add.at(squares, places, precision * seen * seen)
    with np.errstate(invalid="ignore", divide="ignore"):
        mean = light / known
        variance = np.maximum(squares / known - mean * mean, 0.0)
    return GridLight(mean.reshape(shape), variance.reshape(shape), count.reshape(shape).astype(np.int64))
