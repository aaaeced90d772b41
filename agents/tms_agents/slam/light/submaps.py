"""The light of submaps, beside their geometry: for revisits, and for how sure each step of the path is."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Sequence

import numpy as np

from tms_agents.slam.geometry import Floats, between
from tms_agents.slam.keyframes import Indices
from tms_agents.slam.light.closures import placed_by_light
from tms_agents.slam.light.filtering import as_beams
from tms_agents.slam.light.layer import LightMaps
from tms_agents.slam.light.matching import linearise_light
from tms_agents.slam.light.scans import LightScan, merged
from tms_agents.slam.maps import Maps
from tms_agents.slam.settings import Settings

#: So many are kept rendered.
_KEPT = 64


class LightSubmaps:
    """Of ``scans`` (K,) along ``path`` (K, 3), divided as `slam.submaps.Submaps` are: ``first`` (S + 1,) keys and
    ``anchors`` (S,)."""

    def __init__(
        self, scans: Sequence[LightScan], path: Floats, first: Indices, anchors: Indices, settings: Settings
    ) -> None:
        self._scans, self._path, self._first, self._anchors, self._settings = scans, path, first, anchors, settings
        self._rendered: OrderedDict[int, LightMaps] = OrderedDict()

    def placed(
        self,
        number: int,
        key: int,
        around: int,
        maps: Maps,
        which: int,
        cloud: Floats,
        pose: Floats,
        hessian: Floats,
        window: float,
    ) -> tuple[Floats, Floats] | None:
        """(pose, hessian) of key scan ``key`` in submap ``number`` by geometry and light, from those of geometry; None
        if light contradicts.

        The geometry is map ``which`` of ``maps``, ``cloud`` (M, 2) the points that were matched with it; light is that
        of the scans up to ``around`` keys from ``key``.
        """
        keys = range(max(0, key - around), min(len(self._path), key + around + 1))
        beams = merged([self._scans[k] for k in keys], between(self._path[key][None], self._path[list(keys)]))
        light = self._map(number)
        return placed_by_light(
            maps, which, light, cloud, beams, pose, hessian, window, self._settings.light_temperature
        )

    def add(self, number: int, key: int, hessian: Floats) -> None:
        """What the light of key scan ``key`` tells of its pose in submap ``number`` is added to ``hessian`` (3, 3)."""
        light, s = self._map(number), self._settings
        pose = between(self._path[self._anchors[number]], self._path[key])
        linearise_light(
            light.tiles.directory[0], light.tiles.cells, light.frame, as_beams(self._scans[key].thinned(s.light_beams)),
            s.light_temperature, 0.0, pose, hessian, np.zeros(3),
        )  # fmt: skip

    def _map(self, number: int) -> LightMaps:
        """Of submap ``number``, from memory if it was asked for recently."""
        if number not in self._rendered:
            if len(self._rendered) == _KEPT:
                self._rendered.popitem(last=False)
            found = LightMaps(1, self._settings.light_m)
            anchor = self._path[self._anchors[number]]
            for key in range(self._first[number], self._first[number + 1]):
                found.integrate(between(anchor, self._path[key])[None], self._scans[key])
            self._rendered[number] = found
        self._rendered.move_to_end(number)
        return self._rendered[number]
