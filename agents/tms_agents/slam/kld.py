"""How many particles are enough (Fox 2003, "Adapting the sample size in particle filters through KLD-sampling")."""

from __future__ import annotations

import math

import numpy as np

from tms_agents.slam.geometry import Floats

#: Particles in one bin (m, rad) are alike; with probability 0.99 (its quantile) the distribution over the bins is then
#: true to so little Kullback-Leibler divergence.
_BIN = (0.1, 0.1, 0.05)
_QUANTILE, _DIVERGENCE = 2.326, 0.15


def enough(poses: Floats, least: int, most: int) -> int:
    """Particles that are enough for a posterior as wide as ``poses`` (N, 3), from ``least`` to ``most``."""
    bins = len(np.unique(np.round((poses - poses.mean(axis=0)) / np.array(_BIN)), axis=0))
    if bins == 1:
        return least
    share = 2.0 / (9.0 * (bins - 1))
    count = (bins - 1) / (2.0 * _DIVERGENCE) * (1.0 - share + math.sqrt(share) * _QUANTILE) ** 3
    return min(most, max(least, math.ceil(count)))
