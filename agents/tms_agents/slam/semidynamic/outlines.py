"""Where objects stand at each scan, and which points of a scan are theirs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from tms_agents.slam.geometry import Floats
from tms_agents.slam.polishing import legs_of
from tms_agents.slam.semidynamic.models import Models
from tms_agents.slam.semidynamic.shapes import surface
from tms_agents.slam.semidynamic.solving import Stay


class Outlines:
    """Of all ``stays`` by tag, at the times ``t`` (S,) of the scans."""

    def __init__(self, t: Floats, stays: Mapping[str, Sequence[Stay]], models: Models) -> None:
        legs = legs_of(t)
        self._which = np.stack([_at_scans(found, legs) for found in stays.values()]) if stays else np.empty((0, len(t)))
        self._outlines = [[surface(models.objects[tag], one.pose) for one in found] for tag, found in stays.items()]
        self._trees = [[cKDTree(outline) for outline in found] for found in self._outlines]
        self._middles = [np.array([outline.mean(axis=0) for outline in found]) for found in self._outlines]
        self._sizes = [
            max(float(np.hypot(*(outline - outline.mean(axis=0)).T).max()) for outline in found)
            for found in self._outlines
        ]

    def own(self, n: int, points: Floats, within: float) -> NDArray[np.bool_]:
        """(N,) which of ``points`` (N, 2) of scan ``n`` are within so many m of where an object stood then."""
        found = np.zeros(len(points), dtype=np.bool_)
        for trees, middles, size, which in zip(self._trees, self._middles, self._sizes, self._which, strict=True):
            stay = which[n]
            if stay < 0:
                continue
            off = np.abs(points - middles[stay]).max(axis=1)
            near = np.flatnonzero(~found & (off < size + within))
            if len(near):
                apart, _ = trees[stay].query(points[near], distance_upper_bound=within)
                found[near[np.isfinite(apart)]] = True
        return found


def _at_scans(stays: Sequence[Stay], legs: NDArray[np.int64]) -> NDArray[np.int64]:
    """(S,) number of the stay of the same leg that is nearest in time, -1 if there is none."""
    scans = np.arange(len(legs))
    found, nearest = np.full(len(legs), -1, dtype=np.int64), np.full(len(legs), np.inf)
    for number, stay in enumerate(stays):
        seen = stay.visit.scans
        if not len(seen):
            continue
        after = np.minimum(np.searchsorted(seen, scans), len(seen) - 1)
        apart = np.minimum(np.abs(seen[after] - scans), np.abs(seen[np.maximum(after - 1, 0)] - scans))
        better = (legs == stay.visit.leg) & (apart < nearest)
        found[better], nearest[better] = number, apart[better]
    return found
