"""Rays into tiled occupancy maps: which tiles a scan touches, then what it says of their cells.

A cell is a byte: 0 unknown, else 64 + log-odds in tenths, clamped. A scan changes a cell once: a hit counts more than
the beams that pass there, so a wall seen at a grazing angle is not worn away. Beams without a return say nothing.
"""

from __future__ import annotations

import numpy as np
from numba import njit, prange

from tms_agents.slam.geometry import Bytes, Floats, Ints
from tms_agents.slam.sharing import queue, take
from tms_agents.slam.tiles import MASK, SHIFT, SIDE

UNKNOWN, EVEN = 0, 64
HIT, MISS, LOWEST, HIGHEST = 9, 4, EVEN - 20, EVEN + 35
_TOUCHED = 0x80
_FIXED = 16


def probability(cells: Bytes) -> Floats:
    """That a cell is occupied, from its bytes; NaN where unknown."""
    odds = (cells.astype(np.float64) - EVEN) / 10.0
    return np.where(cells == UNKNOWN, np.nan, 1.0 / (1.0 + np.exp(-odds)))


@njit(cache=True, parallel=True)
def mark_rays(
    width: int,
    first: Ints,
    poses: Floats,
    which: Ints,
    points: Floats,
    lengths: Ints,
    laser: Floats,
    frame: Floats,
    seen: Bytes,
    wanted: Ints,
    counts: Ints,
) -> None:
    """Numbers of the tiles that rays from ``laser`` (2,) to points pass, into ``wanted`` (N, L) and ``counts`` (N,).

    Map n gets scans ``first[n]`` up to ``first[n + 1]`` (not included): scan k are the first ``lengths[p]`` of
    ``points`` (P, M, 2), p being ``which[k]``, seen from ``poses[k]`` (K, 3). ``frame`` is (x, y of the lower left
    corner in m, cells per m). ``seen`` (N, H * W) is scratch of zeros and is zeros again afterwards; ``width`` is W in
    tiles.
    """
    line = queue(len(counts))
    for begin in prange(len(counts)):
        n = take(line, begin)
        while n < len(counts):
            count = 0
            for k in range(first[n], first[n + 1]):
                mine = points[which[k], : lengths[which[k]]]
                count = _mark(width, poses[k], mine, laser, frame, seen[n], wanted[n], count)
            for k in range(count):
                seen[n, wanted[n, k]] = 0
            counts[n] = count
            n = take(line, n)


@njit(cache=True, parallel=True)
def write_rays(
    directory: Ints,
    cells: Bytes,
    first: Ints,
    poses: Floats,
    which: Ints,
    points: Floats,
    lengths: Ints,
    laser: Floats,
    frame: Floats,
    capacity: int,
    changed: Ints,
    counts: Ints,
) -> None:
    """Hits and misses of scans, as in `mark_rays`, into the maps (N, H, W), whose tiles along the rays are theirs
    alone.

    ``changed`` (N, L) gets the cells (y * width in cells + x) that became occupied by the last scan of each map, and as
    -1 - cell those that ceased to be. No scan touches more than ``capacity`` cells.
    """
    line = queue(len(counts))
    for begin in prange(len(counts)):
        n = take(line, begin)
        while n < len(counts):
            counts[n] = 0
            for k in range(first[n], first[n + 1]):
                mine = points[which[k], : lengths[which[k]]]
                counts[n] = _write(directory[n], cells, poses[k], mine, laser, frame, capacity, changed[n])
            n = take(line, n)


