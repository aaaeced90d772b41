"""Vibration near a multiple of the sampling rate: it looks like a slow swing of the load, and no average removes it.

Bends of means over a third and over two thirds of a second, which see neither a level nor a steady drift, are compared
with what white noise leaves of them. Only what happens near the resting level counts; a load that comes or goes does not.
"""

from __future__ import annotations

from collections import deque

import numpy as np

from tms_agents.cabinet.geometry import Array

#: Blocks of one mean, means that are averaged for each scale, bends in the running median and least number of them.
_GROUP, _SCALES, _BENDS, _LEAST = 4, (1, 2), 14, 4
#: Median of such a mean of squares relative to its mean, and how large one must be to be more than chance.
_BIAS, _CHANCE = 0.85, 1.8
#: Blocks that swing together.
_TOGETHER = 6.0
_MEMORY_S = 12.0


class Wobble:
    """``push`` blocks; ``variance`` (k,) g^2 is to be added to that of every block."""

    def __init__(self, cells: int) -> None:
        self.variance: Array = np.zeros(cells)
        self._cells = cells
        self._group: list[tuple[Array, Array]] = []
        self._means: deque[tuple[Array, Array]] = deque(maxlen=3 * max(_SCALES))
        self._bends: list[deque[tuple[Array, Array, float]]] = [deque(maxlen=_BENDS) for _ in _SCALES]

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
                ratio = float(np.median((squares / noises).mean(axis=1))) / _BIAS
                if ratio > _CHANCE:
                    largest = np.maximum(largest, np.maximum(np.median(squares, axis=0) / 0.6 - noises.mean(axis=0), 0.3 * (ratio - 1) * noises.mean(axis=0)))
        self.variance = _TOGETHER * largest
