"""The Rao-Blackwellised particle filter: every particle has a path and a map of its own."""

from __future__ import annotations

import numpy as np

from tms_agents.slam.ancestry import Ancestry
from tms_agents.slam.geometry import Floats, between, compose
from tms_agents.slam.kld import enough
from tms_agents.slam.light.filtering import ParticleLight
from tms_agents.slam.light.scans import LightScan
from tms_agents.slam.maps import Maps
from tms_agents.slam.matching import SHARE, TOTAL, match_all
from tms_agents.slam.motion import turned
from tms_agents.slam.settings import Settings
from tms_agents.slam.weights import effective_number, low_variance, normalised


class ParticleFilter:
    """Feed it scans with odometry, in order; ask for the path and the map of the best particle.

    Deterministic by ``settings.seed``: all random numbers are drawn before the particles are worked on side by side.
    With ``light`` (then every scan has to come with it) matches are of geometry and light.
    """

    def __init__(self, settings: Settings, laser: Floats, *, light: bool = False) -> None:
        self.settings = settings
        n = settings.particles
        self.poses: Floats = np.zeros((n, 3))
        self.log_weights: Floats = np.zeros(n)
        self.maps = Maps(n, settings.resolution, settings.reach_m)
        self.light = ParticleLight(settings) if light else None
        self.ancestry = Ancestry(n)
        self.effective = float(n)
        self.resamplings = 0
        self.match_share = np.ones(n)
        self._laser = np.ascontiguousarray(laser[:2])
        self._random = np.random.default_rng(settings.seed)
        self._odometry: Floats | None = None
        self._driven: Floats = np.zeros(2)

    @property
    def best(self) -> int:
        """The particle of the largest weight."""
        return int(np.argmax(self.log_weights))

    def path(self) -> Floats:
        """(processed scans, 3) of the best particle."""
        return self.ancestry.path(self.best)

    def process(self, odometry: Floats, driven: Floats, points: Floats, light: LightScan | None = None) -> None:
        """One scan: ``odometry`` (3,), ``driven`` (2,) as in `Log`, ``points`` (M, 2) m seen from the robot."""
        if self._odometry is not None:
            motion = between(self._odometry, odometry)
            self._predict_and_match(
                motion, self.settings.noise.covariance(motion, driven - self._driven), points, light
            )
            self._resample()
        self._odometry, self._driven = odometry, driven
        self.ancestry.append(self.poses)
        self.maps.integrate(self.poses, points, self._laser)
        if self.light is not None and light is not None:
            self.light.integrate(self.poses, light)

    def _predict_and_match(self, motion: Floats, noise: Floats, points: Floats, light: LightScan | None) -> None:
        s, n = self.settings, len(self.poses)
        normals = self._random.standard_normal((2, n, 3))
        covariance = turned(noise, self.poses[:, 2])
        priors = compose(self.poses, np.broadcast_to(motion, (n, 3)))
        starts = priors + np.einsum("nij,nj->ni", np.linalg.cholesky(covariance), normals[0])
        precision: Floats = np.linalg.inv(covariance).astype(np.float64)
        chosen = thinned(points, s.beams)
        poses, hessians, results = np.empty((n, 3)), np.empty((n, 3, 3)), np.empty((n, 3))
        field = self.maps.distance
        match_all(
            field.directory, field.cells, self.maps.metres, self.maps.frame, chosen, starts, priors, precision,
            s.sigma_m, s.temperature, s.poor_share, self.maps.occupancy.directory, self.maps.occupancy.cells,
            poses, hessians, results,
        )  # fmt: skip
        if self.light is not None and light is not None:
            self.light.refine(self.maps, chosen, light, priors, precision, poses, hessians, results)
        # Drawn from the Gaussian around the match; the weight is the evidence of that Gaussian (Laplace).
        self.poses = poses + s.spread * drawn(hessians, normals[1])
        self.log_weights += s.temperature / s.weight_temperature * (-results[:, TOTAL]) + 0.5 * (
            np.linalg.slogdet(precision)[1] - np.linalg.slogdet(hessians)[1]
        )
        self.match_share = results[:, SHARE]

    def _resample(self) -> None:
        weights = normalised(self.log_weights)
        self.effective = effective_number(weights)
        uniform = float(self._random.random())
        s, count = self.settings, len(weights)
        if s.least_particles:
            count = enough(self.poses, min(s.least_particles, s.particles), s.particles)
        # Fewer than half are enough, or twice as many are wanted: then the number changes, too.
        if self.effective >= s.resample_below * len(weights) and len(weights) < 2 * count < 4 * len(weights):
            return
        parents = low_variance(weights, count, uniform)
        self.poses = self.poses[parents]
        self.log_weights = np.zeros(len(parents))
        self.maps.resample(parents)
        if self.light is not None:
            self.light.resample(parents)
        self.ancestry.resample(parents)
        self.resamplings += 1


def thinned(points: Floats, most: int) -> Floats:
    """At most ``most`` of the points (M, 2), evenly chosen."""
    if len(points) <= most:
        return points
    return np.ascontiguousarray(points[np.linspace(0, len(points) - 1, most).round().astype(int)])


def drawn(hessians: Floats, normals: Floats) -> Floats:
    """Deviations (N, 3) from Gaussians with the inverse covariances ``hessians`` (N, 3, 3)."""
    upper = np.linalg.cholesky(hessians).swapaxes(1, 2)
    deviations: Floats = np.linalg.solve(upper, normals[..., None])[..., 0]
    return deviations
