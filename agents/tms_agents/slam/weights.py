"""Importance weights of particles: normalised in logarithms, resampled with one random number."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tms_agents.slam.geometry import Floats, Ints


def normalised(logarithms: Floats) -> Floats:
    """(N,) weights that sum to 1, of log weights of any size."""
    weights: Floats = np.exp(logarithms - logarithms.max())
    shares: Floats = weights / weights.sum()
    return shares


def effective_number(weights: Floats) -> float:
    """1 / sum of squares: how many particles of equal weight would be worth as much."""
    return float(1.0 / np.square(weights).sum())


def low_variance(weights: Floats, count: int, uniform: float) -> Ints:
    """(count,) parents, each drawn in proportion to its weight; ``uniform`` in [0, 1) decides (Thrun et al. 2005,
    4.2.4).

    A particle has floor or ceiling of ``count * weight`` children, and on average exactly that.
    """
    arms: NDArray[np.float64] = (np.arange(count) + uniform) / count
    parents = np.searchsorted(np.cumsum(weights), arms, side="right")
    return np.minimum(parents, len(weights) - 1).astype(np.int32)
