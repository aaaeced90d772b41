"""A finished map: probabilities in a rectangle, and how it is rendered from poses and scans."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tms_agents.slam.geometry import Bytes, Floats
from tms_agents.slam.maps import Maps
from tms_agents.slam.occupancy import UNKNOWN, probability
from tms_agents.slam.tiles import SIDE

#: So many scans are written at a time: each becomes as long as the longest of them.
_TOGETHER = 128


@dataclass(frozen=True, slots=True, eq=False)
class GridMap:
    """``cells`` (H, W) bytes of `occupancy`, row 0 lowest; ``origin`` (x, y) m of the lower left corner."""

    cells: Bytes
    origin: tuple[float, float]
    resolution: float

    def probabilities(self) -> Floats:
        """(H, W) that a cell is occupied, NaN where unknown."""
        return probability(self.cells)


def render(
    poses: Floats, scans: Sequence[Floats], laser: Floats, resolution: float, reach: float, fields: bool = True
) -> Maps:
    """One map of all ``scans`` ((M, 2) points seen from the robot) at ``poses`` (K, 3), with distances or without."""
    maps = Maps(1, resolution, reach)
    for first in range(0, len(poses), _TOGETHER):
        some = slice(first, first + _TOGETHER)
        maps.integrate_all([poses[some]], [scans[some]], laser)
    if fields:
        maps.measure()
    return maps


def grid_map(maps: Maps, n: int) -> GridMap:
    """Map ``n``, cut to what is known."""
    cells = maps.occupancy.dense(n)
    rows, columns = np.flatnonzero((cells != UNKNOWN).any(axis=1)), np.flatnonzero((cells != UNKNOWN).any(axis=0))
    if not len(rows):
        return GridMap(np.zeros((SIDE, SIDE), dtype=np.uint8), (0.0, 0.0), maps.resolution)
    cut = cells[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]
    x, y = maps.frame[:2] + np.array([columns[0], rows[0]]) * maps.resolution
    return GridMap(cut, (float(x), float(y)), maps.resolution)
