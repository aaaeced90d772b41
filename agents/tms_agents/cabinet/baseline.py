"""The resting level of every cell: an average with a memory short against creep and long against placing a thing."""

from __future__ import annotations

import numpy as np

from tms_agents.cabinet.blocks import Block
from tms_agents.cabinet.geometry import Array


class Level:
    """Mean (k,) and its variance (k,), weighted by how quiet each block was, forgetting exponentially.

    Zero drift and creep are followed because old blocks are forgotten; nothing is followed while the load changes.
    """

    def __init__(self, cells: int, memory_s: float) -> None:
        self._memory_s = memory_s
        self.mean: Array = np.zeros(cells)
        self.variance: Array = np.zeros(cells)
        self.weight = 0.0
        self.seconds = 0.0

    @property
    def known(self) -> bool:
        return self.weight > 0

    def add(self, block: Block) -> None:
        """Take one block of the resting load."""
        duration = block.end - block.start
        keep = max(0.0, 1.0 - duration / self._memory_s)
        mean, variance = block.sharp or (block.mean, block.variance)
        weight = 1.0 / (float(np.add.reduce(variance)) / len(variance))
        self.weight = keep * self.weight + weight
        share = weight / self.weight
        self.mean = self.mean + share * (mean - self.mean)
        self.variance = (1 - share) ** 2 * self.variance + share**2 * variance
        self.seconds = keep * self.seconds + duration

    def set(self, mean: Array, variance: Array) -> None:
        """Begin with what an earlier run knew; it counts as one block."""
        self.mean, self.variance = mean.copy(), variance.copy()
        self.weight = 1.0 / float(max(variance.mean(), 1e-9))

    def loosen(self, variance: Array) -> None:
        """The level may have changed by itself since (a gap in the samples)."""
        self.variance = self.variance + variance
        self.weight = 1.0 / float(max(self.variance.mean(), 1e-9))
