"""The way again with none but the newest scans as map: an older part of the map, wrongly joined, lures nobody there.

A particle that comes back to a known corridor some metres off may fit into its old map better than into the new one:
it jumps, or slips from scan to scan along walls that look alike, and loops closed over such a path stay torn. What the
last metres alone say is right from step to step; what it lacks, loop closing adds.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from tms_agents.slam.filter import thinned
from tms_agents.slam.geometry import Floats, between, compose
from tms_agents.slam.keyframes import KeyScans
from tms_agents.slam.light.filtering import ParticleLight
from tms_agents.slam.light.scans import LightScan
from tms_agents.slam.maps import Maps
from tms_agents.slam.matching import TOTAL, match_all
from tms_agents.slam.motion import turned
from tms_agents.slam.settings import Settings

#: The map is of the last so much way (m; turns count as for submaps), and of twice as much before it begins anew.
_RECENT_M = 40.0
#: A scan is matched from where odometry and from where the path that is known already lead.
_STARTS = 2


def recent_path(path: Floats, keys: KeyScans, settings: Settings, lights: Sequence[LightScan] | None = None) -> Floats:
    """(K, 3) of the robot at the key scans: each matched with the newest ones before it, with odometry as prior, from
    odometry and from the step of ``path`` (K, 3); what fits better counts."""
    way = keys.driven[:, 0] + settings.submap_m / settings.submap_rad * keys.driven[:, 1]
    motions, steps = between(keys.odometry[:-1], keys.odometry[1:]), between(path[:-1], path[1:])
    noise = settings.noise.covariance(motions, np.diff(keys.driven, axis=0))
    newest, begun = _Newest(keys, settings, lights), 0
    found = path.copy()
    newest.add(0, found[0])
    for k in range(1, len(path)):
        if way[k] - way[begun] > 2 * _RECENT_M:
            begun = min(int(np.searchsorted(way, way[k] - _RECENT_M)), k - 1)
            newest = _Newest(keys, settings, lights)
            newest.begin(range(begun, k), found)
        found[k] = newest.matched(k, found[k - 1], np.stack([motions[k - 1], steps[k - 1]]), noise[k - 1])
        newest.add(k, found[k])
    return found


class _Newest:
    """The map of some scans, once for each start, as they are matched side by side."""

    def __init__(self, keys: KeyScans, settings: Settings, lights: Sequence[LightScan] | None) -> None:
        self._keys, self._settings, self._lights = keys, settings, lights
        self._laser = np.ascontiguousarray(keys.laser)
        self._maps = Maps(_STARTS, settings.resolution, settings.reach_m)
        self._light = None if lights is None else ParticleLight(replace(settings, particles=_STARTS))

    def begin(self, numbers: range, path: Floats) -> None:
        """With key scans ``numbers`` along ``path`` (K, 3)."""
        poses, scans = path[numbers.start : numbers.stop], self._keys.scans[numbers.start : numbers.stop]
        self._maps.integrate_all([poses] * _STARTS, [scans] * _STARTS, self._laser)
        self._maps.measure()
        for k in numbers:
            self._add_light(k, path[k])

    def add(self, k: int, pose: Floats) -> None:
        """Key scan ``k``, seen from ``pose`` (3,)."""
        self._maps.integrate(np.tile(pose, (_STARTS, 1)), self._keys.scans[k], self._laser)
        self._add_light(k, pose)

    def _add_light(self, k: int, pose: Floats) -> None:
        if self._light is not None and self._lights is not None:
            self._light.integrate(np.tile(pose, (_STARTS, 1)), self._lights[k])

    def matched(self, k: int, before: Floats, motions: Floats, noise: Floats) -> Floats:
        """Where key scan ``k`` fits best: from ``before`` (3,) on by ``motions`` (2, 3), the first of which is that of
        the odometry, whose covariance is ``noise`` (3, 3)."""
        s, maps = self._settings, self._maps
        starts = compose(np.tile(before, (_STARTS, 1)), motions)
        priors = np.tile(starts[0], (_STARTS, 1))
        precision: Floats = np.linalg.inv(turned(noise, np.tile(before[2], _STARTS))).astype(np.float64)
        points = thinned(self._keys.scans[k], s.beams)
        poses, hessians, results = np.empty((_STARTS, 3)), np.empty((_STARTS, 3, 3)), np.empty((_STARTS, 3))
        match_all(
            maps.distance.directory, maps.distance.cells, maps.metres, maps.frame, points, starts, priors, precision,
            s.sigma_m, s.temperature, s.poor_share, maps.occupancy.directory, maps.occupancy.cells,
            poses, hessians, results,
        )  # fmt: skip
        if self._light is not None and self._lights is not None:
            self._light.refine(maps, points, self._lights[k], priors, precision, poses, hessians, results)
        best: Floats = poses[int(np.argmin(results[:, TOTAL]))]
        return best
