"""Residual resampling (Liu and Chen 1998): what is certain is no matter of chance."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tms_agents.slam.geometry import Floats


def residual(weights: Floats, random: np.random.Generator) -> NDArray[np.int64]:
    """(N,) parents: each particle has the whole part of N * weight children for certain, the others are drawn in
    proportion to the rests."""
    count = len(weights)
    wanted = count * weights
    certain = np.floor(wanted + 1e-9).astype(np.int64)
    parents = np.repeat(np.arange(count), certain)
    missing = count - len(parents)
    if missing <= 0:
        return parents[:count]
    shares = np.cumsum(np.maximum(wanted - certain, 0.0))
    drawn = np.searchsorted(shares / shares[-1], random.uniform(size=missing), side="right")
    return np.concatenate([parents, drawn])
