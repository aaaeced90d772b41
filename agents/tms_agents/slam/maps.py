"""Occupancy maps and their distance fields, one of each per particle (or per submap), in one growing rectangle."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from tms_agents.slam.distance import LARGEST_RADIUS, disc, mark_discs, update_distances
from tms_agents.slam.geometry import Bytes, Floats, Ints
from tms_agents.slam.occupancy import UNKNOWN, list_occupied, mark_rays, write_rays
from tms_agents.slam.tiles import SIDE, TiledMaps

#: Change so many cells per beam at most become free in one scan; the others wait for the next one.
_CHANGES_PER_BEAM = 8
_MARGIN_TILES = 4


class Maps:
    """N maps of ``resolution`` m; ``reach`` m is how far their distance fields reach (rounded to cells, 15 at most)."""

    def __init__(self, maps: int, resolution: float, reach: float) -> None:
        self.resolution = resolution
        self.radius = int(np.clip(round(reach / resolution), 2, LARGEST_RADIUS))
        self.occupancy = TiledMaps(maps, UNKNOWN, 8, 8)
        self.distance = TiledMaps(maps, self.radius**2, 8, 8)
        #: x, y (m) of the lower left corner, cells per m.
        self.frame: Floats = np.array([-4 * SIDE * resolution, -4 * SIDE * resolution, 1.0 / resolution])
        #: Distance in m of each squared distance in cells.
        self.metres: Floats = np.minimum(np.sqrt(np.arange(256.0)), self.radius) * resolution
        self._offsets = disc(self.radius)

    def integrate(self, poses: Floats, points: Floats, laser: Floats) -> None:
        """Write one scan into every map: ``points`` (M, 2) where beams from ``laser`` (2,) ended, seen from ``poses``
        (N, 3)."""
        first, which = np.arange(len(poses) + 1, dtype=np.int32), np.zeros(len(poses), dtype=np.int32)
        lengths: Ints = np.array([len(points)], dtype=np.int32)
        self._change_distances(*self._write(first, poses, which, points[None], lengths, laser))

    def integrate_all(self, poses: Sequence[Floats], scans: Sequence[Sequence[Floats]], laser: Floats) -> None:
        """Write scans of its own into each map n: ``scans[n]`` of (M, 2) points seen from ``poses[n]`` (K, 3), in their
        order. Distances are not kept up until `measure`."""
        first: Ints = np.cumsum([0, *map(len, scans)], dtype=np.int32)
        points, lengths = padded([points for mine in scans for points in mine])
        which: Ints = np.arange(len(points), dtype=np.int32)
        self._write(first, np.concatenate(poses), which, points, lengths, laser)

    def measure(self) -> None:
        """All distances anew: cheaper once, after many scans, than after each."""
        n, height, width = self.occupancy.directory.shape
        occupied, counts = np.empty((n, 0), dtype=np.int32), np.empty(n, dtype=np.int32)
        list_occupied(self.occupancy.directory, self.occupancy.cells, occupied, counts)
        occupied = np.empty((n, int(counts.max())), dtype=np.int32)
        list_occupied(self.occupancy.directory, self.occupancy.cells, occupied, counts)
        self.distance.clear()
        seen: Bytes = np.zeros((n, height * width), dtype=np.uint8)
        self._change_distances(occupied, counts, seen, np.empty(seen.shape, dtype=np.int32))

    def _write(
        self, first: Ints, poses: Floats, which: Ints, points: Floats, lengths: Ints, laser: Floats
    ) -> tuple[Ints, Ints, Bytes, Ints]:
        """Occupancy alone, as in `write_rays`: the cells that changed by the last scans, how many, and scratch."""
        reach = float(np.hypot(points[..., 0], points[..., 1]).max(initial=0.0)) + float(np.hypot(*laser))
        self._include(poses[:, :2].min(axis=0) - reach, poses[:, :2].max(axis=0) + reach)
        occupancy, (n, height, width) = self.occupancy, self.occupancy.directory.shape
        across = 2 * int(reach / (SIDE * self.resolution)) + 5
        most = min(height * width, int(np.diff(first).max()) * across * across)
        seen: Bytes = np.zeros((n, height * width), dtype=np.uint8)
        wanted: Ints = np.empty((n, most), dtype=np.int32)
        counts: Ints = np.empty(n, dtype=np.int32)
        mark_rays(width, first, poses, which, points, lengths, laser, self.frame, seen, wanted, counts)
        occupancy.make_writable(wanted, counts)
        changed: Ints = np.empty((n, _CHANGES_PER_BEAM * max(1, points.shape[1])), dtype=np.int32)
        beams = np.hypot(points[..., 0] - laser[0], points[..., 1] - laser[1])
        capacity = int((beams * self.frame[2] + 4).sum(axis=1).max(initial=0.0))
        write_rays(
            occupancy.directory, occupancy.cells, first, poses, which, points, lengths, laser, self.frame, capacity,
            changed, counts,
        )  # fmt: skip
        return changed, counts, seen, wanted

    def _change_distances(self, changed: Ints, changes: Ints, seen: Bytes, wanted: Ints) -> None:
        """After cells ``changed[n, :changes[n]]`` (see `write_rays`); ``seen`` is zeros, ``wanted`` has room."""
        occupancy, distance = self.occupancy, self.distance
        counts, (_, height, width) = np.empty(len(changes), dtype=np.int32), distance.directory.shape
        mark_discs(height, width, self.radius, changed, changes, seen, wanted, counts)
        distance.make_writable(wanted, counts)
        update_distances(
            distance.directory, distance.cells, occupancy.directory, occupancy.cells, self._offsets, changed, changes
        )

    def resample(self, parents: Ints) -> None:
        """Map n becomes what map ``parents[n]`` was."""
        self.occupancy.resample(parents)
        self.distance.resample(parents)

    def _include(self, lowest: Floats, highest: Floats) -> None:
        """The rectangle grows, with a margin, until both corners (m) and the reach of their fields are inside."""
        edge = (self.radius + 1) * self.resolution
        self.frame = grown([self.occupancy, self.distance], self.frame, self.resolution, lowest - edge, highest + edge)


def grown(tiles: Sequence[TiledMaps], frame: Floats, resolution: float, lowest: Floats, highest: Floats) -> Floats:
    """``frame`` after all ``tiles``, which share it, have grown with a margin until both corners (m) are inside."""
    span = SIDE * resolution
    height, width = tiles[0].directory.shape[1:]
    if (
        frame[0] <= lowest[0] and (highest[0] - frame[0]) / span <= width
        and frame[1] <= lowest[1] and (highest[1] - frame[1]) / span <= height
    ):  # fmt: skip
        return frame
    below = np.ceil((frame[:2] - lowest) / span).astype(int)
    above = np.ceil((highest - frame[:2]) / span).astype(int) - np.array([width, height])
    left, bottom = (int(b) + _MARGIN_TILES if b > 0 else 0 for b in below)
    right, top = (int(a) + _MARGIN_TILES if a > 0 else 0 for a in above)
    for each in tiles:
        each.extend(bottom, left, top, right)
    moved: Floats = frame - np.array([left * span, bottom * span, 0.0])
    return moved


def padded(scans: Sequence[Floats]) -> tuple[Floats, Ints]:
    """(points (P, M, 2), their numbers (P,)) of P scans of different lengths; what is past the end is 0."""
    lengths: Ints = np.array([len(points) for points in scans], dtype=np.int32)
    found = np.zeros((len(scans), int(lengths.max(initial=0)), 2))
    for one, points in zip(found, scans, strict=True):
        one[: len(points)] = points
    return found, lengths
