"""Where a robot is in a map that is known: Monte Carlo localisation from anywhere, over any number of hypotheses.

Many particles over all free places at first, as many as their spread needs after that (KLD-sampling); once few are
enough, each is moved to where the scan fits best (improved proposal). When scans cease to fit, fresh particles are
thrown over the map (augmented MCL; Thrun, Burgard, Fox 2005, section 8.3.7).
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field

import numpy as np

from tms_agents.slam.filter import drawn, thinned
from tms_agents.slam.fit import MEAN, Fit
from tms_agents.slam.geometry import Floats, between, compose, wrapped
from tms_agents.slam.hypotheses import Hypothesis, hypotheses
from tms_agents.slam.known import KnownMap
from tms_agents.slam.motion import OdometryNoise, turned
from tms_agents.slam.rivals import Seen, rivals_of
from tms_agents.slam.sampling import drawn_until_enough, everywhere
from tms_agents.slam.tracking import matched
from tms_agents.slam.verdict import Limits, Verdict
from tms_agents.slam.weights import effective_number, normalised


@dataclass(frozen=True, slots=True)
class LocalisationSettings:
    """Lengths in m, angles in rad. ``start`` is the pose where the robot begins, about; None: anywhere."""

    seed: int = 0
    start: tuple[float, float, float] | None = None
    start_m: float = 0.5
    start_rad: float = 0.3
    #: Particles: at most, at least, the error that KLD-sampling allows and its boxes.
    particles: int = 20_000
    least: int = 40
    error: float = 0.1
    bins: tuple[float, float] = (0.4, np.pi / 18)
    #: Poses tried per m2 of free floor when the robot may be anywhere, and at most.
    tries_per_m2: float = 600.0
    most_tries: int = 2_000_000
    #: While nothing is believed, this share of the belief goes to fresh particles at every so-manieth scan.
    anew: float = 0.05
    anew_every: int = 5
    #: So many particles are matched one by one; where there are more, they are only weighed.
    matched: int = 1500
    #: Beams that are tried at first, weighed, and matched; all beams of a scan are worth so many witnesses.
    few_beams: int = 30
    beams: int = 60
    witnesses: float = 10.0
    #: A beam through a wall counts as one that misses.
    through: bool = True
    coarse_m: float = 0.2
    fine_m: float = 0.1
    #: Scans that are remembered to compare places by; places compared; share of the belief that goes to those that
    #: cannot be told from the best one.
    remembered: int = 24
    rivals: int = 100
    rivals_share: float = 0.3
    noise: OdometryNoise = field(default_factory=OdometryNoise)
    limits: Limits = field(default_factory=Limits)
    step_m: float = 0.5
    step_rad: float = 0.25


@dataclass(frozen=True, slots=True, eq=False)
class Estimate:
    """After a scan: is the robot ``localised``? ``hypotheses``, the heaviest first, of ``particles`` in all."""

    localised: bool
    hypotheses: list[Hypothesis]
    particles: int

    @property
    def best(self) -> Hypothesis:
        return self.hypotheses[0]


class Localiser:
    """Feed it scans with odometry, in order. Deterministic by ``settings.seed`` for any number of threads."""

    def __init__(self, known: KnownMap, settings: LocalisationSettings, laser: Floats) -> None:
        self.settings, self._known = settings, known
        self._laser = np.ascontiguousarray(laser[:2])
        self._random = np.random.default_rng(settings.seed)
        self._coarse, self._fine = Fit(known, settings.coarse_m), Fit(known, settings.fine_m)
        self._verdict = Verdict(settings.limits)
        self.poses: Floats = np.zeros((0, 3))
        self.log_weights: Floats = np.zeros(0)
        self._odometry: Floats | None = None
        self._driven: Floats = np.zeros(2)
        self._scans = 0
        self._told = settings.start is not None
        self._seen: deque[Seen] = deque(maxlen=settings.remembered)

    def process(self, odometry: Floats, driven: Floats, points: Floats) -> Estimate:
        """One scan: ``odometry`` (3,), ``driven`` (2,) as in `Log`, ``points`` (M, 2) m seen from the robot."""
        moved = driven - self._driven if self._odometry is not None else np.zeros(2)
        if self._odometry is None:
            self._begin(points)
        else:
            motion = between(self._odometry, odometry)
            noise = self.settings.noise.covariance(motion, moved)
            share = self._share_anew()
            if share == 0.0 and len(self.poses) <= self.settings.matched:
                self._move_to_fit(motion, noise, points)
            else:
                self._move_and_weigh(motion, noise, points, share)
        self._odometry, self._driven = odometry, driven
        self._seen.appendleft(Seen(thinned(points, self.settings.beams), odometry, driven))
        self._scans += 1
        found = hypotheses(self.poses, normalised(self.log_weights))
        fits = self._fine(found[0].pose[None], points, self._laser)
        self._verdict.judge(found[0], fits[0], float(moved[0]))
        if self._verdict.asks:
            self._look_for_rivals(found[0], points)
        estimate = Estimate(self._verdict.localised, found, len(self.poses))
        self._resample()
        return estimate

    def _begin(self, points: Floats) -> None:
        s = self.settings
        if s.start is None:
            self.poses, self.log_weights = self._anywhere(points, 1.0)
            return
        spread = np.array([s.start_m, s.start_m, s.start_rad])
        self.poses = np.array(s.start) + spread * self._random.standard_normal((s.matched, 3))
        self.poses[:, 2] = wrapped(self.poses[:, 2])
        self.log_weights = self._weighed(self.poses, points)

    def _share_anew(self) -> float:
        due = not self._verdict.localised and self._scans % self.settings.anew_every == 0
        return max(self._verdict.surprise, self.settings.anew if due else 0.0)

    def _move_to_fit(self, motion: Floats, noise: Floats, points: Floats) -> None:
        n, few = len(self.poses), thinned(points, self.settings.beams)
        normals = self._random.standard_normal((2, n, 3))
        covariance = turned(noise, self.poses[:, 2])
        priors = compose(self.poses, np.broadcast_to(motion, (n, 3)))
        starts = priors + np.einsum("nij,nj->ni", np.linalg.cholesky(covariance), normals[0])
        precision: Floats = np.linalg.inv(covariance).astype(np.float64)
        poses, hessians, volume = matched(self._known, few, starts, priors, precision, self.settings.fine_m)
        self.log_weights = self.log_weights + volume + self._weighed(poses, points)
        self.poses = poses + drawn(hessians, normals[1])

    def _move_and_weigh(self, motion: Floats, noise: Floats, points: Floats, share: float) -> None:
        n = len(self.poses)
        covariance = turned(noise, self.poses[:, 2])
        moved = compose(self.poses, np.broadcast_to(motion, (n, 3)))
        self.poses = moved + np.einsum(
            "nij,nj->ni", np.linalg.cholesky(covariance), self._random.standard_normal((n, 3))
        )
        self.log_weights = self.log_weights + self._weighed(self.poses, points)
        if share > 0.0:
            self._throw(points, share)

    def _throw(self, points: Floats, share: float) -> None:
        """``share`` of the belief before this scan goes to fresh particles anywhere."""
        fresh, weights = self._anywhere(points, max(share, 0.2))
        self.poses = np.concatenate([self.poses, fresh])
        self.log_weights = np.concatenate([self.log_weights + np.log(1.0 - share), weights + np.log(share)])

    def _anywhere(self, points: Floats, effort: float) -> tuple[Floats, Floats]:
        """Particles over all of the map, those drawn from many more that fit the scan; log weights in which all that
        were tried had 1 together before the scan. ``effort`` 0..1 is the share of the work."""
        s = self.settings
        poses, costs = self._tried(points, effort)
        weights = normalised(-s.witnesses * costs)
        evidence = np.log(np.mean(np.exp(-s.witnesses * costs)))
        parents = self._enough(poses, weights, int(effort * s.particles))
        return self._near(poses[parents], costs[parents], points, evidence)

    def _tried(self, points: Floats, effort: float) -> tuple[Floats, Floats]:
        """Poses over all of the map and their costs."""
        s, known = self.settings, self._known
        tries = int(effort * np.clip(s.tries_per_m2 * known.free_m2, s.particles, s.most_tries))
        poses = everywhere(known, tries, self._random)
        return poses, self._coarse(poses, thinned(points, s.few_beams), self._laser, through=False)[:, MEAN]

    def _near(self, poses: Floats, costs: Floats, points: Floats, evidence: float) -> tuple[Floats, Floats]:
        """Each stands for the places around it: moved within them to a better fit."""
        s, n = self.settings, len(poses)
        spread = np.array([0.1, 0.1, 0.06])
        moved = poses + spread * self._random.standard_normal((n, 3))
        weights = self._weighed(moved, points) + s.witnesses * costs + evidence - np.log(n)
        return moved, weights

    def _weighed(self, poses: Floats, points: Floats) -> Floats:
        s = self.settings
        fits = self._coarse(poses, thinned(points, s.beams), self._laser, through=s.through)
        return -s.witnesses * fits[:, MEAN]

    def _look_for_rivals(self, best: Hypothesis, points: Floats) -> None:
        """Those that cannot be told from the best one get particles."""
        s = self.settings
        if self._told:  # who was told where it is need not look elsewhere, until it is lost
            self._told = False
            self._verdict.answer(np.inf, np.inf, 1.0)
            return
        share = 0.4 if self._verdict.localised else 1.0  # a look now and then may miss what the next one finds
        tried, costs = self._tried(points, share)
        seen = list(self._seen)[: int(share * s.remembered)]
        rivals = rivals_of(
            best.pose, tried, costs, seen, self._known, self._coarse, self._laser, s.noise, s.fine_m, s.rivals
        )
        self._verdict.answer(rivals.margin, rivals.sigmas, len(seen) / s.remembered)
        if self._verdict.localised:
            return
        close = rivals.poses[rivals.behind < s.limits.margin]
        if len(close):
            fresh = np.repeat(close, s.least, axis=0)
            fresh = fresh + np.array([0.05, 0.05, 0.03]) * self._random.standard_normal(fresh.shape)
            weights = np.full(len(fresh), np.log(s.rivals_share / len(fresh)))
            kept = np.log(1.0 - s.rivals_share) + np.log(np.maximum(normalised(self.log_weights), 1e-300))
            self.poses, self.log_weights = np.concatenate([self.poses, fresh]), np.concatenate([kept, weights])

    def _enough(self, poses: Floats, weights: Floats, most: int) -> np.ndarray[tuple[int], np.dtype[np.int64]]:
        s = self.settings
        return drawn_until_enough(
            poses, weights, least=s.least, most=max(s.least, most), error=s.error, bins=s.bins, random=self._random
        )

    def _resample(self) -> None:
        weights = normalised(self.log_weights)
        crowded = len(self.poses) > 2 * self.settings.least
        if not crowded and effective_number(weights) >= 0.5 * len(weights):
            self.log_weights = np.log(np.maximum(weights, 1e-300))
            return
        most = min(self.settings.particles, max(1000, 4 * len(self.poses)))
        parents = self._enough(self.poses, weights, most)
        self.poses = self.poses[parents]
        self.log_weights = np.full(len(parents), -np.log(len(parents)))
