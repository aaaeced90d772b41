"""The paper's particle filter of one tag that was detected (section 2.2): D the pose of the tag, X that of the robot.

Every particle is a pose of the tag and a deviation of the robot from its path. It is predicted by P(D_t|D_t-1) and
P(X_t|X_t-1), weighed by P(I|D) P(L|D) P(L|X), and residually resampled, at every detection.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from tms_agents.slam.geometry import Floats, between, compose, wrapped
from tms_agents.slam.semidynamic.antenna import detection
from tms_agents.slam.semidynamic.models import Antenna, ObjectModel
from tms_agents.slam.semidynamic.paper.grid import RewrittenGrid
from tms_agents.slam.semidynamic.paper.likelihoods import Outline, outline_fits, scan_fits
from tms_agents.slam.semidynamic.paper.resampling import residual
from tms_agents.slam.weights import effective_number, normalised

PoseOf = Literal["heaviest", "mean"]
#: A tag is read somewhat farther, and farther to the side, than the data sheet of the antenna says.
_FARTHER, _WIDER = 1.2, 1.3
#: Beams of a scan by which a particle's robot is weighed.
_BEAMS = 40


@dataclass(frozen=True, slots=True)
class PaperSettings:
    """``pose_of``: the heaviest particle of the set with the largest N_eff, or the mean of the particles once they have
    converged (the paper tells both). A tag ``drifts`` (m, rad) per detection, and a ``share`` of the particles is drawn
    anew; the robot deviates from its path (m, rad per detection). Particles have converged within (m, rad)."""

    particles: int = 1000
    pose_of: PoseOf = "mean"
    drifts: tuple[float, float] = (0.02, 0.05)
    share: float = 0.05
    deviates: tuple[float, float] = (0.005, 0.003)
    converged: tuple[float, float] = (0.08, 0.2)


class TagFilter:
    """Of the first detection on; ``update`` with every one that follows."""

    def __init__(self, model: ObjectModel, settings: PaperSettings, random: np.random.Generator) -> None:
        self.settings = settings
        self.outline = Outline.of(model)
        self.tags: Floats = np.zeros((0, 3))
        self.deviations: Floats = np.zeros((settings.particles, 3))
        self.weights: Floats = np.full(settings.particles, 1 / settings.particles)
        self.effective = 0.0
        #: Pose of the tag (3,), once the particles have converged.
        self.pose: Floats | None = None
        self._largest = 0.0
        self._random = random

    def update(
        self, antenna: Antenna, seen_from: Floats, robot: Floats, laser: Floats, beams: Floats, grid: RewrittenGrid
    ) -> None:
        """One detection from the antenna's pose ``seen_from`` (3,); ``beams`` (B, 2) rad and m of a scan of the
        ``laser`` (3,) on the robot at ``robot`` (3,)."""
        self._predict(antenna, seen_from)
        robots = compose(np.broadcast_to(robot, self.deviations.shape), self.deviations)
        lasers = compose(robots, np.broadcast_to(laser, robots.shape))
        detected = detection(antenna, between(np.broadcast_to(seen_from, self.tags.shape), self.tags))
        thinned = beams[:: max(1, len(beams) // _BEAMS)]
        logarithms = np.log(detected) + outline_fits(self.outline, self.tags, lasers, beams)
        logarithms += scan_fits(grid, lasers, thinned)
        self.weights = normalised(logarithms)
        self.effective = effective_number(self.weights)
        heaviest = self.tags[int(np.argmax(self.weights))].copy()
        parents = residual(self.weights, self._random)
        self.tags, self.deviations = self.tags[parents], self.deviations[parents]
        if not self._converged():
            return
        if self.settings.pose_of == "mean":
            self.pose = mean_pose(self.tags)
        elif self.effective > self._largest:
            self.pose, self._largest = heaviest, self.effective

    def _predict(self, antenna: Antenna, seen_from: Floats) -> None:
        """P(D_t|D_t-1): it stands still, or almost, or is anywhere; P(X_t|X_t-1): near the path."""
        count, how = self.settings.particles, self.settings
        if not len(self.tags):
            self.tags = in_range(antenna, seen_from, count, self._random)
            return
        self.tags = self.tags + self._random.normal(size=(count, 3)) * np.array(how.drifts)[[0, 0, 1]]
        fresh = self._random.random(count) < how.share
        self.tags[fresh] = in_range(antenna, seen_from, int(fresh.sum()), self._random)
        moved = self._random.normal(size=(count, 3)) * np.array(how.deviates)[[0, 0, 1]]
        self.deviations = 0.9 * self.deviations + moved

    def _converged(self) -> bool:
        centre = mean_pose(self.tags)
        apart = np.hypot(*(self.tags[:, :2] - centre[:2]).T)
        turned = wrapped(self.tags[:, 2] - centre[2])
        metres, radians = self.settings.converged
        return bool(np.sqrt(np.mean(apart**2)) < metres and np.sqrt(np.mean(turned**2)) < radians)


def in_range(antenna: Antenna, seen_from: Floats, count: int, random: np.random.Generator) -> Floats:
    """(count, 3) poses of a tag, uniform over the range of an antenna at ``seen_from`` (3,), turned anyhow."""
    distance = antenna.reach * _FARTHER * np.sqrt(random.uniform(size=count))
    bearing = min(antenna.half_beam * _WIDER, np.pi) * random.uniform(-1, 1, count)
    turn = random.uniform(-np.pi, np.pi, count)
    there = np.column_stack([distance * np.cos(bearing), distance * np.sin(bearing), turn])
    return compose(np.broadcast_to(seen_from, there.shape), there)


def mean_pose(poses: Floats) -> Floats:
    """(3,) of poses (N, 3); headings as directions."""
    x, y = poses[:, :2].mean(axis=0)
    return np.array([x, y, np.arctan2(np.sin(poses[:, 2]).mean(), np.cos(poses[:, 2]).mean())])
