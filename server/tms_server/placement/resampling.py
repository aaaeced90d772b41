"""Keeping the set within its budget: Fearnhead-Clifford optimal resampling, and pruning with a certificate.

Fearnhead, Clifford: On-line inference for hidden Markov models via particle filters, JRSS B 65 (2003).
"""

from __future__ import annotations

import hashlib

import numpy as np

from tms_server.placement import thinning
from tms_server.placement.specs import DrawKey
from tms_server.placement.state import Array


def generator(key: DrawKey) -> np.random.Generator:
    """The random draws that belong to one event: Philox keyed by a hash of (seed, agent, seq)."""
    name = f"{key.seed}\x00{key.agent}\x00{key.seq}".encode()
    digest = hashlib.blake2b(name, digest_size=16).digest()
    return np.random.Generator(np.random.Philox(key=np.frombuffer(digest, "<u8").astype(np.uint64)))


def uniform(key: DrawKey, n: int) -> float:
    """The n-th uniform draw in [0, 1) of one event, from the hash itself: a generator for one number costs more."""
    name = f"{key.seed}\x00{key.agent}\x00{key.seq}\x00{n}".encode()
    return int.from_bytes(hashlib.blake2b(name, digest_size=8).digest(), "little") / 2**64


class Budget:
    """Thins the children of one event to ``most``; random numbers are drawn only if that is needed."""

    def __init__(self, most: int, key: DrawKey) -> None:
        self._most, self._key = most, key
        self._draws = 0

    @property
    def exceeded(self) -> bool:
        """Whether the set had to be thinned."""
        return self._draws > 0

    def __call__(self, w: Array) -> tuple[Array, Array] | None:
        """Which of the normalised children to keep, and their new weights; None keeps all."""
        if w.size <= self._most:
            return None
        c = thinning.threshold(w, self._most)
        weights = w.copy()
        keep = thinning.thin(weights, c, uniform(self._key, self._draws), self._most)
        self._draws += 1
        kept = weights[keep]
        return keep, kept / kept.sum()


def light(w: Array, eps: float) -> tuple[Array, float]:
    """Indices that stay when the lightest weights go while their sum is <= eps, and the mass dropped."""
    candidates = np.flatnonzero(w <= eps)
    if candidates.size:
        candidates = candidates[np.argsort(w[candidates], kind="stable")]
        total = np.cumsum(w[candidates])
        n = int(np.searchsorted(total, eps, side="right"))
        if n:
            keep = np.ones(w.size, np.bool_)
            keep[candidates[:n]] = False
            return np.flatnonzero(keep), float(total[n - 1])
    return np.arange(w.size), 0.0
