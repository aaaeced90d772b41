"""Particles where nothing is known of the place: over the whole map, those that fit the scan."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tms_agents.slam.filter import thinned
from tms_agents.slam.fit import MEAN, Fit
from tms_agents.slam.geometry import Floats
from tms_agents.slam.known import KnownMap
from tms_agents.slam.localisation_settings import LocalisationSettings
from tms_agents.slam.sampling import drawn_until_enough, everywhere
from tms_agents.slam.weights import normalised

#: A pose that was tried stands for the places around it (m, m, rad).
_AROUND = np.array([0.1, 0.1, 0.06])


class Anywhere:
    """Searches ``known`` with scans of a laser at ``laser`` (2,) on the robot; all draws are from ``random``."""

    def __init__(
        self, known: KnownMap, settings: LocalisationSettings, laser: Floats, random: np.random.Generator
    ) -> None:
        self.known, self.laser = known, laser
        self.fit = Fit(known, settings.coarse_m)
        self._settings, self._random = settings, random

    def particles(self, points: Floats, effort: float) -> tuple[Floats, Floats]:
        """Particles over all of the map, those drawn from many more that fit the scan; log weights in which all that
        were tried had 1 together before the scan. ``effort`` 0..1 is the share of the work."""
        s = self._settings
        poses, costs = self.tried(points, effort)
        weights = normalised(-s.witnesses * costs)
        evidence = np.log(np.mean(np.exp(-s.witnesses * costs)))
        parents = self.enough(poses, weights, int(effort * s.particles))
        return self._near(poses[parents], costs[parents], points, evidence)

    def tried(self, points: Floats, effort: float) -> tuple[Floats, Floats]:
        """Poses over all of the map and their costs."""
        s, known = self._settings, self.known
        tries = int(effort * np.clip(s.tries_per_m2 * known.free_m2, s.particles, s.most_tries))
        poses = everywhere(known, tries, self._random)
        return poses, self.fit(poses, thinned(points, s.few_beams), self.laser, through=False)[:, MEAN]

    def _near(self, poses: Floats, costs: Floats, points: Floats, evidence: float) -> tuple[Floats, Floats]:
        """Each stands for the places around it: moved within them to a better fit."""
        s, n = self._settings, len(poses)
        moved = poses + _AROUND * self._random.standard_normal((n, 3))
        weights = self.weighed(moved, points) + s.witnesses * costs + evidence - np.log(n)
        return moved, weights

    def weighed(self, poses: Floats, points: Floats) -> Floats:
        """Log weights (N,) of ``poses`` (N, 3) by one scan."""
        s = self._settings
        fits = self.fit(poses, thinned(points, s.beams), self.laser, through=s.through)
        return -s.witnesses * fits[:, MEAN]

    def enough(self, poses: Floats, weights: Floats, most: int) -> NDArray[np.int64]:
        """Parents of the next particles, ``most`` of them at most."""
        s = self._settings
        return drawn_until_enough(
            poses, weights, least=s.least, most=max(s.least, most), error=s.error, bins=s.bins, random=self._random
        )
