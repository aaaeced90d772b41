"""Whether a laser sees anything of the region at all; if not, its pose or the region is wrong.

It may be drawn at the other side of the building or in another frame, or the laser may look at the wall behind it.
Everything works then and nothing is ever told, which nobody would understand.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from tms_agents.devices.scans import Array, Sweep
from tms_agents.floor.scan.masks import inside
from tms_agents.floor.settings import Polygon, Pose

#: The region is looked at in so many places, about, and in no more along a side of what it spans.
_PLACES, _ALONG = 400, 100


class Outlook:
    """Of one laser that stands at ``pose``: the places of the region that each of its beams may pass."""

    def __init__(self, region: Polygon, pose: Pose) -> None:
        x, y = (_places(np.asarray(region, np.float64)) - pose[:2]).T
        self._away, self._towards = np.hypot(x, y), np.arctan2(y, x) - pose[2]
        self._sweep: Sweep | None = None
        self._beams: NDArray[np.intp] = np.empty(0, np.intp)
        self._needed: Array = np.empty(0)
        self.sees = False

    def look(self, sweep: Sweep, ranges: Array) -> None:
        """A scan; beams that end nowhere count as far as the laser reaches."""
        if self.sees:
            return
        if sweep is not self._sweep:
            self._aim(sweep)
        with np.errstate(invalid="ignore"):  # of an error nothing is known
            self.sees = bool(np.any(ranges[self._beams] >= self._needed))

    def _aim(self, sweep: Sweep) -> None:
        """Which beam would pass which place within the reach."""
        self._sweep = sweep
        order = np.argsort(sweep.angles)
        beams = sweep.angles[order]
        step = float(np.median(np.diff(beams))) if beams.size > 1 else 2 * math.pi
        # The angles of a laser that sees all round may begin anywhere: count each place from its first beam.
        towards = beams[0] - step + np.mod(self._towards - beams[0] + step, 2 * math.pi)
        after = np.clip(np.searchsorted(beams, towards), 1, max(beams.size - 1, 1))
        after = np.minimum(after, beams.size - 1)
        before = np.maximum(after - 1, 0)
        nearest = np.where(np.abs(beams[after] - towards) < np.abs(beams[before] - towards), after, before)
        met = (np.abs(beams[nearest] - towards) <= step) & (self._away <= sweep.range_max_m)
        self._beams, self._needed = order[nearest[met]], self._away[met]


def _places(region: Array) -> Array:
    """(n, 2) m, evenly over the region; only its middle where it is too narrow for that."""
    low, high = region.min(axis=0), region.max(axis=0)
    x, y = region.T
    area = abs(float(x @ np.roll(y, -1) - y @ np.roll(x, -1))) / 2
    step = max(math.sqrt(area / _PLACES), float((high - low).max()) / _ALONG)
    grid = [
        (x, y) for x in np.arange(low[0] + step / 2, high[0], step) for y in np.arange(low[1] + step / 2, high[1], step)
    ]
    found = [place for place in grid if inside(region, *place)]
    return np.array(found or [region.mean(axis=0)])
