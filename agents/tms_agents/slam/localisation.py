"""Where a robot is in a map that is known: Monte Carlo localisation from anywhere, over any number of hypotheses.

Many particles over all free places at first, as many as their spread needs after that (KLD-sampling); once few are
enough, each is moved to where the scan fits best (improved proposal). When scans cease to fit, fresh particles are
thrown over the map (augmented MCL; Thrun, Burgard, Fox 2005, section 8.3.7).
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

import numpy as np

from tms_agents.slam.anywhere import Anywhere
from tms_agents.slam.filter import drawn, thinned
from tms_agents.slam.fit import Fit
from tms_agents.slam.geometry import Floats, between, compose, wrapped
from tms_agents.slam.hypotheses import Hypothesis, hypotheses
from tms_agents.slam.known import KnownMap
from tms_agents.slam.localisation_settings import LocalisationSettings
from tms_agents.slam.motion import turned
from tms_agents.slam.rivals import Follower, Seen
from tms_agents.slam.tracking import matched
from tms_agents.slam.verdict import Verdict
from tms_agents.slam.weights import effective_number, normalised


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
        self._map = Anywhere(known, settings, self._laser, self._random)
        self._fine = Fit(known, settings.fine_m)
        self._follower = Follower(known, self._map.fit, self._laser, settings.noise, settings.fine_m)
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
            self.poses, self.log_weights = self._map.particles(points, 1.0)
            return
        spread = np.array([s.start_m, s.start_m, s.start_rad])
        self.poses = np.array(s.start) + spread * self._random.standard_normal((s.matched, 3))
        self.poses[:, 2] = wrapped(self.poses[:, 2])
        self.log_weights = self._map.weighed(self.poses, points)

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
        self.log_weights = self.log_weights + volume + self._map.weighed(poses, points)
        self.poses = poses + drawn(hessians, normals[1])

    def _move_and_weigh(self, motion: Floats, noise: Floats, points: Floats, share: float) -> None:
        n = len(self.poses)
        covariance = turned(noise, self.poses[:, 2])
        moved = compose(self.poses, np.broadcast_to(motion, (n, 3)))
        self.poses = moved + np.einsum(
            "nij,nj->ni", np.linalg.cholesky(covariance), self._random.standard_normal((n, 3))
        )
        self.log_weights = self.log_weights + self._map.weighed(self.poses, points)
        if share > 0.0:
            self._throw(points, share)

    def _throw(self, points: Floats, share: float) -> None:
        """``share`` of the belief before this scan goes to fresh particles anywhere."""
        fresh, weights = self._map.particles(points, max(share, 0.2))
        self.poses = np.concatenate([self.poses, fresh])
        self.log_weights = np.concatenate([self.log_weights + np.log(1.0 - share), weights + np.log(share)])

    def _look_for_rivals(self, best: Hypothesis, points: Floats) -> None:
        """Those that cannot be told from the best one get particles."""
        s = self.settings
        if self._told:  # who was told where it is need not look elsewhere, until it is lost
            self._told = False
            self._verdict.answer(np.inf, np.inf, 1.0)
            return
        share = 0.4 if self._verdict.localised else 1.0  # a look now and then may miss what the next one finds
        tried, costs = self._map.tried(points, share)
        seen = list(self._seen)[: int(share * s.remembered)]
        rivals = self._follower.rivals_of(best.pose, tried, costs, seen, s.rivals)
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

    def _resample(self) -> None:
        weights = normalised(self.log_weights)
        crowded = len(self.poses) > 2 * self.settings.least
        if not crowded and effective_number(weights) >= 0.5 * len(weights):
            self.log_weights = np.log(np.maximum(weights, 1e-300))
            return
        most = min(self.settings.particles, max(1000, 4 * len(self.poses)))
        parents = self._map.enough(self.poses, weights, most)
        self.poses = self.poses[parents]
        self.log_weights = np.full(len(parents), -np.log(len(parents)))
