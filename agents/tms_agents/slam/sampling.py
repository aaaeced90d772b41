"""Particles: spread over a map, drawn by weight, and how many of them are enough (Fox 2003, KLD-sampling)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tms_agents.slam.geometry import Floats, wrapped
from tms_agents.slam.known import KnownMap
from tms_agents.slam.weights import low_variance

#: Quantile of the standard normal distribution at 0.99.
_QUANTILE = 2.326
_GOLDEN = 0.6180339887498949


def everywhere(known: KnownMap, count: int, random: np.random.Generator) -> Floats:
    """(count, 3) poses over all free places of the map, evenly: the same number on every part, turned evenly."""
    where = ((np.arange(count) + random.uniform()) * (len(known.standing) / count)).astype(np.int64)
    cells = known.standing[np.minimum(where, len(known.standing) - 1)]
    places = (cells + random.uniform(size=(count, 2))) / known.frame[2] + known.frame[:2]
    turns = (np.arange(count) * _GOLDEN + random.uniform()) % 1.0
    return np.column_stack([places, wrapped(2 * np.pi * turns)])


def bins_of(poses: Floats, side_m: float, side_rad: float) -> NDArray[np.int64]:
    """(N, 3) numbers of the boxes in which ``poses`` (N, 3) lie; the headings' wrap around."""
    around = round(2 * np.pi / side_rad)
    turns = np.floor((poses[:, 2] + np.pi) / (2 * np.pi) * around).astype(np.int64) % around
    return np.column_stack([np.floor(poses[:, :2] / side_m).astype(np.int64), turns])


def enough(bins: NDArray[np.int64] | int, error: float) -> Floats:
    """Particles that keep the Kullback-Leibler distance below ``error`` with probability 0.99, of ``bins`` that are
    not empty (Fox 2003, equation 7)."""
    k = np.maximum(np.asarray(bins, dtype=np.float64) - 1.0, 1.0)
    part = 2.0 / (9.0 * k)
    wanted: Floats = k / (2.0 * error) * (1.0 - part + np.sqrt(part) * _QUANTILE) ** 3
    return wanted


def drawn_until_enough(
    poses: Floats,
    weights: Floats,
    *,
    least: int,
    most: int,
    error: float,
    bins: tuple[float, float],
    random: np.random.Generator,
) -> NDArray[np.int64]:
    """Parents of the next particles, in proportion to ``weights`` (N,): as many as their spread needs."""
    parents = random.permutation(low_variance(weights, most, float(random.uniform())))
    keys = bins_of(poses[parents], *bins)
    _, first = np.unique(keys, axis=0, return_index=True)
    fresh = np.zeros(most, dtype=np.int64)
    fresh[first] = 1
    satisfied = np.arange(1, most + 1) >= np.maximum(least, enough(np.cumsum(fresh), error))
    count = int(np.argmax(satisfied)) + 1 if satisfied.any() else most
    return np.sort(parents[:count]).astype(np.int64)
