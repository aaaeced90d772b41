"""The particle filter of the paper: blind draws, nearest points, all resampled after every scan.

From the paper on SLAM with the received light intensity of a SOKUIKI sensor, section 3: poses are drawn from the
odometry with a two-dimensional Gaussian (equation 2: way and turn); a particle's likelihood is exp(-d^2 / 2 sigma^2) of
the mean squared distance d to the nearest points of its map plus alpha times the squared difference of their light
(equations 3 and 4). Every particle has a map of scan points of its own, a cell of which keeps the first point that fell
there. The paper does not say whether its light is corrected; here it is, by the same calibration as elsewhere: as
received it follows the robot rather than the place, and this filter is then as far off as without light.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numba import njit, prange

from tms_agents.slam.ancestry import Ancestry
from tms_agents.slam.geometry import Bytes, Floats, Ints, between, compose
from tms_agents.slam.light.layer import Singles, mark_points
from tms_agents.slam.maps import grown
from tms_agents.slam.motion import OdometryNoise
from tms_agents.slam.tiles import MASK, SHIFT, SIDE, TiledMaps
from tms_agents.slam.weights import effective_number, low_variance, normalised

_PLANE = SIDE * SIDE


@dataclass(frozen=True, slots=True)
class PaperSettings:
    """``alpha`` m^2 for a difference of light as large as that of a usual surface; ``sigma`` m^2 of the mean squared
    distance; a point farther than ``reach_m`` from all of the map has no corresponding one."""

    particles: int = 512
    seed: int = 0
    alpha: float = 0.05
    sigma: float = 3e-4
    cell_m: float = 0.05
    reach_m: float = 0.3
    beams: int = 180


class PaperFilter:
    """Feed it scans in order; light is in that of a usual surface, so that distance and angle are out of it."""

    def __init__(self, settings: PaperSettings, noise: OdometryNoise) -> None:
        self.settings, self.noise = settings, noise
        n = settings.particles
        self.poses: Floats = np.zeros((n, 3))
        self.likelihoods: Floats = np.zeros(n)  # logarithms, of all scans until now
        self.effective = float(n)
        self.points = TiledMaps(n, np.nan, 8, 8, layers=3, dtype=np.float32)
        corner = -4 * SIDE * settings.cell_m
        self.frame: Floats = np.array([corner, corner, 1.0 / settings.cell_m])
        self.ancestry = Ancestry(n)
        self._random = np.random.default_rng(settings.seed)
        self._last: tuple[Floats, Floats] | None = None

    def path(self) -> Floats:
        """(scans, 3) of the particle with the largest likelihood of all scans together."""
        return self.ancestry.path(int(np.argmax(self.likelihoods)))

    def process(self, odometry: Floats, driven: Floats, points: Floats, light: Floats) -> None:
        """One scan: ``odometry`` (3,), ``driven`` (2,) as in `Log`, ``points`` (M, 2) with their ``light`` (M,)."""
        if self._last is not None:
            self._predict(between(self._last[0], odometry), driven - self._last[1])
            self._weigh_and_resample(points, light)
        self._last = (odometry, driven)
        self.ancestry.append(self.poses)
        self._add(points, light)

    def _predict(self, motion: Floats, driven: Floats) -> None:
        covariance = self.noise.covariance(motion, driven)
        wrong = self._random.standard_normal((len(self.poses), 2)) * np.sqrt(np.diag(covariance)[[0, 2]])
        moved = np.broadcast_to(motion, self.poses.shape).copy()
        heading = math.atan2(motion[1], motion[0]) if np.hypot(motion[0], motion[1]) > 1e-6 else 0.0
        moved[:, 0] += wrong[:, 0] * math.cos(heading)
        moved[:, 1] += wrong[:, 0] * math.sin(heading)
        moved[:, 2] += wrong[:, 1]
        self.poses = compose(self.poses, moved)

    def _weigh_and_resample(self, points: Floats, light: Floats) -> None:
        s = self.settings
        chosen = np.linspace(0, len(points) - 1, min(s.beams, len(points))).round().astype(int)
        distances = np.empty(len(self.poses))
        _mean_distances(
            self.points.directory, self.points.cells, self.frame, self.poses, points[chosen], light[chosen], s.alpha,
            s.reach_m, distances,
        )  # fmt: skip
        logs = -0.5 * np.square(distances / s.sigma)
        weights = normalised(logs)
        self.effective = effective_number(weights)
        parents = low_variance(weights, len(weights), float(self._random.random()))
        self.poses = self.poses[parents]
        self.likelihoods = (self.likelihoods + logs)[parents]
        self.points.resample(parents)
        self.ancestry.resample(parents)

    def _add(self, points: Floats, light: Floats) -> None:
        reach = float(np.hypot(points[:, 0], points[:, 1]).max(initial=0.0)) + self.settings.reach_m
        self.frame = grown(
            [self.points], self.frame, self.settings.cell_m,
            self.poses[:, :2].min(axis=0) - reach, self.poses[:, :2].max(axis=0) + reach,
        )  # fmt: skip
        n, height, width = self.points.directory.shape
        seen: Bytes = np.zeros((n, height * width), dtype=np.uint8)
        wanted: Ints = np.empty((n, min(height * width, max(1, len(points)))), dtype=np.int32)
        counts: Ints = np.empty(n, dtype=np.int32)
        mark_points(width, self.poses, points, self.frame, seen, wanted, counts)
        self.points.make_writable(wanted, counts)
        _add_points(self.points.directory, self.points.cells, self.frame, self.poses, points, light)


@njit(cache=True, parallel=True)
def _add_points(directory: Ints, cells: Singles, frame: Floats, poses: Floats, points: Floats, light: Floats) -> None:
    for n in prange(len(poses)):
        cosine, sine = math.cos(poses[n, 2]), math.sin(poses[n, 2])
        for m in range(len(points)):
            x = poses[n, 0] + cosine * points[m, 0] - sine * points[m, 1]
            y = poses[n, 1] + sine * points[m, 0] + cosine * points[m, 1]
            i, j = math.floor((x - frame[0]) * frame[2]), math.floor((y - frame[1]) * frame[2])
            tile, place = directory[n, j >> SHIFT, i >> SHIFT], ((j & MASK) << SHIFT) | (i & MASK)
            if math.isnan(cells[tile, place]):
                cells[tile, place], cells[tile, _PLANE + place], cells[tile, 2 * _PLANE + place] = x, y, light[m]


@njit(cache=True, parallel=True)
def _mean_distances(
    directory: Ints,
    cells: Singles,
    frame: Floats,
    poses: Floats,
    points: Floats,
    light: Floats,
    alpha: float,
    reach: float,
    distances: Floats,
) -> None:
    """Equation 4 for each particle; the squared reach where no point has a corresponding one."""
    for n in prange(len(poses)):
        cosine, sine = math.cos(poses[n, 2]), math.sin(poses[n, 2])
        total, count = 0.0, 0
        for m in range(len(points)):
            x = poses[n, 0] + cosine * points[m, 0] - sine * points[m, 1]
            y = poses[n, 1] + sine * points[m, 0] + cosine * points[m, 1]
            squared, other = _nearest(directory[n], cells, frame, x, y, reach)
            if squared < reach * reach:
                total += squared + alpha * (other - light[m]) ** 2
                count += 1
        distances[n] = total / count if count > 0 else reach * reach


@njit(cache=True)
def _nearest(directory: Ints, cells: Singles, frame: Floats, x: float, y: float, reach: float) -> tuple[float, float]:
    """(squared distance m^2 to the nearest point, its light), ring by ring around the cell of (x, y)."""
    height, width = directory.shape[0] << SHIFT, directory.shape[1] << SHIFT
    cx, cy = math.floor((x - frame[0]) * frame[2]), math.floor((y - frame[1]) * frame[2])
    best, light = reach * reach, 0.0
    for ring in range(math.ceil(reach * frame[2]) + 1):
        nearest = max(0, ring - 1) / frame[2]
        if best <= nearest * nearest:
            break
        for j in range(cy - ring, cy + ring + 1):
            step = 1 if abs(j - cy) == ring else max(1, 2 * ring)
            for i in range(cx - ring, cx + ring + 1, step):
                if not (0 <= i < width and 0 <= j < height):
                    continue
                tile, place = directory[j >> SHIFT, i >> SHIFT], ((j & MASK) << SHIFT) | (i & MASK)
                dx, dy = cells[tile, place] - x, cells[tile, _PLANE + place] - y
                squared = dx * dx + dy * dy
                if squared < best:  # never for an empty cell, which holds NaN
                    best, light = squared, float(cells[tile, 2 * _PLANE + place])
    return best, light
