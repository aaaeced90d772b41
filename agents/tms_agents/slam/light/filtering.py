"""Light in the particle filter: every particle has a map of light beside that of surfaces."""

from __future__ import annotations

import numpy as np

from tms_agents.slam.geometry import Floats, Ints
from tms_agents.slam.light.layer import LightMaps
from tms_agents.slam.light.matching import match_light_all
from tms_agents.slam.light.scans import LightScan
from tms_agents.slam.maps import Maps
from tms_agents.slam.settings import Settings


class ParticleLight:
    """The maps of light of all particles, and matches refined with them; ``scans`` are those in the maps."""

    def __init__(self, settings: Settings) -> None:
        self._settings = settings
        self.scans: list[LightScan] = []
        self.maps = LightMaps(settings.particles, settings.light_m)

    def refine(
        self,
        maps: Maps,
        points: Floats,
        scan: LightScan,
        priors: Floats,
        precision: Floats,
        poses: Floats,
        hessians: Floats,
        results: Floats,
    ) -> None:
        """What geometry found (``poses``, ``hessians``, ``results`` of `matching.match_all`) becomes what geometry and
        light find together."""
        s, tiles = self._settings, self.maps.tiles
        beams = as_beams(scan.thinned(s.light_beams))
        match_light_all(
            maps.distance.directory, maps.distance.cells, maps.metres, maps.frame, points, maps.occupancy.directory,
            maps.occupancy.cells, tiles.directory, tiles.cells, self.maps.frame, beams, priors, precision, s.sigma_m,
            s.temperature, s.light_temperature, poses, hessians, results,
        )  # fmt: skip

    def integrate(self, poses: Floats, scan: LightScan) -> None:
        """One scan into every map."""
        self.maps.integrate(poses, scan)
        self.scans.append(scan)

    def resample(self, parents: Ints) -> None:
        """Particle n goes on from where particle ``parents[n]`` was."""
        self.maps.resample(parents)


def as_beams(scan: LightScan) -> Floats:
    """(M, 6) for the kernels: x, y, the tangent's x, y, light, deviation."""
    return np.column_stack([scan.points, scan.tangents, scan.light, scan.deviation])
