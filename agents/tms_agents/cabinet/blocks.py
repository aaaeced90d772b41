"""From samples to block means, without the samples of cells that cannot be believed.

A cell is unusable while it delivers NaN, is overloaded, or repeats one value for longer than its noise makes credible
(a stuck cell; all cells at once: a board without power). While any cell is unusable there are no blocks: a centre of
gravity needs every cell, and a load that changed meanwhile is found against the old resting level afterwards.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tms_agents.cabinet.geometry import Array
from tms_agents.cabinet.settings import EstimatorSettings

#: Probability that a cell repeats its last value: where learning begins, and its limits.
_REPEAT_START, _REPEAT_LEAST, _REPEAT_MOST = 0.5, 0.15, 0.999
#: A run of the same value that is so improbable (negative log) is suspect, though the cell may still be alive.
_SUSPECT = 3.0
_NOTHING: Array = np.empty(0)


@dataclass(slots=True)
class Block:
    """Mean of ``n`` consecutive samples from ``start`` to ``end`` (s); the noise stage fills in its ``variance``."""

    start: float
    end: float
    n: int
    mean: Array
    variance: Array
    #: The samples themselves (n, k), and the usual variance (k,) of one.
    samples: Array
    unit: Array
    #: Mean and variance with every sample weighted by how quiet its moment was, once that is known.
    sharp: tuple[Array, Array] | None = None


class Blocks:
    """Collects samples; ``unusable`` names the cells (by index) that now stop the flow of blocks."""

    def __init__(self, cells: int, settings: EstimatorSettings) -> None:
        self.unusable: tuple[int, ...] = ()
        self._settings, self._cells = settings, cells
        self._patience = -math.log(settings.stuck_probability)
        self._samples: list[list[float]] = []
        self._start = 0.0
        self._before: deque[list[float]] = deque(maxlen=2)
        self._last = [math.nan] * cells
        self._run = [0] * cells
        self._repeat = [_REPEAT_START] * cells
        #: When each cell began to show its last value.
        self._same_since = [math.inf] * cells

    def push(self, t: float, grams: Sequence[float] | Array) -> tuple[Block, list[list[float]]] | None:
        """Take one sample (k,); a finished block, and its samples (n + 2, k) with the two before them."""
        values = grams.tolist() if isinstance(grams, np.ndarray) else list(grams)
        self.unusable = self._check(t, values)
        if self.unusable:
            self._samples.clear()
            self._before.clear()
            return None
        if not self._samples:
            self._start = t
        self._samples.append(values)
        # Half a period early, so that jitter of the sampling does not make every second block one sample longer.
        lasts, n = t - self._start, len(self._samples)
        if lasts >= 0 and lasts + 1.5 * (lasts / max(n - 1, 1)) < self._settings.block_s:
            return None
        own = np.array(self._samples)
        block = Block(self._start, t, n, np.add.reduce(own, axis=0) / n, _NOTHING, own, _NOTHING)
        samples = [*self._before, *self._samples]
        self._before.extend(self._samples[-2:])
        self._samples = []
        return block, samples

    def frozen(self, since: float) -> bool:
        """Whether a cell has shown nothing but one value from ``since`` on, though it is too early to call it stuck."""
        return any(
            same <= since and run * _surprise(repeat) > _SUSPECT
            for same, run, repeat in zip(self._same_since, self._run, self._repeat, strict=True)
        )

    def _check(self, t: float, values: list[float]) -> tuple[int, ...]:
        if len(values) != self._cells:
            raise ValueError(f"{len(values)} values for {self._cells} cells")
        limit, patience = self._settings.cell_limit_g, self._patience
        bad: list[int] = []
        repeated: list[float] = []  # how surprising that was, of each cell that did
        for i, value in enumerate(values):
            if not -limit <= value <= limit:
                bad.append(i)
                self._run[i] = 0
                self._last[i] = math.nan
            elif value != self._last[i]:
                self._run[i] = 0
                self._last[i] = value
                self._same_since[i] = t
                self._repeat[i] -= 0.003 * self._repeat[i]
            else:
                run = self._run[i] = self._run[i] + 1
                surprise = _surprise(self._repeat[i])
                repeated.append(surprise)
                if run * surprise > patience:
                    bad.append(i)
                elif run * surprise < 0.5 * patience:  # a cell that is perhaps stuck teaches nothing about its noise
                    self._repeat[i] += 0.003 * (1 - self._repeat[i])
        if len(repeated) == self._cells and min(self._run) * sum(repeated) > patience:
            return tuple(range(self._cells))
        return tuple(bad)


def _surprise(repeat: float) -> float:
    """Negative log of how probable it is that a cell repeats its last value."""
    return -math.log(min(max(repeat, _REPEAT_LEAST), _REPEAT_MOST))
