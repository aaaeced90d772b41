"""The noise of each cell, learned while running: nothing about it is configured.

Second differences of the samples see neither the load nor its slow changes. Their slow average gives every cell its own
level; the median over the last blocks gives a common factor that follows radio fields and vibration within a third of
a second, and that one step of the load cannot move. What blocks scatter beyond that white noise is learned too.
"""

from __future__ import annotations

from collections import deque

import numpy as np

from tms_agents.cabinet.blocks import Block
from tms_agents.cabinet.geometry import Array
from tms_agents.cabinet.settings import EstimatorSettings

#: Blocks in the running median, and the median of such a mean of squares relative to its mean.
_RECENT, _MEDIAN_BIAS = 7, 0.94
#: The same for the bends of the block means, and how large they must be to be more than chance.
_BENDS, _BEND_BIAS, _SHAKING = 9, 0.8, 1.8


class Noise:
    """Variance of one sample of each cell, (k,) g^2, and how it is just now."""

    def __init__(self, cells: int, settings: EstimatorSettings) -> None:
        self._settings = settings
        self.variance: Array = np.full(cells, np.nan)
        #: Slow scatter of block means relative to white noise, at least 1.
        self.excess = 1.0
        self._age = 0.0
        self._recent: deque[float] = deque(maxlen=_RECENT)
        self._means: deque[Array] = deque(maxlen=2)
        self._bends: deque[float] = deque(maxlen=_BENDS)

    @property
    def sd_g(self) -> Array:
        """Standard deviation of one sample of each cell now, (k,) g."""
        return np.sqrt(self.variance * self.factor)

    @property
    def factor(self) -> float:
        """How much larger the variance is now than usually."""
        return max(sorted(self._recent)[len(self._recent) // 2] / _MEDIAN_BIAS, 0.05) if self._recent else 1.0

    def learn(self, block: Block, samples: Array) -> None:
        """Look at a block and its samples (with up to two before them), and fill in the variance of its mean."""
        seconds = samples[2:] - 2 * samples[1:-1] + samples[:-2]
        if len(seconds):
            self._learn_white((seconds**2).mean(axis=0) / 6, block.end - block.start + 1e-3)
        if np.isnan(self.variance).any():
            block.variance = block.unit = np.full(len(block.mean), 100.0)
            return
        white = self.variance * self.factor / block.n
        if len(self._means) == 2:
            bend = (block.mean - 2 * self._means[1] + self._means[0]) ** 2 / 6
            self._bends.append(float((bend / white).mean()))
            scatter = float((((block.mean - self._means[0]) ** 2) / (2 * white)).mean())
            # Steps are rare and large: what is beyond a generous limit counts as a step.
            share = min(block.end - block.start, 1.0) / self._settings.noise_memory_s
            self.excess = max(1.0, self.excess + share * (min(scatter, 4 * self.excess) - self.excess))
        self._means.append(block.mean)
        slow = max(self.excess, self._shaking())
        block.variance, block.unit = white * slow, self.variance * slow

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

    def _learn_white(self, square: Array, seconds: float) -> None:
        floor = self._settings.noise_floor_g**2
        square = np.maximum(square, floor * 0.1)
        if np.isnan(self.variance).any():
            self.variance = np.maximum(square, floor)
        ratio = float((square / self.variance).mean())
        self._recent.append(ratio)
        self._age = min(self._age + seconds, self._settings.noise_memory_s)
        # At the start the average of all so far, later an exponential one; limited, so that a step is no noise.
        share = seconds / self._age if self._age > 0 else 1.0
        limited = np.minimum(square, 4 * self.variance * max(1.0, self.factor))
        self.variance = np.maximum(self.variance + share * (limited - self.variance), floor)
