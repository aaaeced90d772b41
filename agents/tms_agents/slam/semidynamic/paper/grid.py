"""The paper's occupancy grid of 2 cm: beams are written into it, and where an object has moved it is rewritten."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tms_agents.slam.distance import disc, mark_discs, update_distances
from tms_agents.slam.geometry import Bytes, Floats, Ints
from tms_agents.slam.gridmap import GridMap, grid_map
from tms_agents.slam.maps import Maps
from tms_agents.slam.occupancy import EVEN, HIGHEST, LOWEST
from tms_agents.slam.tiles import MASK, SHIFT

#: The distance field reaches so far (m); beams end so many cells beside the surface of an object at most.
_REACH_M, _BESIDE = 0.2, 2


class RewrittenGrid:
    """``maps`` holds one map and its distance field."""

    def __init__(self, resolution: float) -> None:
        self.maps = Maps(1, resolution, _REACH_M)
        self._offsets = disc(self.maps.radius)

    def write(self, pose: Floats, points: Floats, laser: Floats) -> None:
        """``points`` (M, 2) of a scan, seen from the robot at ``pose`` (3,)."""
        self.maps.integrate(pose[None], points, laser)

    def move(self, before: Floats | None, now: Floats) -> None:
        """The surface ``before`` (M, 2) m is cleared, the one that is ``now`` (M, 2) is drawn."""
        if before is not None:
            steps = np.arange(-_BESIDE, _BESIDE + 1)
            around = np.stack(np.meshgrid(steps, steps), axis=-1).reshape(-1, 2)
            self._set((self._cells(before)[:, None, :] + around).reshape(-1, 2), LOWEST)
        self._set(self._cells(now), HIGHEST)

    def finished(self) -> GridMap:
        return grid_map(self.maps, 0)

    def _cells(self, points: Floats) -> NDArray[np.int64]:
        frame = self.maps.frame
        found: NDArray[np.int64] = np.floor((points - frame[:2]) * frame[2]).astype(np.int64)
        return found

    def _set(self, at: NDArray[np.int64], value: int) -> None:
        """Cells ``at`` (C, 2), those inside; their distances, too."""
        maps = self.maps
        height, width = maps.occupancy.directory.shape[1:]
        at = np.unique(at[((at >= 0) & (at < np.array([width << SHIFT, height << SHIFT]))).all(axis=1)], axis=0)
        if not len(at):
            return
        tiles, place = at >> SHIFT, ((at[:, 1] & MASK) << SHIFT) | (at[:, 0] & MASK)
        mine = np.unique(tiles[:, 1] * width + tiles[:, 0]).astype(np.int32)
        maps.occupancy.make_writable(mine[None], np.array([len(mine)], dtype=np.int32))
        rows = maps.occupancy.directory[0, tiles[:, 1], tiles[:, 0]]
        was = maps.occupancy.cells[rows, place] > EVEN
        maps.occupancy.cells[rows, place] = value
        numbers = at[:, 1] * (width << SHIFT) + at[:, 0]
        different = numbers[was != (value > EVEN)]
        changed: Ints = (different if value > EVEN else -1 - different).astype(np.int32)[None]
        changes: Ints = np.array([changed.shape[1]], dtype=np.int32)
        seen: Bytes = np.zeros((1, height * width), dtype=np.uint8)
        wanted: Ints = np.empty((1, height * width), dtype=np.int32)
        counts: Ints = np.empty(1, dtype=np.int32)
        mark_discs(height, width, maps.radius, changed, changes, seen, wanted, counts)
        maps.distance.make_writable(wanted, counts)
        update_distances(
            maps.distance.directory, maps.distance.cells, maps.occupancy.directory, maps.occupancy.cells,
            self._offsets, changed, changes,
        )  # fmt: skip