@njit(cache=True, parallel=True)
def list_occupied(directory: Ints, cells: Bytes, found: Ints, counts: Ints) -> None:
    """Occupied cells (y * width in cells + x) of the maps (N, H, W), as many as there is room for in ``found`` (N, L);
    ``counts`` (N,) is how many there are."""
    width = directory.shape[2] << SHIFT
    line = queue(len(counts))
    for begin in prange(len(counts)):
        n = take(line, begin)
        while n < len(counts):
            count, tiles = 0, directory[n].ravel()
            for t in np.flatnonzero(tiles):
                left, bottom = (t % directory.shape[2]) << SHIFT, (t // directory.shape[2]) << SHIFT
                for place in range(SIDE * SIDE):
                    if cells[tiles[t], place] > EVEN:
                        if count < found.shape[1]:
                            found[n, count] = (bottom + (place >> SHIFT)) * width + left + (place & MASK)
                        count += 1
            counts[n] = count
            n = take(line, n)


@njit(cache=True)
def _ray(pose: Floats, point: Floats, laser: Floats, frame: Floats) -> tuple[int, int, int, int]:
    """Cells (x, y) of both ends."""
    cosine, sine = np.cos(pose[2]), np.sin(pose[2])
    x0 = pose[0] + cosine * laser[0] - sine * laser[1] - frame[0]
    y0 = pose[1] + sine * laser[0] + cosine * laser[1] - frame[1]
    x1 = pose[0] + cosine * point[0] - sine * point[1] - frame[0]
    y1 = pose[1] + sine * point[0] + cosine * point[1] - frame[1]
    scale = frame[2]
    return (
        int(np.floor(x0 * scale)),
        int(np.floor(y0 * scale)),
        int(np.floor(x1 * scale)),
        int(np.floor(y1 * scale)),
    )


@njit(cache=True)
def _line(x0: int, y0: int, x1: int, y1: int) -> tuple[bool, int, int, int, int, int]:
    """(steep, steps, first along the longer axis, sign, first across, slope), across in 1 / 2^16 of a cell."""
    steep = abs(y1 - y0) > abs(x1 - x0)
    if steep:
        x0, y0, x1, y1 = y0, x0, y1, x1
    steps = abs(x1 - x0)
    sign = 1 if x1 >= x0 else -1
    across = (y0 << _FIXED) + (1 << (_FIXED - 1))
    slope = ((y1 - y0) << _FIXED) // steps if steps > 0 else 0
    return steep, steps, x0, sign, across, slope


@njit(cache=True)
def _mark(
    width: int, pose: Floats, points: Floats, laser: Floats, frame: Floats, seen: Bytes, wanted: Ints, count: int
) -> int:
    """Tile by tile along the longer axis: across, the cells rise or fall steadily, so the ends of each part tell all.
    ``count`` are wanted already."""
    for m in range(len(points)):
        x0, y0, x1, y1 = _ray(pose, points[m], laser, frame)
        steep, steps, along, sign, across, slope = _line(x0, y0, x1, y1)
        k = 0
        while k < steps:
            a = along + sign * k
            inside = (MASK - (a & MASK)) if sign > 0 else (a & MASK)
            last = min(k + inside, steps - 1)
            low = (across + k * slope) >> (_FIXED + SHIFT)
            high = (across + last * slope) >> (_FIXED + SHIFT)
            if low > high:
                low, high = high, low
            for b in range(low, high + 1):
                place = (a >> SHIFT) * width + b if steep else b * width + (a >> SHIFT)
                if seen[place] == 0:
                    seen[place] = 1
                    wanted[count] = place
                    count += 1
            k = last + 1
        place = (y1 >> SHIFT) * width + (x1 >> SHIFT)
        if seen[place] == 0:
            seen[place] = 1
            wanted[count] = place
            count += 1
    return count


@njit(cache=True)
def _write(
    directory: Ints,
    cells: Bytes,
    pose: Floats,
    points: Floats,
    laser: Floats,
    frame: Floats,
    capacity: int,
    changed: Ints,
) -> int:
    width = directory.shape[1] << SHIFT
    touched = np.empty(capacity, dtype=np.int32)
    n_touched, n_changed = 0, 0
    for m in range(len(points)):
        _, _, x, y = _ray(pose, points[m], laser, frame)
        tile, place = directory[y >> SHIFT, x >> SHIFT], ((y & MASK) << SHIFT) | (x & MASK)
        value = cells[tile, place]
        if value & _TOUCHED:
            continue
        raised = min((EVEN if value == UNKNOWN else int(value)) + HIT, HIGHEST)
        cells[tile, place] = raised | _TOUCHED
        touched[n_touched] = (tile << (2 * SHIFT)) | place
        n_touched += 1
        if value <= EVEN < raised:
            changed[n_changed] = y * width + x
            n_changed += 1
    for m in range(len(points)):
        x0, y0, x1, y1 = _ray(pose, points[m], laser, frame)
        steep, steps, along, sign, across, slope = _line(x0, y0, x1, y1)
        tile, tile_x, tile_y = 0, -1, -1
        for k in range(steps):
            x, y = along + sign * k, (across + k * slope) >> _FIXED
            if steep:
                x, y = y, x
            if (x >> SHIFT) != tile_x or (y >> SHIFT) != tile_y:
                tile_x, tile_y = x >> SHIFT, y >> SHIFT
                tile = directory[tile_y, tile_x]
            place = ((y & MASK) << SHIFT) | (x & MASK)
            value = cells[tile, place]
            if value & _TOUCHED:
                continue
            lowered = max((EVEN if value == UNKNOWN else int(value)) - MISS, LOWEST)
            if lowered <= EVEN < value:
                if n_changed == len(changed):
                    continue
                changed[n_changed] = -1 - (y * width + x)
                n_changed += 1
            cells[tile, place] = lowered | _TOUCHED
            touched[n_touched] = (tile << (2 * SHIFT)) | place
            n_touched += 1
    for k in range(n_touched):
        cells[touched[k] >> (2 * SHIFT), touched[k] & ((1 << (2 * SHIFT)) - 1)] &= 0x7F
    return n_changed
