"""Does another place explain the last scans as well? Particles that were dropped long ago are not there to say so.

The map is searched anew with the newest scan; the best places, and the one that is believed, are followed back through
the scans before it, each by matching with odometry as prior, and compared by how well the scans fit on the way.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tms_agents.slam.fit import MEAN, Fit
from tms_agents.slam.geometry import Floats, between, compose
from tms_agents.slam.known import KnownMap
from tms_agents.slam.motion import OdometryNoise, turned
from tms_agents.slam.sampling import bins_of
from tms_agents.slam.tracking import matched

#: What a pose that was tried stands for (m, rad), and how far apart two places are that differ.
_AROUND = (0.3, 0.15)
_APART = (0.5, 0.2)


@dataclass(frozen=True, slots=True, eq=False)
class Seen:
    """One scan: ``points`` (M, 2) m as the robot saw them, ``odometry`` (3,) and ``driven`` (2,) as in `Log`."""

    points: Floats
    odometry: Floats
    driven: Floats


@dataclass(frozen=True, slots=True, eq=False)
class Rivals:
    """``poses`` (R, 3) of other places than the believed one, the best first; ``behind`` (R,) is by how much their
    scans fit worse (mean cost per beam, negative: better), ``errors`` (R,) the standard error of that."""

    poses: Floats
    behind: Floats
    errors: Floats

    @property
    def margin(self) -> float:
        """How far the best of them is behind."""
        return float(self.behind.min(initial=np.inf))

    @property
    def sigmas(self) -> float:
        """The same in standard errors, of the one where that is least."""
        return float((self.behind / np.maximum(self.errors, 1e-9)).min(initial=np.inf))


@dataclass(frozen=True, slots=True, eq=False)
class Follower:
    """Follows poses back through scans in ``known``: ``fit`` tells how well they fit, the matcher's kernel is
    ``sigma_m`` wide, the laser is at ``laser`` (2,) on the robot."""

    known: KnownMap
    fit: Fit
    laser: Floats
    noise: OdometryNoise
    sigma_m: float

    def rivals_of(self, best: Floats, tried: Floats, costs: Floats, seen: Sequence[Seen], most: int) -> Rivals:
        """Of ``best`` (3,) among ``tried`` (N, 3) with ``costs`` (N,) of the newest of the scans ``seen`` (newest
        first), ``most`` of which are followed."""
        lowest = np.argpartition(costs, 50 * most)[: 50 * most] if len(costs) > 50 * most else np.arange(len(costs))
        order = lowest[np.argsort(costs[lowest], kind="stable")]
        _, first = np.unique(bins_of(tried[order], *_AROUND), axis=0, return_index=True)
        candidates = tried[order[np.sort(first)[:most]]]
        poses, mean = self._back(np.concatenate([best[None], candidates]), seen)
        apart = between(poses[:1], poses)
        others = np.flatnonzero((np.hypot(apart[:, 0], apart[:, 1]) > _APART[0]) | (np.abs(apart[:, 2]) > _APART[1]))
        behind = (mean - mean[:, :1])[:, others]
        order = np.argsort(behind.mean(axis=0), kind="stable")
        error = behind.std(axis=0) / np.sqrt(max(1, len(seen) - 1))
        return Rivals(poses[others[order]], behind.mean(axis=0)[order], error[order])

    def _back(self, poses: Floats, seen: Sequence[Seen]) -> tuple[Floats, Floats]:
        """Where each of ``poses`` (N, 3) fits the newest scan best, and its mean costs per beam (S, N) of all scans."""
        n = len(poses)
        spread = np.diag([_AROUND[0] ** 2, _AROUND[0] ** 2, _AROUND[1] ** 2])
        motion, covariance = np.zeros(3), np.broadcast_to(spread, (n, 3, 3))
        newest, costs = poses, np.zeros((len(seen), n))
        for number, scan in enumerate(seen):
            if number:
                before = seen[number - 1]
                motion = between(before.odometry, scan.odometry)
                covariance = turned(self.noise.covariance(motion, before.driven - scan.driven), poses[:, 2])
            priors = compose(poses, np.broadcast_to(motion, (n, 3)))
            precision = np.ascontiguousarray(np.linalg.inv(covariance))
            poses, _, _ = matched(self.known, scan.points, priors, priors, precision, self.sigma_m)
            costs[number] = self.fit(poses, scan.points, self.laser)[:, MEAN]
            newest = newest if number else poses
        return newest, costs
