"""Many maps that share their tiles until one of them writes: copy-on-write in plain arrays, for the kernels.

A tile is 32 x 32 cells (bytes, where nothing else is said). Every map has a directory of tile numbers over the same
rectangle; tile 0 is the blank tile, which all maps share and nobody writes. Kernels write only to tiles that
``make_writable`` has given to their map alone, so maps can be written side by side, and what they hold does not depend
on the number of threads.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from tms_agents.slam.geometry import Bytes, Ints

Cells = NDArray[Any]

SHIFT = 5
SIDE = 1 << SHIFT
MASK = SIDE - 1
_CELLS = SIDE * SIDE
#: Tiles there is room for at first.
_FIRST = 256


class TiledMaps:
    """``directory`` (N, H, W) tile numbers of N maps, ``cells`` (C, 1024) of C tiles, ``references`` (C,) to each.

    Maps of several ``layers`` hold one after the other in a row of ``cells``, (C, layers * 1024) of ``dtype``.
    """

    def __init__(
        self, maps: int, blank: float, height: int, width: int, *, layers: int = 1, dtype: type[np.generic] = np.uint8
    ) -> None:
        self.directory: Ints = np.zeros((maps, height, width), dtype=np.int32)
        self.cells: Cells = np.full((_FIRST, layers * _CELLS), blank, dtype=dtype)
        self.references: Ints = np.zeros(_FIRST, dtype=np.int32)
        self.blank = blank
        self._free: Ints = np.arange(_FIRST - 1, 0, -1, dtype=np.int32)  # a stack, its top at [_unused - 1]
        self._unused = _FIRST - 1

    @property
    def tiles_used(self) -> int:
        """Tiles that hold something, shared ones counted once."""
        return len(self.cells) - 1 - self._unused

    def make_writable(self, wanted: Ints, counts: Ints) -> None:
        """Give map n alone the tiles ``wanted[n, :counts[n]]`` (numbers y * W + x, each once): new, or copied."""
        needed = int(counts.sum())
        if needed > self._unused:
            self._grow(needed - self._unused)
        flat = self.directory.reshape(len(self.directory), -1)
        self._unused = _make_writable(
            flat, self.cells, self.references, self._free, self._unused, wanted, counts, self.blank
        )

    def resample(self, parents: Ints) -> None:
        """Map n becomes what map ``parents[n]`` was, without a copy of any cell. The number of maps may change."""
        self.directory = self.directory[parents]
        self._unused = _recount(self.directory.reshape(-1), self.references, self._free)

    def clear(self) -> None:
        """All maps blank."""
        self.directory[:] = 0
        self._unused = _recount(self.directory.reshape(-1), self.references, self._free)

    def extend(self, below: int, left: int, above: int, right: int) -> None:
        """Blank tiles on the four sides of the rectangle."""
        self.directory = np.pad(self.directory, ((0, 0), (below, above), (left, right)))

    def dense(self, n: int) -> Bytes:
        """Map ``n`` as one array (H * 32, W * 32), row 0 lowest."""
        height, width = self.directory.shape[1:]
        tiles = self.cells[self.directory[n]].reshape(height, width, SIDE, SIDE)
        return np.ascontiguousarray(tiles.swapaxes(1, 2)).reshape(height * SIDE, width * SIDE)

    def _grow(self, missing: int) -> None:
        old = len(self.cells)
        size = old + max(missing, old // 4)
        cells = np.empty((size, self.cells.shape[1]), dtype=self.cells.dtype)
        cells[:old] = self.cells
        cells[old:] = self.blank
        self.cells = cells
        self.references = np.concatenate([self.references, np.zeros(size - old, dtype=np.int32)])
        fresh = np.arange(size - 1, old - 1, -1, dtype=np.int32)
        free = np.empty(size, dtype=np.int32)
        free[: size - old] = fresh
        free[size - old : size - old + self._unused] = self._free[: self._unused]
        self._free = free
        self._unused += size - old


@njit(cache=True)
def _make_writable(
    directory: Ints, cells: Cells, references: Ints, free: Ints, unused: int, wanted: Ints, counts: Ints, blank: float
) -> int:
    for n in range(len(counts)):
        for k in range(counts[n]):
            place = wanted[n, k]
            old = directory[n, place]
            if old != 0 and references[old] == 1:
                continue
            unused -= 1
            new = free[unused]
            if old == 0:
                cells[new, :] = blank
            else:
                cells[new, :] = cells[old, :]
                references[old] -= 1
            references[new] = 1
            directory[n, place] = new
    return unused


@njit(cache=True)
def _recount(directory: Ints, references: Ints, free: Ints) -> int:
    """References anew from the directories, and which tiles are free."""
    references[:] = 0
    for i in range(len(directory)):
        references[directory[i]] += 1
    unused = 0
    for tile in range(len(references) - 1, 0, -1):
        if references[tile] == 0:
            free[unused] = tile
            unused += 1
    return unused
