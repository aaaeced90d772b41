"""From the frame of a board to that of the room: a point, its covariance, and a height."""

from __future__ import annotations

import math
from dataclasses import dataclass

Xy = tuple[float, float]
#: (var_x, cov_xy, var_y), m^2, as on the wire.
Covariance = tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class BoardPose:
    """Where the board's origin is in the room and how it is turned: metres, radians counter-clockwise; ``z`` height."""

    x: float
    y: float
    theta: float = 0.0
    z: float | None = None
    surface: str | None = None

    def point(self, xy: Xy) -> Xy:
        cos, sin = math.cos(self.theta), math.sin(self.theta)
        return (self.x + cos * xy[0] - sin * xy[1], self.y + sin * xy[0] + cos * xy[1])

    def covariance(self, cov: Covariance) -> Covariance:
        """``R cov R^T``: as large and as long as before, turned."""
        cos, sin = math.cos(self.theta), math.sin(self.theta)
        xx, xy, yy = cov
        return (
            cos * cos * xx - 2 * cos * sin * xy + sin * sin * yy,
            cos * sin * (xx - yy) + (cos * cos - sin * sin) * xy,
            sin * sin * xx + 2 * cos * sin * xy + cos * cos * yy,
        )
