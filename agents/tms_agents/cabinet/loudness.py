"""How loud each sample is: a tag reader's field or a compressor makes the cells noisier for some tenths of a second.

An average that ignores this loses a fifth of its precision under an antenna that is on for a third of the time. The
variance of all cells together jumps between a few factors and stays there for a while (a hidden Markov model); forward
and backward passes tell how probable each factor is at each sample. How often which factor occurs is learned.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from tms_agents.cabinet.blocks import Block
from tms_agents.cabinet.geometry import Array

#: Variance of a loud or quiet moment relative to the average one.
_FACTORS: Array = 0.25 * np.power(1.6, np.arange(8.0))
#: A moment of one loudness lasts about so long, s.
_LASTING_S = 0.3
#: How much the newest samples count in what is learned, each.
_LEARNING = 0.001


class Loudness:
    """Weighs samples of one level by how quiet the moment is."""

    def __init__(self) -> None:
        self._usual: Array = np.full(len(_FACTORS), 1.0 / len(_FACTORS))

    def sharpen(self, blocks: Sequence[Block]) -> None:
        """Set ``sharp`` of consecutive ``blocks`` at one level."""
        counts = [block.n for block in blocks]
        worth = self._worth(
            np.concatenate([block.samples for block in blocks]),
            np.repeat([block.unit for block in blocks], counts, axis=0),
            (blocks[-1].end - blocks[0].start) / max(sum(counts) - 1, 1),
        )
        first = 0
        for block in blocks:
            mine = worth[first : first + block.n]
            first += block.n
            total = float(mine.sum())
            block.sharp = mine @ block.samples / total, block.unit / total

    def _worth(self, samples: Array, unit: Array, period_s: float) -> Array:
        """Inverse variance of each sample (n,), in units of the usual one, from samples and their variances (n, k)."""
        n, k = samples.shape
        squares = ((samples - samples.mean(axis=0)) ** 2 / unit).sum(axis=1) * (n / max(n - 1, 1))
        log = -0.5 * (k * np.log(_FACTORS) + squares[:, None] / _FACTORS)
        likelihood = np.exp(log - log.max(axis=1, keepdims=True))
        stay = float(np.exp(-max(period_s, 1e-3) / _LASTING_S))
        jump = (1.0 - stay) * self._usual
        probability = np.empty((n, len(_FACTORS)))
        # In place: there are many of these small steps.
        now = self._usual.copy()
        for row, likely in zip(probability, likelihood, strict=True):
            now *= stay
            now += jump
            now *= likely
            now /= np.add.reduce(now)
            row[:] = now
        later = np.ones(len(_FACTORS))
        for i in range(n - 2, -1, -1):
            later *= likelihood[i + 1]
            leap = jump @ later
            later *= stay
            later += leap
            later /= np.add.reduce(later)
            probability[i] *= later
        probability /= probability.sum(axis=1, keepdims=True)
        share = min(_LEARNING * n, 0.5)
        self._usual = (1 - share) * self._usual + share * np.maximum(probability.mean(axis=0), 1e-3)
        self._usual /= self._usual.sum()
        return np.asarray(probability @ (1.0 / _FACTORS))
