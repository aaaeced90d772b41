"""What beams say of a place: how often one ended there, and how often one went through (Khronos: present, absent, or
hidden, which is no evidence)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt, maximum_filter, uniform_filter

from tms_agents.slam.geometry import Floats
from tms_agents.slam.logs import Log

Counts = NDArray[np.int32]
#: Side of a cell (m); a beam says nothing of the last so many m before its end.
CELL_M, _BLUR_M = 0.025, 0.06
#: A surface is seen well within so many m, and so many beams are enough to say so.
_SHARP_M, _ENOUGH = 0.03, 4.0
#: What a point of an outline is worth (log-odds): seen, seen through, seen where there is always something.
_SEEN, _THROUGH, _ALWAYS = 0.6, -1.2, 0.3
_INSIDE = -0.5
#: Cells where so small a share of the beams ended that did in one near them have none.
_STRAYS = 0.2


@dataclass(frozen=True, slots=True, eq=False)
class Place:
    """A square (H, W) cells with its lower left ``corner`` (2,) m."""

    corner: Floats
    height: int
    width: int

    @classmethod
    def around(cls, points: Floats, margin_m: float) -> Place:
        low = points[:, :2].min(axis=0) - margin_m
        size = np.ceil((points[:, :2].max(axis=0) + margin_m - low) / CELL_M).astype(int)
        return cls(low, int(size[1]), int(size[0]))

    def distance(self, points: Floats) -> Floats:
        """m (N,) of points (N, 2) from it, 0 inside."""
        size = np.array([self.width, self.height]) * CELL_M
        outside = np.maximum(np.maximum(self.corner - points, points - self.corner - size), 0.0)
        found: Floats = np.hypot(outside[:, 0], outside[:, 1])
        return found


@dataclass(frozen=True, slots=True, eq=False)
class Beams:
    """``hits`` and ``passes`` (H, W): beams that ended in a cell, that went on beyond it; ``course`` (H, W, 2): sum of
    the directions of those that ended there, ``ends`` (H, W, 2) of where they did (cells from the corner)."""

    hits: Counts
    passes: Counts
    course: Floats
    ends: Floats


@dataclass(frozen=True, slots=True, eq=False)
class Worth:
    """Log-odds (H, W) of a point of an outline in a cell: ``seen`` if it faces ``towards`` (H, W, 2), the unit vector
    to where beams that ended near came from, ``through`` in any case; ``inside`` of a point inside. ``always`` is what
    is seen where something was at other times, too: an object that did not move, or a wall; ``wall`` is where that is
    or nearly. ``surface`` (H, W, 2) is where beams ended around a cell on the average (m from the corner; NaN: none
    did), which is finer than cells are."""

    seen: Floats
    always: Floats
    towards: Floats
    through: Floats
    inside: Floats
    wall: NDArray[np.bool_]
    surface: Floats


def count_beams(place: Place, log: Log, poses: Floats, scans: NDArray[np.int64]) -> Beams:
    """Of ``scans`` (indices) of ``log`` at ``poses`` (S, 3)."""
    hits = np.zeros((place.height, place.width), dtype=np.int32)
    passes = np.zeros_like(hits)
    course, ends = np.zeros((*hits.shape, 2)), np.zeros((*hits.shape, 2))
    count(
        poses, log.laser, log.ranges, log.angles, log.range_max, scans, place.corner, CELL_M, _BLUR_M,
        hits, passes, course, ends,
    )  # fmt: skip
    return Beams(hits, passes, course, ends)


def worth(now: Beams, other: Beams) -> Worth:
    """What cells say about an object; ``now``: beams while it stood there, ``other``: at all other times."""
    now = _without_strays(now)
    near = maximum_filter(now.hits, 3)
    share = near / np.maximum(near + now.passes, 1)
    known = np.minimum((near + now.passes) / _ENOUGH, 1.0)
    away, nearest = distance_transform_edt(now.hits == 0, return_indices=True)
    sharp = np.exp(-0.5 * (away * CELL_M / _SHARP_M) ** 2)
    towards = -now.course[nearest[0], nearest[1]]
    towards /= np.maximum(np.linalg.norm(towards, axis=-1, keepdims=True), 1e-9)
    always = _always(other)[nearest[0], nearest[1]]
    seen = known * sharp * np.clip(2 * share, 0, 1)
    through = known * _THROUGH * np.clip(1 - 2.5 * share, 0, 1) * (1 - sharp)
    inside = _INSIDE * np.minimum(now.passes / _ENOUGH, 1.0) * np.clip(1 - 2 * share, 0, 1)
    wall = maximum_filter(always * sharp, 5) > 0.2
    return Worth(
        _SEEN * (1 - always) * seen,
        _ALWAYS * always * seen,
        towards,
        through,
        inside,
        wall,
        _surface(now)[nearest[0], nearest[1]],
    )


def _without_strays(beams: Beams) -> Beams:
    """Without the few that ended short of where most of those did that met the same surface, or past it: of hundreds on
    a wall some end where the face of a thing before it would be."""
    kept = beams.hits >= _STRAYS * maximum_filter(beams.hits, 5)
    return Beams(beams.hits * kept, beams.passes, beams.course * kept[..., None], beams.ends * kept[..., None])


def _always(other: Beams) -> Floats:
    """How far a cell was occupied at the other times (H, W), 0 where nobody looked."""
    near = maximum_filter(other.hits, 3).astype(np.float64)
    passes = uniform_filter(other.passes.astype(np.float64), 3)
    found: Floats = np.clip(near / _ENOUGH, 0, 1) * np.clip(1.5 * near / np.maximum(near + passes, 1) - 0.25, 0, 1)
    return found


def _surface(beams: Beams) -> Floats:
    """Of nine cells."""
    number = uniform_filter(beams.hits.astype(np.float64), 3)
    sums = np.stack([uniform_filter(beams.ends[..., axis], 3) for axis in (0, 1)], axis=-1)
    with np.errstate(divide="ignore", invalid="ignore"):
        found: Floats = np.where(number[..., None] > 0.1, CELL_M * sums / number[..., None], np.nan)
    return found


@njit(cache=True)
def count(
    poses: Floats,
    laser: Floats,
    ranges: Floats,
    angles: Floats,
    range_max: float,
    scans: NDArray[np.int64],
    corner: Floats,
    cell: float,
    blur: float,
    hits: Counts,
    passes: Counts,
    course: Floats,
    ends: Floats,
) -> None:
    """Follow every beam through the cells of the square."""
    height, width = hits.shape
    for k in range(scans.shape[0]):
        s = scans[k]
        c, d = np.cos(poses[s, 2]), np.sin(poses[s, 2])
        x0 = (poses[s, 0] + c * laser[0] - d * laser[1] - corner[0]) / cell
        y0 = (poses[s, 1] + d * laser[0] + c * laser[1] - corner[1]) / cell
        for b in range(angles.shape[0]):
            r = ranges[s, b]
            if r <= 0.0 or r >= range_max:
                continue
            angle = poses[s, 2] + laser[2] + angles[b]
            dx, dy = np.cos(angle), np.sin(angle)
            x_end, y_end = x0 + dx * r / cell, y0 + dy * r / cell
            x, y = int(np.floor(x_end)), int(np.floor(y_end))
            if 0 <= x < width and 0 <= y < height:
                hits[y, x] += 1
                ends[y, x, 0] += x_end
                ends[y, x, 1] += y_end
                course[y, x, 0] += dx
                course[y, x, 1] += dy
            # The part of the beam inside the square, in cells from the laser.
            near, far = 0.0, (r - blur) / cell
            for origin, slope, size in ((x0, dx, width), (y0, dy, height)):
                if abs(slope) < 1e-9:
                    if origin < 0 or origin >= size:
                        far = -1.0
                    continue
                a, e = -origin / slope, (size - 1e-6 - origin) / slope
                near, far = max(near, min(a, e)), min(far, max(a, e))
            n = int(far - near)
            for i in range(n):
                x, y = int(x0 + dx * (near + i + 0.5)), int(y0 + dy * (near + i + 0.5))
                if 0 <= x < width and 0 <= y < height:
                    passes[y, x] += 1
