"""How far it is to the nearest occupied cell, kept up to date cell by cell in maps that share tiles.

A byte per cell holds the squared distance in cells, exact below the square of the radius, which stands for "farther".
"""

from __future__ import annotations

import numpy as np
from numba import njit, prange

from tms_agents.slam.geometry import Bytes, Floats, Ints
from tms_agents.slam.occupancy import EVEN
from tms_agents.slam.sharing import queue, take
from tms_agents.slam.tiles import MASK, SHIFT

#: The square of the radius has to fit into a byte.
LARGEST_RADIUS = 15


def disc(radius: int) -> Ints:
    """(K, 3) offsets x, y and their squared length below ``radius`` cells, nearest first."""
    span = np.arange(-radius + 1, radius)
    x, y = (axis.ravel() for axis in np.meshgrid(span, span))
    squared = x * x + y * y
    order = np.argsort(squared, kind="stable")
    order = order[squared[order] < radius * radius]
    return np.ascontiguousarray(np.stack([x[order], y[order], squared[order]], axis=-1).astype(np.int32))


@njit(cache=True, parallel=True)
def mark_discs(
    height: int, width: int, radius: int, changed: Ints, changes: Ints, seen: Bytes, wanted: Ints, counts: Ints
) -> None:
    """Numbers of the tiles that are nearer than ``radius`` cells to the cells ``changed[n, :changes[n]]`` (see
    `write_rays`)."""
    line = queue(len(changes))
    for begin in prange(len(changes)):
        n = take(line, begin)
        while n < len(changes):
            count = 0
            for k in range(changes[n]):
                cell = changed[n, k]
                if cell < 0:
                    cell = -1 - cell
                x, y = cell % (width << SHIFT), cell // (width << SHIFT)
                for ty in range(max(0, y - radius + 1) >> SHIFT, min(height - 1, (y + radius - 1) >> SHIFT) + 1):
                    for tx in range(max(0, x - radius + 1) >> SHIFT, min(width - 1, (x + radius - 1) >> SHIFT) + 1):
                        place = ty * width + tx
                        if seen[n, place] == 0:
                            seen[n, place] = 1
                            wanted[n, count] = place
                            count += 1
            for k in range(count):
                seen[n, wanted[n, k]] = 0
            counts[n] = count
            n = take(line, n)


@njit(cache=True, parallel=True)
def update_distances(
    directory: Ints,
    squared: Bytes,
    occupancy_directory: Ints,
    occupancy: Bytes,
    offsets: Ints,
    changed: Ints,
    changes: Ints,
) -> None:
    """Bring the fields (N, H, W) up to date after the cells ``changed[n, :changes[n]]`` became occupied or ceased to
    be."""
    line = queue(len(changes))
    for begin in prange(len(changes)):
        n = take(line, begin)
        while n < len(changes):
            _update(directory[n], squared, occupancy_directory[n], occupancy, offsets, changed[n, : changes[n]])
            n = take(line, n)


@njit(cache=True)
def _update(
    directory: Ints, squared: Bytes, occupancy_directory: Ints, occupancy: Bytes, offsets: Ints, changed: Ints
) -> None:
    height, width = directory.shape[0] << SHIFT, directory.shape[1] << SHIFT
    for k in range(len(changed)):
        if changed[k] >= 0:
            cx, cy = changed[k] % width, changed[k] // width
            for i in range(len(offsets)):
                x, y = cx + offsets[i, 0], cy + offsets[i, 1]
                if 0 <= x < width and 0 <= y < height:
                    tile, place = directory[y >> SHIFT, x >> SHIFT], ((y & MASK) << SHIFT) | (x & MASK)
                    if offsets[i, 2] < squared[tile, place]:
                        squared[tile, place] = offsets[i, 2]
    for k in range(len(changed)):
        if changed[k] < 0:
            cx, cy = (-1 - changed[k]) % width, (-1 - changed[k]) // width
            for i in range(len(offsets)):
                x, y = cx + offsets[i, 0], cy + offsets[i, 1]
                if 0 <= x < width and 0 <= y < height:
                    tile, place = directory[y >> SHIFT, x >> SHIFT], ((y & MASK) << SHIFT) | (x & MASK)
                    if squared[tile, place] == offsets[i, 2]:
                        squared[tile, place] = _nearest(occupancy_directory, occupancy, offsets, i, x, y)


@njit(cache=True)
def _nearest(directory: Ints, occupancy: Bytes, offsets: Ints, start: int, x: int, y: int) -> int:
    """Squared distance from a cell to the nearest occupied one; none is nearer than offset ``start``."""
    height, width = directory.shape[0] << SHIFT, directory.shape[1] << SHIFT
    first = start
    while first > 0 and offsets[first - 1, 2] == offsets[start, 2]:
        first -= 1
    for i in range(first, len(offsets)):
        ox, oy = x + offsets[i, 0], y + offsets[i, 1]
        if 0 <= ox < width and 0 <= oy < height:
            value = occupancy[directory[oy >> SHIFT, ox >> SHIFT], ((oy & MASK) << SHIFT) | (ox & MASK)]
            if value > EVEN:
                return int(offsets[i, 2])
    last = offsets[len(offsets) - 1, 2]
    farther = int(np.ceil(np.sqrt(last + 1.0)))
    return farther * farther


@njit(cache=True, inline="always")
def field_at(
    directory: Ints, squared: Bytes, metres: Floats, scale: float, x: float, y: float
) -> tuple[float, float, float]:
    """(distance m, its slope along x and y) at a place in cells, between the four cells around it.

    ``metres`` (256,) turns squared cells into m; ``scale`` is cells per m. Outside of the rectangle: far, and flat.
    """
    x, y = x - 0.5, y - 0.5
    cx, cy = int(np.floor(x)), int(np.floor(y))
    if cx < 0 or cy < 0 or cx + 1 >= directory.shape[1] << SHIFT or cy + 1 >= directory.shape[0] << SHIFT:
        return metres[255], 0.0, 0.0
    fx, fy = x - cx, y - cy
    tile = directory[cy >> SHIFT, cx >> SHIFT]
    px, py = cx & MASK, cy & MASK
    if px < MASK and py < MASK:
        place = (py << SHIFT) | px
        d00, d01 = metres[squared[tile, place]], metres[squared[tile, place + 1]]
        d10, d11 = metres[squared[tile, place + MASK + 1]], metres[squared[tile, place + MASK + 2]]
    else:
        d00 = metres[squared[tile, (py << SHIFT) | px]]
        d01 = metres[_at(directory, squared, cx + 1, cy)]
        d10 = metres[_at(directory, squared, cx, cy + 1)]
        d11 = metres[_at(directory, squared, cx + 1, cy + 1)]
    low, high = d00 + fx * (d01 - d00), d10 + fx * (d11 - d10)
    slope_x = ((1.0 - fy) * (d01 - d00) + fy * (d11 - d10)) * scale
    return low + fy * (high - low), slope_x, (high - low) * scale


@njit(cache=True)
def _at(directory: Ints, squared: Bytes, x: int, y: int) -> int:
    return int(squared[directory[y >> SHIFT, x >> SHIFT], ((y & MASK) << SHIFT) | (x & MASK)])
