"""How long the way is that odometry calls a metre, from scans that fit each other: where these tell nothing, along a
bare corridor, odometry alone says how far the robot went."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from tms_agents.slam.geometry import Floats, between
from tms_agents.slam.motion import OdometryNoise
from tms_agents.slam.posegraph import Edges

#: A match tells of the way if it is surely so good along it (1/m^2), and so long (m); fewer such matches tell nothing.
_HELD, _LONG_M, _LEAST = 1e4, 0.3, 50
#: However well matches and odometry agree, it errs by so much (m per root of a metre).
_BEST = 0.005


@dataclass(frozen=True, slots=True)
class Wheels:
    """True metres per metre of odometry, and the noise that is left."""

    scale: float
    noise: OdometryNoise

    def driven(self, motions: Floats) -> Floats:
        """``motions`` (..., 3) of odometry in true metres."""
        found: Floats = motions * np.array([self.scale, self.scale, 1.0])
        return found


def wheels_of(matches: Edges, odometry: Floats, noise: OdometryNoise) -> Wheels:
    """From ``matches`` between poses (K, 3) of ``odometry``, driven straight on or not; ``noise`` as it was thought to
    be, which stays where too few matches tell of the way."""
    driven = between(odometry[matches.start], odometry[matches.end])[:, 0]
    told = (np.abs(driven) > _LONG_M) & (matches.information[:, 0, 0] > _HELD)
    if np.count_nonzero(told) < _LEAST:
        return Wheels(1.0, noise)
    driven, seen = driven[told], matches.measured[told, 0]
    scale = _median(seen / driven, np.abs(driven))
    error = 1.4826 * float(np.median(np.abs(seen - scale * driven) / np.sqrt(np.abs(driven))))
    # Errors of steps are independent of each other now that what they had in common is known.
    step = max(error, _BEST) * np.sqrt(float(np.median(np.abs(between(odometry[:-1], odometry[1:])[:, 0]))))
    return Wheels(scale, replace(noise, way_per_m=0.0, least_m=step))


def _median(values: Floats, weights: Floats) -> float:
    order = np.argsort(values, kind="stable")
    sums = np.cumsum(weights[order])
    return float(values[order][np.searchsorted(sums, 0.5 * sums[-1])])
