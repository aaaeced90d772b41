"""Vibration near a multiple of the sampling rate: it looks like a slow swing of the load, and no average removes it.

Bends of means over a third and over two thirds of a second, which see neither a level nor a steady drift, are compared
with what white noise leaves of them. Only what happens near the resting level counts, not a load that comes or goes.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from statistics import median
from typing import NamedTuple

import numpy as np

from tms_agents.cabinet.baseline import Level
from tms_agents.cabinet.blocks import Block
from tms_agents.cabinet.geometry import Array

#: A block so near the resting level tells how much it wobbles.
_NEAR_G = 50.0
#: Blocks of one mean, means that are averaged for each scale, bends in the running median and least number of them.
_GROUP, _SCALES, _BENDS, _LEAST = 4, (1, 2), 14, 4
#: Median of such a mean of squares relative to its mean, the same for one cell alone, how large one must be to be more
#: than chance, and what each cell has at least of what all have together.
_BIAS, _BIAS_OF_ONE, _CHANCE, _SHARE = 0.85, 0.6, 1.8, 0.3
#: Blocks that swing together.
_TOGETHER = 6.0
#: How long a bend counts, s.
_MEMORY_S = 12.0
#: Something shakes the board when its noise over some seconds is so much above that of its quiet times (variances).
_SHAKING, _NOW_S, _QUIET_S = 1.3, 6.0, 900.0


class Wobble:
    """``take`` blocks, one by one; ``variance`` (k,) g^2 is what is added to that of every block."""

    def __init__(self, cells: int) -> None:
        self.variance: Array = np.zeros(cells)
        self._cells = cells
        self._now = self._quiet = 0.0
        self._group: list[tuple[list[float], list[float]]] = []
        self._means: deque[tuple[list[float], list[float]]] = deque(maxlen=3 * max(_SCALES))
        self._bends: list[deque[_Bend]] = [deque(maxlen=_BENDS) for _ in _SCALES]

    @property
    def shaking(self) -> bool:
        """Whether a compressor, say, shakes the board: its tones may also be where no average removes them."""
        return self._now > _SHAKING * self._quiet > 0.0

    def take(self, block: Block, level: Level) -> None:
        """Learn from a block, and add to its variance what wobbles."""
        near = level.known and float(np.abs(block.mean - level.mean).max()) < _NEAR_G
        self.hear(float(block.variance.mean()) * block.n, block.end - block.start)
        self.push(block.end, block.mean, block.variance, near)
        block.variance = block.variance + self.variance

    def hear(self, noise: float, seconds: float) -> None:
        """The variance of a sample over some time, g^2."""
        if self._quiet == 0.0:
            self._now = self._quiet = noise
        self._now += min(seconds / _NOW_S, 1.0) * (noise - self._now)
        lasts = _NOW_S if self._now < self._quiet else _QUIET_S
        self._quiet += min(seconds / lasts, 1.0) * (self._now - self._quiet)

    def push(self, t: float, mean: Array, white: Array, near: bool) -> None:
        """A block's mean (k,) and the variance that white noise gives it; ``near`` the resting level or far off."""
        if not near:
            self._group.clear()
            self._means.clear()
            return
        for bends in self._bends:
            while bends and t - bends[0].t > _MEMORY_S:
                bends.popleft()
        self._group.append((mean.tolist(), white.tolist()))
        if len(self._group) < _GROUP:
            return
        means, whites = zip(*self._group, strict=True)
        self._means.append((_average(means), [one / _GROUP for one in _average(whites)]))
        self._group.clear()
        largest = [0.0] * self._cells
        for scale, bends in zip(_SCALES, self._bends, strict=True):
            if len(self._means) >= 3 * scale:
                bends.append(_bend(list(self._means)[-3 * scale :], scale, t))
            if len(bends) >= _LEAST:
                white_g2 = _average([bend.noises for bend in bends])
                ratio = median([bend.ratio for bend in bends]) / _BIAS
                if ratio > _CHANCE:
                    for i, least in enumerate(white_g2):
                        own = median([bend.squares[i] for bend in bends]) / _BIAS_OF_ONE - least
                        largest[i] = max(largest[i], own, _SHARE * (ratio - 1) * least)
        self.variance = _TOGETHER * np.array(largest)


class _Bend(NamedTuple):
    """Squares of a bend (g^2) and what white noise makes of them, cell by cell; their mean ratio; when."""

    squares: list[float]
    noises: list[float]
    ratio: float
    t: float


def _bend(newest: Sequence[tuple[list[float], list[float]]], scale: int, t: float) -> _Bend:
    thirds = [_average([mean for mean, _ in newest[i : i + scale]]) for i in range(0, 3 * scale, scale)]
    noises = [one / scale for one in _average([white for _, white in newest])]
    squares, ratio = [], 0.0
    for x, y, z, noise in zip(*thirds, noises, strict=True):
        second = x - 2 * y + z
        squares.append(second * second / 6)
        ratio += squares[-1] / noise
    return _Bend(squares, noises, ratio / len(squares), t)


def _average(rows: Sequence[Sequence[float]]) -> list[float]:
    """Of each column."""
    total = list(rows[0])
    for row in rows[1:]:
        for i, one in enumerate(row):
            total[i] += one
    return [one / len(rows) for one in total]
