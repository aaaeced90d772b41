"""Cramér-Rao limit of the position of a load, from a world's own parameters."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


def position_limit(shares: Floats, weight_g: float, xy: tuple[float, float], variance_g2: float) -> float:
    """Least root mean square distance (m) of any unbiased estimate of a load's place whose weight is unknown too.

    ``shares`` (k, 4) as of the board's statics; ``variance_g2`` of the difference that each cell shows.
    """
    x, y = xy
    # Derivative of each cell's load by weight, x and y.
    jacobian = shares @ np.array(
        [[1.0, 0.0, 0.0], [x, weight_g, 0.0], [y, 0.0, weight_g], [x * y, weight_g * y, weight_g * x]]
    )
    information = jacobian.T @ jacobian / variance_g2
    covariance = np.linalg.inv(information)
    return float(np.sqrt(covariance[1, 1] + covariance[2, 2]))


def tilted_limit(
    shares: Floats,
    weight_g: float,
    xy: tuple[float, float],
    noise_sd_g: Floats,
    load: Floats,
    tilt: Floats,
    before: NDArray[np.bool_],
    tilt_m: float,
    step_g: float,
) -> float:
    """The limit (m) where it is unknown, too, on which edge the thing came down (van Trees, a tilt of known spread).

    While ``tilt`` (n,) goes from 1 to 0 the force, ``load`` (n,) of the weight, acts that share of an offset of
    standard deviation ``tilt_m`` on each axis away from ``xy``. When the hand lets go counts as known. Other parameters
    as for ``difference_variance``.
    """
    x, y = xy
    once = shares @ np.array(
        [[1.0, 0.0, 0.0], [x, weight_g, 0.0], [y, 0.0, weight_g], [x * y, weight_g * y, weight_g * x]]
    )
    cells = len(shares)
    worth = 1.0 / (noise_sd_g**2 + step_g**2 / 12)
    parameters = 5 + cells  # weight, place, offset, and what the empty board shows
    information = np.zeros((parameters, parameters))
    information[5:, 5:] = worth[before].sum() * np.eye(cells)
    information[[3, 4], [3, 4]] = 1.0 / tilt_m**2
    for each, force, leaning in zip(worth[~before], load[~before], tilt[~before], strict=True):
        jacobian = np.hstack([force * once, force * leaning * once[:, 1:], np.eye(cells)])
        information += each * jacobian.T @ jacobian
    covariance = np.linalg.inv(information)
    return float(np.sqrt(covariance[1, 1] + covariance[2, 2]))


def difference_variance(noise_sd_g: Floats, load: Floats, before: NDArray[np.bool_], step_g: float) -> float:
    """Least variance of what a cell's level after a change differs by from that of the samples ``before`` it.

    ``noise_sd_g`` (n,) of the samples, which rounding to ``step_g`` adds to as uniform noise. All samples count by what
    they are worth; those after the change also by ``load`` (n,), the force on the place in units of the final weight:
    while a hand puts a thing down its force is unknown, but it acts where the thing is going to stand.
    """
    worth = 1.0 / (noise_sd_g**2 + step_g**2 / 12)
    return float(1.0 / worth[before].sum() + 1.0 / (worth * load**2)[~before].sum())
