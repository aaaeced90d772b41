"""The noise of each cell, learned while running: nothing about it is configured.

Second differences of the samples see neither the load nor its slow changes. Their slow average gives every cell its own
level; the median over the last blocks gives a common factor that follows radio fields and vibration within a third of
a second, and that one step of the load cannot move. What blocks scatter beyond that white noise is learned too.
The first blocks wait for each other: one of them cannot tell noise from a thing that is being put.
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
#: Variance of a block of which nothing is known, g^2.
_UNKNOWN_G2 = 100.0


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
        self._waiting: list[tuple[Block, list[float]]] = []
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

    def learn(self, block: Block, samples: Sequence[Sequence[float]]) -> list[Block]:
        """Look at a block and its samples (with up to two before them): blocks with the variance of their means.

        None while it listens to the first ones, then all of those, and from then on the block itself.
        """
        squares = _second_differences(samples)
        if math.isnan(self._variance[0]):
            self._waiting.append((block, squares))
            return self._begin() if len(self._waiting) == _RECENT else []
        if squares:
            self._learn_white(squares, block.end - block.start + 1e-3)
        self._judge(block)
        return [block]

    def _begin(self) -> list[Block]:
        """Noise is what most of the first blocks show: the others may hold a step of the load."""
        blocks = [block for block, _ in self._waiting]
        rows = [self._floored(squares) for _, squares in self._waiting if squares]
        self._waiting.clear()
        if not rows:  # never three samples in a row: nobody knows the noise
            for block in blocks:
                block.variance = block.unit = np.full(len(block.mean), _UNKNOWN_G2)
            return blocks
        floor = self._settings.noise_floor_g**2
        self._variance = [max(sorted(one)[len(one) // 2] / _MEDIAN_BIAS, floor) for one in zip(*rows, strict=True)]
        for row in rows:
            self._recent.append(self._ratio(row))
        self._age = min(blocks[-1].end - blocks[0].start, self._settings.noise_memory_s)
        for block in blocks:
            self._judge(block)
        return blocks

    def _judge(self, block: Block) -> None:
        """Fill in the variance of a block, and learn what blocks scatter beyond white noise."""
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
        self._waiting.clear()
        self._means.clear()
        self._bends.clear()

    def _learn_white(self, squares: list[float], seconds: float) -> None:
        floor = self._settings.noise_floor_g**2
        squares = self._floored(squares)
        self._recent.append(self._ratio(squares))
        self._age = min(self._age + seconds, self._settings.noise_memory_s)
        # At the start the average of all so far, later an exponential one; limited, so that a step is no noise.
        share = seconds / self._age if self._age > 0 else 1.0
        factor = max(1.0, self.factor)
        self._variance = [
            max(variance + share * (min(square, 4 * variance * factor) - variance), floor)
            for square, variance in zip(squares, self._variance, strict=True)
        ]

    def _floored(self, squares: list[float]) -> list[float]:
        least = self._settings.noise_floor_g**2 * 0.1
        return [max(square, least) for square in squares]

    def _ratio(self, squares: list[float]) -> float:
        """How loud a block is relative to the usual noise."""
        ratio = 0.0
        for square, variance in zip(squares, self._variance, strict=True):
            ratio += square / variance
        return ratio / len(squares)


def _second_differences(samples: Sequence[Sequence[float]]) -> list[float]:
    """Variance of each cell's white noise by the second differences of samples (n, k); nothing for fewer than three."""
    if len(samples) < 3:
        return []
    squares = [0.0] * len(samples[0])
    for a, b, c in zip(samples, samples[1:], samples[2:], strict=False):
        for i, (x, y, z) in enumerate(zip(a, b, c, strict=True)):
            second = z - 2 * y + x
            squares[i] += second * second
    return [square / (len(samples) - 2) / 6 for square in squares]
