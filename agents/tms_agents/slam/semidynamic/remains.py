"""What is left in a map of things that have gone and that nobody knows by name.

A thing whose tag is never read is nobody's, but it is rigid, too: it is there, or it is not. So where beams of a later
time went through more of one connected outline than still met it, the rest has gone as well, though no beam ever passes
there again: it lies inside of what stands there now, or behind it. What goes on in line with what is still met is a
wall, hidden or not, and no part of an outline.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy.ndimage import binary_dilation, convolve, label, maximum_filter
from scipy.spatial import cKDTree

from tms_agents.slam.geometry import Floats, transform
from tms_agents.slam.gridmap import GridMap
from tms_agents.slam.keyframes import Indices
from tms_agents.slam.logs import Log
from tms_agents.slam.occupancy import EVEN
from tms_agents.slam.polishing import legs_of

#: Of another time is what was driven so much later (m), away and back, or after the robot was parked.
_LATER_M, _PARKED_M = 18.0, 1e6
#: A surface was met so often; so many scans say that it is not there any more, and went on beyond it by so much (m).
_MET, _SCANS, _BEYOND_M = 3, 4, 0.06
#: Gaps of twice so many cells are none; an outline is no less than so many, and has gone if so large a share has.
_GAP, _OUTLINE, _SHARE = 2, 8, 0.3
_AROUND = np.ones((3, 3), dtype=np.bool_)
#: A wall goes on if within so much (m, rad) so much of it (m) lies in one line.
_ALONG_M, _TURN, _WALL_M = 1.2, np.radians(1.5), 0.65
#: No thing is larger (m); what was met within so much driving (m) is one view of it.
_THING_M, _LATELY_M = 1.5, 100.0

Mask = NDArray[np.bool_]


def remains(grid: GridMap, log: Log, poses: Floats, scans: Indices, points: Sequence[Floats]) -> Mask:
    """(H, W) cells of ``grid`` that are of things that have gone, from ``points`` (M, 2) of ``scans``, seen from the
    robot at ``poses`` (S, 3), that are of no known thing."""
    clock = log.driven[:, 0] + _PARKED_M * legs_of(log.t)
    ends = _Ends.of(grid, poses[scans], points, clock[scans])
    met, last = ends.met(), ends.last()
    rows, columns = np.nonzero(met)
    cells = np.array(grid.origin) + (np.stack([columns, rows], axis=-1) + 0.5) * grid.resolution
    through, since = np.zeros(met.shape, dtype=np.int64), np.full(met.shape, np.inf)
    through[met], since[met] = _looked_through(
        cells, last[met] + _LATER_M, poses[scans], clock[scans], log.laser, log.ranges[scans], log.angles,
        log.range_max, grid.resolution,
    )  # fmt: skip
    gone = through >= _SCANS
    found = np.zeros_like(gone)
    leg = np.where(met, last, 0.0) // _PARKED_M
    for number in np.unique(leg[gone]):
        seen_then = gone & (leg == number)
        outlines, count = label(_closed(seen_then), _AROUND)
        for piece in range(1, count + 1):
            one = seen_then & (outlines == piece)
            if one.sum() >= _OUTLINE:
                found |= _whole(one, gone, ends, float(np.median(last[one])), float(np.median(since[one])))
    return found & (grid.cells > EVEN)


def _whole(one: Mask, gone: Mask, ends: _Ends, then: float, since: float) -> Mask:
    """Cells of the outline, as it was ``then``, of which ``one`` part is ``gone`` ``since``."""
    rows, columns = np.nonzero(one)
    margin = int(_THING_M / ends.resolution)
    part = np.s_[
        max(rows.min() - margin, 0) : rows.max() + margin, max(columns.min() - margin, 0) : columns.max() + margin
    ]
    outline = ends.between(then - _LATELY_M, min(then + _LATELY_M, since))[part] | one[part]
    still = ends.between(since, np.inf)[part] & ~gone[part]
    outline &= ~_goes_on(outline, outline & still, ends.resolution)
    whole = _connected(one[part], outline)
    away, here = (whole & gone[part]).sum(), (whole & still).sum()
    found = np.zeros_like(one)
    if away > here and away >= _SHARE * whole.sum():
        found[part] = whole & ~still
    return found


@dataclass(frozen=True, slots=True, eq=False)
class _Ends:
    """Cells (N,) of a grid of ``shape``, numbered, in which beams ended, and when: ``clock`` (N,), not falling."""

    cells: NDArray[np.int64]
    clock: Floats
    shape: tuple[int, int]
    resolution: float

    @classmethod
    def of(cls, grid: GridMap, poses: Floats, points: Sequence[Floats], clock: Floats) -> _Ends:
        cells = []
        for pose, some in zip(poses, points, strict=True):
            at = np.floor((transform(pose, some) - np.array(grid.origin)) / grid.resolution).astype(np.int64)
            at = at[((at >= 0) & (at < np.array(grid.cells.shape[::-1]))).all(axis=1)]
            cells.append(at[:, 1] * grid.cells.shape[1] + at[:, 0])
        clocks = np.repeat(clock, [len(some) for some in cells])
        return cls(np.concatenate(cells), clocks, grid.cells.shape, grid.resolution)

    def met(self) -> Mask:
        """Where some ended, and enough near it."""
        counts = np.bincount(self.cells, minlength=self.shape[0] * self.shape[1]).reshape(self.shape)
        found: Mask = (counts > 0) & (convolve(counts, np.ones((3, 3), dtype=np.int64), mode="constant") >= _MET)
        return found

    def last(self) -> Floats:
        """When one ended in or beside a cell for the last time."""
        last = np.full(self.shape, -np.inf)
        last.reshape(-1)[self.cells] = self.clock
        found: Floats = maximum_filter(last, 3)
        return found

    def between(self, begin: float, end: float) -> Mask:
        first, last = np.searchsorted(self.clock, (begin, end))
        found = np.zeros(self.shape, dtype=np.bool_)
        found.reshape(-1)[self.cells[first:last]] = True
        return found


def _connected(one: Mask, cells: Mask) -> Mask:
    pieces, _ = label(_closed(cells), _AROUND)
    found: Mask = cells & np.isin(pieces, np.unique(pieces[one & cells]))
    return found


def _closed(cells: Mask) -> Mask:
    """Without small gaps."""
    found: Mask = binary_dilation(cells, _AROUND, iterations=_GAP)
    return found


def _goes_on(cells: Mask, standing: Mask, resolution: float) -> Mask:
    """Which of ``cells`` (H, W) lie in line with a wall of what is still ``standing`` (H, W)."""
    at, others = np.argwhere(cells), np.argwhere(standing)
    found = np.zeros_like(cells)
    if not len(others):
        return found
    for row, near in zip(at, cKDTree(others).query_ball_point(at, _ALONG_M / resolution), strict=True):
        off = others[near] - row
        reach = np.hypot(*off.T)
        off, reach = off[reach > 5], reach[reach > 5]
        if not len(off):
            continue
        bins = (np.arctan2(off[:, 0], off[:, 1]) / _TURN).astype(np.int64)
        cover = np.zeros((bins.max() - bins.min() + 2, int(_ALONG_M / resolution) + 1), dtype=np.bool_)
        cover[bins - bins.min(), reach.astype(np.int64)] = True
        found[tuple(row)] = (cover[1:] | cover[:-1]).sum(axis=1).max() >= _WALL_M / resolution
    return found


@njit(cache=True)
def _looked_through(
    cells: Floats,
    after: Floats,
    poses: Floats,
    clock: Floats,
    laser: Floats,
    ranges: Floats,
    angles: Floats,
    range_max: float,
    size: float,
) -> tuple[NDArray[np.int64], Floats]:
    """How many scans saw through ``cells`` ((N, 2) m, side ``size``) later than ``after`` (N,), and since when."""
    through, since = np.zeros(len(cells), dtype=np.int64), np.full(len(cells), np.inf)
    if len(angles) < 2:
        return through, since
    step = angles[1] - angles[0]
    for s in range(len(poses)):
        c, d = np.cos(poses[s, 2]), np.sin(poses[s, 2])
        x0, y0 = poses[s, 0] + c * laser[0] - d * laser[1], poses[s, 1] + d * laser[0] + c * laser[1]
        for n in range(len(cells)):
            x, y = cells[n, 0] - x0, cells[n, 1] - y0
            distance = x * x + y * y
            if clock[s] <= after[n] or distance >= range_max * range_max:
                continue
            distance = np.sqrt(distance)
            turn = np.sign(step) * (np.arctan2(y, x) - poses[s, 2] - laser[2] - angles[0])
            turn -= 2 * np.pi * np.floor(turn / (2 * np.pi))
            beam = int(np.round(turn / abs(step)))
            if beam >= len(angles) or abs(turn - beam * abs(step)) * distance > 0.5 * size:
                continue
            if distance + _BEYOND_M < ranges[s, beam] < range_max:
                through[n] += 1
                since[n] = min(since[n], clock[s])
    return through, since
