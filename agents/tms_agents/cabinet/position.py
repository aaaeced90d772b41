"""Centre of gravity of a signed load change, with its covariance.

The moments balance on any rigid board, however it sits on its cells: p = sum(d_i p_i) / sum(d_i) needs no model of how
the cells share a load, and for cells of equal noise it is also the least-squares solution.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from tms_agents.cabinet.geometry import Array, Covariance, Geometry, KnownWeight


class Centre(NamedTuple):
    xy: tuple[float, float]
    cov: Covariance
    weight_g: float
    weight_sd_g: float


def centre(change: Array, variance: Array, geometry: Geometry, known: KnownWeight | None = None) -> Centre:
    """Centre of gravity of ``change`` (k,) grams, whose cells have independent errors of ``variance`` (k,).

    Error: J = (p_i - p) / W per cell, so sigma * L / W. A ``known`` weight sharpens both weight and position, because
    the errors of load and moments are correlated. The position is held on the board.
    """
    total, mx, my = (float(v) for v in geometry.moments @ change)
    spread = (geometry.moments * variance) @ geometry.moments.T
    if known is not None:
        gain = spread[:, 0] / (spread[0, 0] + known.sd_g**2)
        innovation = known.mean_g - total
        total, mx, my = (float(v) for v in np.array([total, mx, my]) + gain * innovation)
        spread = spread - np.outer(gain, spread[0])
    if abs(total) < 1e-6:
        total = math.copysign(1e-6, total)
    x, y = mx / total, my / total
    jacobian = np.array([[-x, 1.0, 0.0], [-y, 0.0, 1.0]]) / total
    cov = jacobian @ spread @ jacobian.T
    xy = (min(max(x, 0.0), geometry.width), min(max(y, 0.0), geometry.depth))
    return Centre(xy, (float(cov[0, 0]), float(cov[0, 1]), float(cov[1, 1])), total, math.sqrt(max(spread[0, 0], 0.0)))


def off_board(change: Array, variance: Array, geometry: Geometry) -> float:
    """Log probability that the true centre of gravity is on the board: about 0 well on it, very negative off it."""
    at = centre_free(change, geometry)
    _, cov, _, _ = centre(change, variance, geometry)
    return sum(
        math.log(max(_share(p, size, math.sqrt(max(var, 1e-8))), 1e-300))
        for p, size, var in ((at[0], geometry.width, cov[0]), (at[1], geometry.depth, cov[2]))
    )


def centre_free(change: Array, geometry: Geometry) -> tuple[float, float]:
    """The centre of gravity without holding it on the board."""
    total, mx, my = geometry.moments @ change
    total = total if abs(total) > 1e-6 else 1e-6
    return float(mx / total), float(my / total)


def _share(p: float, size: float, sd: float) -> float:
    return 0.5 * (math.erf((size - p) / (sd * math.sqrt(2))) - math.erf(-p / (sd * math.sqrt(2))))
