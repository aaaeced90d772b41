"""Vibration near a multiple of the sampling rate: it looks like a slow swing of the load, and no average removes it.

Bends of means over a third and over two thirds of a second, which see neither a level nor a steady drift, are compared
with what white noise leaves of them. Only what happens near the resting level counts, not a load that comes or goes.
"""

from __future__ import annotations

from collections import deque

import numpy as np

from tms_agents.cabinet.geometry import Array

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
    """``push`` blocks; ``variance`` (k,) g^2 is to be added to that of every block."""

    def __init__(self, cells: int) -> None:
        self.variance: Array = np.zeros(cells)
        self._cells = cells
        self._now = self._quiet = 0.0
        self._group: list[tuple[Array, Array]] = []
        self._means: deque[tuple[Array, Array]] = deque(maxlen=3 * max(_SCALES))
        self._bends: list[deque[tuple[Array, Array, float]]] = [deque(maxlen=_BENDS) for _ in _SCALES]

    @property
    def shaking(self) -> bool:
        """Whether a compressor, say, shakes the board: its tones may also be where no average removes them."""
        return self._now > _SHAKING * self._quiet > 0.0

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
            while bends and t - bends[0][2] > _MEMORY_S:
                bends.popleft()
        self._group.append((mean, white))
        if len(self._group) < _GROUP:
            return
        means, whites = (np.array(values) for values in zip(*self._group, strict=True))
        self._group.clear()
        self._means.append((means.mean(axis=0), whites.mean(axis=0) / _GROUP))
        largest = np.zeros(self._cells)
        for scale, bends in zip(_SCALES, self._bends, strict=True):
            if len(self._means) >= 3 * scale:
                newest = list(self._means)[-3 * scale :]
                parts = np.array([mean for mean, _ in newest]).reshape(3, scale, -1).mean(axis=1)
                noise = np.mean([white for _, white in newest], axis=0) / scale
                bends.append(((parts[0] - 2 * parts[1] + parts[2]) ** 2 / 6, noise, t))
            if len(bends) >= _LEAST:
                squares, noises = np.array([bend[0] for bend in bends]), np.array([bend[1] for bend in bends])
                white = noises.mean(axis=0)
                ratio = float(np.median((squares / noises).mean(axis=1))) / _BIAS
                if ratio > _CHANCE:
                    own = np.median(squares, axis=0) / _BIAS_OF_ONE - white
                    largest = np.maximum(largest, np.maximum(own, _SHARE * (ratio - 1) * white))
        self.variance = _TOGETHER * largest
