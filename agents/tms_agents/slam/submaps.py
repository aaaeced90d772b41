"""Pieces of the path with maps of their own: what a later visit is compared with."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from tms_agents.slam.branch_and_bound import pyramid
from tms_agents.slam.geometry import Bytes, Floats, between, transform
from tms_agents.slam.gridmap import render
from tms_agents.slam.light.scans import LightScan
from tms_agents.slam.light.submaps import LightSubmaps
from tms_agents.slam.maps import Maps
from tms_agents.slam.settings import Settings

Kept = TypeVar("Kept")

#: So many submaps are kept rendered; pyramids are larger.
_KEPT, _KEPT_PYRAMIDS = 64, 12
#: Cells of the finest level of a search are twice as large as those of the map.
_POOL = 2


@dataclass(frozen=True, slots=True, eq=False)
class Submap:
    """In the frame of the key scan ``anchor``: ``maps`` holds one map; ``sigma`` m is the error of a beam."""

    anchor: int
    maps: Maps
    sigma: float

    def levels(self) -> Bytes:
        """The pyramid to search in, from ``origin`` on in cells of 1 / ``scale`` m."""
        near = self.maps.metres[self.maps.distance.dense(0)]
        scores = np.round(255 * np.exp(-0.5 * (near / self.sigma) ** 2)).astype(np.uint8)
        height, width = scores.shape
        return pyramid(scores.reshape(height // _POOL, _POOL, width // _POOL, _POOL).max(axis=(1, 3)))

    @property
    def origin(self) -> Floats:
        """(2,) m."""
        return self.maps.frame[:2]

    @property
    def scale(self) -> float:
        """Cells of the search per m."""
        return float(self.maps.frame[2]) / _POOL


class Submaps:
    """Keys ``first[s]`` up to ``first[s + 1]`` (not included) make submap s; its anchor is the key in the middle."""

    def __init__(
        self,
        path: Floats,
        driven: Floats,
        scans: Sequence[Floats],
        laser: Floats,
        settings: Settings,
        lights: Sequence[LightScan] | None = None,
    ) -> None:
        self.path, self._scans, self._laser, self._settings = path, scans, laser, settings
        way = driven[:, 0] + settings.submap_m / settings.submap_rad * driven[:, 1]
        number = ((way - way[0]) / settings.submap_m).astype(int)
        self.first = np.concatenate([np.flatnonzero(np.diff(number, prepend=-1)), [len(path)]])
        self.anchors = (self.first[:-1] + self.first[1:] - 1) // 2
        self.light = None if lights is None else LightSubmaps(lights, path, self.first, self.anchors, settings)
        self._rendered: OrderedDict[int, Submap] = OrderedDict()
        self._pyramids: OrderedDict[int, Bytes] = OrderedDict()

    def __len__(self) -> int:
        return len(self.anchors)

    def of(self, key: int) -> int:
        """The submap that a key scan is part of."""
        return int(np.searchsorted(self.first, key, side="right")) - 1

    def rendered(self, number: int) -> Submap:
        """Submap ``number``, from memory if it was asked for recently."""
        return _kept(self._rendered, number, self._render, _KEPT)

    def levels(self, number: int) -> Bytes:
        """The pyramid of submap ``number``, from memory if it was asked for recently."""
        return _kept(self._pyramids, number, lambda one: self.rendered(one).levels(), _KEPT_PYRAMIDS)

    def _render(self, number: int) -> Submap:
        keys = np.arange(self.first[number], self.first[number + 1])
        anchor = int(self.anchors[number])
        relative = between(self.path[anchor][None], self.path[keys])
        s = self._settings
        maps = render(relative, [self._scans[k] for k in keys], self._laser, s.resolution, s.reach_m)
        return Submap(anchor, maps, s.sigma_m)

    def cloud(self, key: int, around: int, most: int) -> Floats:
        """At most ``most`` points (M, 2) of the scans up to ``around`` keys from ``key``, in its frame, evenly
        spread."""
        keys = np.arange(max(0, key - around), min(len(self.path), key + around + 1))
        relative = between(self.path[key][None], self.path[keys])
        points = np.concatenate([transform(pose, self._scans[int(k)]) for pose, k in zip(relative, keys, strict=True)])
        cell = 0.1
        while True:
            _, chosen = np.unique((points / cell).round().astype(np.int64) @ np.array([1, 1 << 20]), return_index=True)
            if len(chosen) <= most:
                return np.ascontiguousarray(points[np.sort(chosen)])
            cell *= 1.25


def _kept(memory: OrderedDict[int, Kept], number: int, make: Callable[[int], Kept], most: int) -> Kept:
    """What ``memory`` holds of ``number``, made if it is not there; at most so many are remembered."""
    if number not in memory:
        memory[number] = make(number)
        if len(memory) > most:
            memory.popitem(last=False)
    memory.move_to_end(number)
    return memory[number]
