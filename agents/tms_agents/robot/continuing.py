"""The map of an earlier drive goes on: where this drive lies in it, and both in one.

The robot stood parked meanwhile, so where it was is where it is; by so much as that is off, this drive's walls are
moved onto the earlier map's. What is seen anew counts; what is not, stays as it was, but for things that were found
elsewhere: they leave nothing behind.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy import ndimage
from scipy.spatial import cKDTree

from tms_agents.slam.geometry import Floats, compose, transform
from tms_agents.slam.gridmap import GridMap

#: A distance that counts half (m), the farthest that counts, and how many points of walls are compared.
_SIGMA_M, _FARTHEST_M, _POINTS = 0.03, 0.3, 600
#: Rounds of the search: steps (m, rad), so many to each side.
_ROUNDS = ((0.08, 0.03, 3), (0.03, 0.01, 3), (0.01, 0.004, 3), (0.004, 0.0015, 3))
#: Cells so near to an object's outline (m) are the object's.
_OWN_M = 0.06
_OCCUPIED = 0.65


@dataclass(frozen=True, slots=True, eq=False)
class Before:
    """The earlier map: ``occupancy`` (H, W), NaN unknown, row 0 lowest, its lower left corner at ``origin`` (m);
    ``outlines`` (M, 2) m of the objects in it by tag; ``pose`` (3,) of the robot when this drive began, about."""

    occupancy: Floats
    origin: tuple[float, float]
    resolution: float
    outlines: Mapping[str, Floats]
    pose: Floats


def aligned(before: Before, wall: Floats) -> Floats:
    """Pose (3,) of this drive's first scan in the earlier map; ``wall`` (M, 2) m as this drive saw it from there."""
    known = _places(before, np.nan_to_num(before.occupancy) > _OCCUPIED)
    if before.outlines and len(known):
        apart, _ = cKDTree(np.concatenate(list(before.outlines.values()))).query(known)
        known = known[apart > 2 * _OWN_M]
    if not len(known) or not len(wall):
        return before.pose
    tree = cKDTree(known)
    points = wall[:: max(1, len(wall) // _POINTS)]
    best = before.pose
    for step_m, step_rad, sides in _ROUNDS:
        offsets = np.arange(-sides, sides + 1)
        tried = np.stack(np.meshgrid(offsets, offsets, offsets), axis=-1).reshape(-1, 3) * (step_m, step_m, step_rad)
        candidates = best + tried
        costs = np.array([_cost(tree, transform(one, points)) for one in candidates])
        # Of those that fit as well the one that is nearest to where the robot was said to be.
        best = candidates[int(np.argmin(costs + 1e-6 * np.abs(tried).sum(axis=1)))]
    return compose(best, np.zeros(3))


def _cost(tree: cKDTree, points: Floats) -> float:
    apart, _ = tree.query(points, distance_upper_bound=_FARTHEST_M)
    return float(np.log1p(np.square(np.minimum(apart, _FARTHEST_M) / _SIGMA_M)).mean())


def merged(before: Before, grid: GridMap, found: Mapping[str, Floats]) -> tuple[Floats, tuple[float, float]]:
    """Occupancy and origin of both; ``grid`` is in the earlier map's frame, ``found`` are outlines of the objects that
    this drive saw, by tag."""
    old = before.occupancy.copy()
    for tag in before.outlines.keys() & found.keys():
        _erase(before, old, before.outlines[tag])
    size = before.resolution
    shift = np.round((np.array(grid.origin) - np.array(before.origin)) / size).astype(int)
    low = np.minimum(shift, 0)
    high = np.maximum(shift + grid.cells.shape[::-1], old.shape[::-1])
    whole = np.full(tuple((high - low)[::-1]), np.nan)
    whole[-low[1] : old.shape[0] - low[1], -low[0] : old.shape[1] - low[0]] = old
    x, y = shift - low
    new = grid.probabilities()
    part = whole[y : y + new.shape[0], x : x + new.shape[1]]
    part[np.isfinite(new)] = new[np.isfinite(new)]
    return whole, (float(before.origin[0] + low[0] * size), float(before.origin[1] + low[1] * size))


def _erase(before: Before, cells: Floats, outline: Floats) -> None:
    """Nothing is known of where an object stood."""
    at = np.floor((outline - np.array(before.origin)) / before.resolution).astype(int)
    at = at[((at >= 0) & (at < np.array(cells.shape[::-1]))).all(axis=1)]
    marks = np.zeros(cells.shape, dtype=np.bool_)
    marks[at[:, 1], at[:, 0]] = True
    if marks.any():
        near = ndimage.distance_transform_edt(~marks) * before.resolution <= _OWN_M
        cells[near & (cells > _OCCUPIED)] = np.nan


def _places(before: Before, cells: np.ndarray[tuple[int, ...], np.dtype[np.bool_]]) -> Floats:
    rows, columns = np.nonzero(cells)
    places: Floats = np.array(before.origin) + (np.stack([columns, rows], axis=-1) + 0.5) * before.resolution
    return places
