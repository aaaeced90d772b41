"""Pieces of the path with maps of their own: what a later visit is compared with."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Sequence

import numpy as np

from tms_agents.slam.branch_and_bound import LEVELS, fill_pyramids
from tms_agents.slam.geometry import Bytes, Floats, Ints, between, transform
from tms_agents.slam.keyframes import Indices, KeyScans
from tms_agents.slam.light.scans import LightScan
from tms_agents.slam.light.submaps import LightSubmaps
from tms_agents.slam.maps import Maps
from tms_agents.slam.settings import Settings
from tms_agents.slam.tiles import SIDE

#: So many submaps that follow each other are rendered side by side, and so many such groups remembered.
GROUP, _KEPT = 8, 4
#: Cells of the finest level of a search are so many times as large as those of the map.
_POOL = 2
#: Tiles on the edge of a rectangle in which nothing is known are not searched.
_BLANK = 0


class Submaps:
    """Keys ``first[s]`` up to ``first[s + 1]`` (not included) make submap s; its anchor is the key in the middle.

    Group g are submaps ``GROUP * g`` and the following, each in the frame of its anchor.
    """

    def __init__(
        self, path: Floats, keys: KeyScans, settings: Settings, lights: Sequence[LightScan] | None = None
    ) -> None:
        self.path, self.keys, self._settings = path, keys, settings
        way = keys.driven[:, 0] + settings.submap_m / settings.submap_rad * keys.driven[:, 1]
        number = ((way - way[0]) / settings.submap_m).astype(int)
        self.first = np.concatenate([np.flatnonzero(np.diff(number, prepend=-1)), [len(path)]])
        self.anchors = (self.first[:-1] + self.first[1:] - 1) // 2
        self.light = None if lights is None else LightSubmaps(lights, path, self.first, self.anchors, settings)
        self._rendered: OrderedDict[int, Maps] = OrderedDict()
        self._clouds: dict[int, Floats] = {}

    def __len__(self) -> int:
        return len(self.anchors)

    def of(self, keys: Indices) -> Indices:
        """The submaps that key scans (K,) are part of."""
        return np.searchsorted(self.first, keys, side="right") - 1

    def rendered(self, group: int) -> Maps:
        """The maps of a group, from memory if it was asked for recently."""
        if group not in self._rendered:
            if len(self._rendered) == _KEPT:
                self._rendered.popitem(last=False)
            self._rendered[group] = self._render(range(GROUP * group, min(len(self), GROUP * (group + 1))))
        self._rendered.move_to_end(group)
        return self._rendered[group]

    def _render(self, numbers: range) -> Maps:
        """Side by side."""
        s, scans = self._settings, self.keys.scans
        maps = Maps(len(numbers), s.resolution, s.reach_m)
        members = [range(self.first[number], self.first[number + 1]) for number in numbers]
        poses = [between(self.path[self.anchors[n]], self.path[list(m)]) for n, m in zip(numbers, members, strict=True)]
        maps.integrate_all(poses, [[scans[key] for key in m] for m in members], np.ascontiguousarray(self.keys.laser))
        maps.measure()
        return maps

    def cloud(self, key: int, around: int, most: int) -> Floats:
        """At most ``most`` points (M, 2) of the scans up to ``around`` keys from ``key``, in its frame, evenly
        spread."""
        if key not in self._clouds:
            self._clouds[key] = self._cloud(key, around, most)
        return self._clouds[key]

    def _cloud(self, key: int, around: int, most: int) -> Floats:
        keys = np.arange(max(0, key - around), min(len(self.path), key + around + 1))
        relative = between(self.path[key][None], self.path[keys])
        scans = self.keys.scans
        points = np.concatenate([transform(pose, scans[int(k)]) for pose, k in zip(relative, keys, strict=True)])
        cell = 0.1
        while True:
            _, chosen = np.unique((points / cell).round().astype(np.int64) @ np.array([1, 1 << 20]), return_index=True)
            if len(chosen) <= most:
                return np.ascontiguousarray(points[np.sort(chosen)])
            cell *= 1.25


def pyramids(maps: Maps, which: Ints, sigma: float) -> tuple[Bytes, Floats, float]:
    """(levels (N, LEVELS, H, W), lower left corner (2,) m, cells per m) to search maps ``which`` (N,) in; ``sigma`` m
    is the error of a beam."""
    directory = maps.distance.directory[which]
    rows, columns = (np.flatnonzero((directory != _BLANK).any(axis=axes)) for axes in ((0, 2), (0, 1)))
    bottom, left = (int(found[0]) if len(found) else 0 for found in (rows, columns))
    top, right = (int(found[-1]) + 1 if len(found) else 1 for found in (rows, columns))
    directory = np.ascontiguousarray(directory[:, bottom:top, left:right])
    scores = np.round(255 * np.exp(-0.5 * (maps.metres / sigma) ** 2)).astype(np.uint8)
    pad = 1 << (LEVELS - 1)
    height, width = (SIDE * count // _POOL + pad for count in directory.shape[1:])
    levels: Bytes = np.zeros((len(which), LEVELS, height, width), dtype=np.uint8)
    fill_pyramids(directory, maps.distance.cells, scores, _POOL, levels)
    corner = maps.frame[:2] + SIDE * maps.resolution * np.array([left, bottom])
    return levels, corner, float(maps.frame[2]) / _POOL
