"""What odometry says, and how far it may be wrong: noise that grows with distance and turn (Thrun's alphas)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tms_agents.slam.geometry import Floats


@dataclass(frozen=True, slots=True)
class OdometryNoise:
    """Standard deviations: of the turn per rad turned and per m driven, of the way per m driven and per rad turned.

    ``least_m`` and ``least_rad`` are added: a robot may slip while it seems to stand.
    """

    turn_per_rad: float = 0.15
    turn_per_m: float = 0.08
    way_per_m: float = 0.06
    way_per_rad: float = 0.07
    least_m: float = 0.01
    least_rad: float = 0.01

    def covariance(self, motions: Floats, driven: Floats) -> Floats:
        """(..., 3, 3) of ``motions`` (..., 3), in the frame in which they began; ``driven`` (..., 2) m and rad for
        them."""
        way, turn = driven[..., 0], driven[..., 1]
        along = (self.way_per_m * way + self.way_per_rad * turn + self.least_m) ** 2
        rotation = (self.turn_per_rad * turn + self.turn_per_m * way + self.least_rad) ** 2
        covariance = np.zeros((*motions.shape[:-1], 3, 3))
        covariance[..., 0, 0] = along
        covariance[..., 1, 1] = along
        covariance[..., 2, 2] = rotation
        # Who turned wrongly on the way has also gone astray: half of the error, on average, times the way.
        lever = np.stack([-0.5 * motions[..., 1], 0.5 * motions[..., 0]], axis=-1)
        covariance[..., :2, :2] += rotation[..., None, None] * lever[..., :, None] * lever[..., None, :]
        covariance[..., :2, 2] += rotation[..., None] * lever
        covariance[..., 2, :2] += rotation[..., None] * lever
        return covariance


def turned(covariance: Floats, headings: Floats) -> Floats:
    """``covariance`` (3, 3) seen from poses with ``headings`` (N,) rad, in their common frame: (N, 3, 3)."""
    cosine, sine = np.cos(headings), np.sin(headings)
    rotation = np.zeros((len(headings), 3, 3))
    rotation[:, 0, 0], rotation[:, 0, 1] = cosine, -sine
    rotation[:, 1, 0], rotation[:, 1, 1] = sine, cosine
    rotation[:, 2, 2] = 1.0
    return rotation @ covariance @ rotation.swapaxes(1, 2)
