"""The noise of each cell, learned while running: nothing about it is configured.

Second differences of the samples see neither the load nor its slow changes. Their slow average gives every cell its own
level; the median over the last blocks gives a common factor that follows radio fields and vibration within a third of
a second, and that one step of the load cannot move. What blocks scatter beyond that white noise is learned too.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence

import numpy as np

from tms_agents.cabinet.blocks import Block
from tms_agents.cabinet.geometry import Array
from tms_agents.cabinet.settings import EstimatorSettings

#: Blocks in the running median, and the median of such a mean of squares relative to its mean.
_RECENT, _MEDIAN_BIAS = 7, 0.94
#: The same for the bends of the block means, and how large they must be to be more than chance.
_BENDS, _BEND_BIAS, _SHAKING = 9, 0.8, 1.8


class Noise:
    """Variance of one sample of each cell, (k,) g^2, and how it is just now.

    In plain numbers: for a handful of cells these are several times as fast as arrays.
    """

    def __init__(self, cells: int, settings: EstimatorSettings) -> None:
        self._settings = settings
        self._variance = [math.nan] * cells
        #: Slow scatter of block means relative to white noise, at least 1.
        self.excess = 1.0
        self._age = 0.0
        self._recent: deque[float] = deque(maxlen=_RECENT)
        self._means: deque[list[float]] = deque(maxlen=2)
        self._bends: deque[float] = deque(maxlen=_BENDS)

    @property
    def variance(self) -> Array:
        """Usual variance of one sample of each cell, (k,) g^2; NaN until it is known."""
        return np.array(self._variance)

    @variance.setter
    def variance(self, variance: Array) -> None:
        self._variance = variance.tolist()

    @property
    def sd_g(self) -> Array:
        """Standard deviation of one sample of each cell now, (k,) g."""
        return np.sqrt(self.variance * self.factor)

    @property
    def factor(self) -> float:
        """How much larger the variance is now than usually."""
        return max(sorted(self._recent)[len(self._recent) // 2] / _MEDIAN_BIAS, 0.05) if self._recent else 1.0

    def learn(self, block: Block, samples: Sequence[Sequence[float]]) -> None:
        """Look at a block and its samples (with up to two before them), and fill in the variance of its mean."""
        squares = [0.0] * len(self._variance)
        for a, b, c in zip(samples, samples[1:], samples[2:], strict=False):
            for i, (x, y, z) in enumerate(zip(a, b, c, strict=True)):
                second = z - 2 * y + x
                squares[i] += second * second
        if (count := len(samples) - 2) > 0:
            self._learn_white([square / count / 6 for square in squares], block.end - block.start + 1e-3)
        if any(map(math.isnan, self._variance)):
            block.variance = block.unit = np.full(len(block.mean), 100.0)
            return
        factor, n, mean = self.factor, block.n, block.mean.tolist()
        white = [one * factor / n for one in self._variance]
        if len(self._means) == 2:
            bend = scatter = 0.0
            for x, y, z, one in zip(*self._means, mean, white, strict=True):
                second, step = z - 2 * y + x, z - x
                bend += second * second / 6 / one
                scatter += step * step / (2 * one)
            self._bends.append(bend / len(mean))
            # Steps are rare and large: what is beyond a generous limit counts as a step.
            share = min(block.end - block.start, 1.0) / self._settings.noise_memory_s
            limited = min(scatter / len(mean), 4 * self.excess)
            self.excess = max(1.0, self.excess + share * (limited - self.excess))
        self._means.append(mean)
        slow = max(self.excess, self._shaking())
        block.variance = np.array([one * slow for one in white])
        block.unit = np.array([one * slow for one in self._variance])

    def _shaking(self) -> float:
        """Scatter of block means just now relative to white noise, 1 while nothing shakes the board.

        Vibration near a multiple of the sampling rate looks slow, so that the samples themselves hardly show it.
        """
        if len(self._bends) < _BENDS:
            return 1.0
        middle = sorted(self._bends)[_BENDS // 2] / _BEND_BIAS
        return middle if middle > _SHAKING else 1.0

    def interrupt(self) -> None:
        """Samples were left out: the next differences would span the gap."""
        self._means.clear()
        self._bends.clear()

    def _learn_white(self, squares: list[float], seconds: float) -> None:
        floor = self._settings.noise_floor_g**2
        squares = [max(square, floor * 0.1) for square in squares]
        if any(map(math.isnan, self._variance)):
            self._variance = [max(square, floor) for square in squares]
        ratio = 0.0
        for square, variance in zip(squares, self._variance, strict=True):
            ratio += square / variance
        self._recent.append(ratio / len(squares))
        self._age = min(self._age + seconds, self._settings.noise_memory_s)
        # At the start the average of all so far, later an exponential one; limited, so that a step is no noise.
        share = seconds / self._age if self._age > 0 else 1.0
        factor = max(1.0, self.factor)
        self._variance = [
            max(variance + share * (min(square, 4 * variance * factor) - variance), floor)
            for square, variance in zip(squares, self._variance, strict=True)
        ]
