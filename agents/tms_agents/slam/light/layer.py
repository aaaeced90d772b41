"""The light of surfaces in tiled maps: how much is known of each cell, and how bright it is.

A cell holds two numbers: the sum of the precisions of what was seen there, and the sum of light times precision. Their
quotient, smoothed with a Gaussian over neighbouring cells, is the light of a place; smoothing carries over the cells
beside a wall that noise of the range has filled less.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

from tms_agents.slam.geometry import Bytes, Floats, Ints
from tms_agents.slam.light.scans import LightScan
from tms_agents.slam.maps import grown
from tms_agents.slam.sharing import queue, take
from tms_agents.slam.tiles import MASK, SHIFT, SIDE, TiledMaps

Singles = NDArray[np.float32]
LAYERS = 2
_PLANE = SIDE * SIDE
#: The Gaussian: its deviation and reach in cells.
_SMOOTH, _REACH = 0.9, 2


class LightMaps:
    """N maps of light in cells of ``resolution`` m; they share tiles as `Maps` do."""

    def __init__(self, maps: int, resolution: float) -> None:
        self.resolution = resolution
        self.tiles = TiledMaps(maps, 0, 8, 8, layers=LAYERS, dtype=np.float32)
        #: x, y (m) of the lower left corner, cells per m.
        self.frame: Floats = np.array([-4 * SIDE * resolution, -4 * SIDE * resolution, 1.0 / resolution])

    def integrate(self, poses: Floats, scan: LightScan) -> None:
        """Write one scan into every map, seen from ``poses`` (N, 3)."""
        if not len(scan.points):
            return
        reach = float(np.hypot(scan.points[:, 0], scan.points[:, 1]).max())
        reach += (_REACH + 2) * self.resolution
        lowest, highest = poses[:, :2].min(axis=0) - reach, poses[:, :2].max(axis=0) + reach
        self.frame = grown([self.tiles], self.frame, self.resolution, lowest, highest)
        n, height, width = self.tiles.directory.shape
        seen: Bytes = np.zeros((n, height * width), dtype=np.uint8)
        wanted: Ints = np.empty((n, min(height * width, len(scan.points))), dtype=np.int32)
        counts: Ints = np.empty(n, dtype=np.int32)
        mark_points(width, poses, scan.points, self.frame, seen, wanted, counts)
        self.tiles.make_writable(wanted, counts)
        precision = 1.0 / np.square(scan.deviation)
        _write_points(self.tiles.directory, self.tiles.cells, poses, scan.points, scan.light, precision, self.frame)

    def resample(self, parents: Ints) -> None:
        """Map n becomes what map ``parents[n]`` was."""
        self.tiles.resample(parents)


@njit(cache=True, inline="always")
def _cell(pose: Floats, cosine: float, sine: float, x: float, y: float, frame: Floats) -> tuple[int, int]:
    return (
        math.floor((pose[0] + cosine * x - sine * y - frame[0]) * frame[2]),
        math.floor((pose[1] + sine * x + cosine * y - frame[1]) * frame[2]),
    )


@njit(cache=True, parallel=True)
def mark_points(
    width: int, poses: Floats, points: Floats, frame: Floats, seen: Bytes, wanted: Ints, counts: Ints
) -> None:
    """Numbers of the tiles in which points end, each once."""
    line = queue(len(poses))
    for begin in prange(len(poses)):
        n = take(line, begin)
        while n < len(poses):
            cosine, sine = math.cos(poses[n, 2]), math.sin(poses[n, 2])
            count = 0
            for m in range(len(points)):
                x, y = _cell(poses[n], cosine, sine, points[m, 0], points[m, 1], frame)
                place = (y >> SHIFT) * width + (x >> SHIFT)
                if seen[n, place] == 0:
                    seen[n, place] = 1
                    wanted[n, count] = place
                    count += 1
            counts[n] = count
            n = take(line, n)


@njit(cache=True, parallel=True)
def _write_points(
    directory: Ints, cells: Singles, poses: Floats, points: Floats, light: Floats, precision: Floats, frame: Floats
) -> None:
    line = queue(len(poses))
    for begin in prange(len(poses)):
        n = take(line, begin)
        while n < len(poses):
            cosine, sine = math.cos(poses[n, 2]), math.sin(poses[n, 2])
            for m in range(len(points)):
                x, y = _cell(poses[n], cosine, sine, points[m, 0], points[m, 1], frame)
                tile, place = directory[n, y >> SHIFT, x >> SHIFT], ((y & MASK) << SHIFT) | (x & MASK)
                cells[tile, place] += precision[m]
                cells[tile, _PLANE + place] += precision[m] * light[m]
            n = take(line, n)


@njit(cache=True)
def light_at(directory: Ints, cells: Singles, x: float, y: float, found: Floats) -> float:
    """Precision of the light at a place in cells; ``found`` (3,) gets the light and its slopes per cell.

    0 where nothing is known near by.
    """
    cx, cy = math.floor(x), math.floor(y)
    height, width = directory.shape[0] << SHIFT, directory.shape[1] << SHIFT
    if cx < _REACH or cy < _REACH or cx >= width - _REACH or cy >= height - _REACH:
        return 0.0
    known, known_x, known_y, sum_, sum_x, sum_y = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    narrow = 1.0 / (_SMOOTH * _SMOOTH)
    for j in range(cy - _REACH, cy + _REACH + 1):
        dy = j + 0.5 - y
        for i in range(cx - _REACH, cx + _REACH + 1):
            tile, place = directory[j >> SHIFT, i >> SHIFT], ((j & MASK) << SHIFT) | (i & MASK)
            precision = cells[tile, place]
            if precision == 0.0:
                continue
            dx = i + 0.5 - x
            weight = math.exp(-0.5 * narrow * (dx * dx + dy * dy))
            a, b = weight * precision, weight * cells[tile, _PLANE + place]
            known += a
            known_x += a * dx * narrow
            known_y += a * dy * narrow
            sum_ += b
            sum_x += b * dx * narrow
            sum_y += b * dy * narrow
    if known > 0.0:
        found[0] = sum_ / known
        found[1] = (sum_x - found[0] * known_x) / known
        found[2] = (sum_y - found[0] * known_y) / known
    return known
