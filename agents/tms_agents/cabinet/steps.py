"""Change points of the load: when did it leave its resting level, and when is it steady again?

Departure is a generalised likelihood ratio: over every possible beginning among the newest blocks, the mean since then
is compared with the resting level, both as a whole vector (k degrees of freedom: slides) and as a sum (one degree of
freedom: more power for light things). Steadiness is the homogeneity of the newest blocks relative to the noise of the
moment, so that both adapt to vibration and to the field of a tag reader without any counting of samples.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tms_agents.cabinet.baseline import Level
from tms_agents.cabinet.blocks import Block
from tms_agents.cabinet.geometry import Array
from tms_agents.cabinet.settings import EstimatorSettings

_CHANGING_BLOCKS = 1000


@dataclass(frozen=True, slots=True)
class Step:
    """A steady load that differs from the one before by ``change`` (k,) g with errors of ``variance`` (k,) g^2.

    It left the old level at ``onset`` and is steady since ``settled``; ``now`` is the end of what was averaged.
    """

    onset: float
    settled: float
    now: float
    change: Array
    variance: Array
    #: The old level (k,) g and its variance.
    before: Array
    before_variance: Array

    @property
    def weight_g(self) -> float:
        return float(self.change.sum())


class StepDetector:
    """Feed blocks; a returned step must be answered by ``accept``, ``hold`` or ``ignore`` before the next block."""

    def __init__(self, cells: int, settings: EstimatorSettings) -> None:
        self._settings, self._cells = settings, cells
        self.level = Level(cells, settings.level_memory_s)
        self._recent: deque[Block] = deque()
        self._resting_blocks = 0
        self._changed: list[Block] | None = None
        self._offered: tuple[Step, list[Block]] | None = None
        self._whole_limit = chi_square_limit(settings.departure_sd, cells) / settings.departure_sd**2

    @property
    def resting(self) -> bool:
        return self._changed is None

    def push(self, block: Block) -> Step | None:
        """Take one block; a step if the load is steady at another level."""
        if self._changed is None:
            self._rest(block)
            return None
        self._changed.append(block)
        del self._changed[:-_CHANGING_BLOCKS]
        return self._settle()

    def resting_level(self) -> tuple[Array, Array, float]:
        """Best mean (k,), variance (k,) and seconds of the load at rest, the newest blocks included."""
        level = Level(self._cells, self._settings.level_memory_s)
        level.mean, level.variance, level.seconds = self.level.mean, self.level.variance, self.level.seconds
        level.weight = self.level.weight
        for block in list(self._recent)[:-1]:
            level.add(block)
        return level.mean, level.variance, level.seconds

    def interrupt(self) -> None:
        """Samples are missing from here on, and the newest ones are not to be believed: look at the level afresh."""
        if self.level.known:
            self._changed, self._offered = [], None
        self._recent.clear()
        self._resting_blocks = 0

    def accept(self, step: Step) -> None:
        """``step`` is explained: its steady load is the resting level from now on."""
        assert self._offered is not None and self._changed is not None
        steady = self._offered[1]
        after = [block for block in self._changed if block.start >= step.now]
        self._start_resting(steady)
        if after:
            self._changed, self._offered = after, None

    def hold(self, step: Step) -> None:
        """``step`` is not explained yet: offer it again with more samples, or with what comes after it."""

    def ignore(self, step: Step) -> None:
        """``step`` is nothing to be told of by itself: go on waiting for the end of the change."""
        self._offered = None

    # --- at rest

    def _rest(self, block: Block) -> None:
        self._recent.append(block)
        self._resting_blocks += 1
        if self.level.known and self._departed():
            return
        lag = min(self._settings.level_lag_s / self._settings.block_s, self._resting_blocks / 2)
        while len(self._recent) > max(lag, 1):
            self.level.add(self._recent.popleft())

    def _departed(self) -> bool:
        blocks = list(self._recent)
        count = np.arange(1, len(blocks) + 1)[:, None]
        means = np.cumsum([b.mean for b in reversed(blocks)], axis=0) / count - self.level.mean
        variances = np.cumsum([b.variance for b in reversed(blocks)], axis=0) / count**2 + self.level.variance
        score = np.maximum(
            means.sum(axis=1) ** 2 / variances.sum(axis=1), (means**2 / variances).sum(axis=1) / self._whole_limit
        )
        length = int(score.argmax()) + 1
        if score[length - 1] < self._settings.departure_sd**2:
            return False
        # What lies clearly before the beginning still belongs to the old level.
        for old in blocks[: max(len(blocks) - length - 1, 0)]:
            self.level.add(old)
        self._changed, self._offered = blocks[-length:], None
        self._recent.clear()
        return True

    def _start_resting(self, blocks: Sequence[Block]) -> None:
        self.level = Level(self._cells, self._settings.level_memory_s)
        half = len(blocks) // 2
        for block in blocks[:half]:
            self.level.add(block)
        self._recent = deque(blocks[half:])
        self._resting_blocks = len(blocks)
        self._changed, self._offered = None, None

    # --- while it changes

    def _settle(self) -> Step | None:
        settings, blocks = self._settings, self._changed
        assert blocks is not None
        steady = steady_tail(blocks, settings, self.level.mean)
        if not steady:
            return None
        if self._offered is not None and steady[0].start >= self._offered[0].now:
            # The load went on from a plateau that was on offer: that one comes first, and finally.
            return self._offered[0]
        mean, variance = average(steady)
        change, variance = mean - self.level.mean, variance + self.level.variance
        step = Step(
            blocks[0].start, steady[0].start, steady[-1].end, change, variance, self.level.mean, self.level.variance
        )
        total = step.weight_g**2 / float(variance.sum())
        score = max(total, float((change**2 / variance).sum()) / self._whole_limit)
        seconds = step.now - step.settled
        big = abs(step.weight_g) >= settings.min_weight_g or total < settings.change_sd**2
        if score >= settings.change_sd**2 and big:
            self._offered = (step, steady)
            return step
        if score < 0.6 * settings.change_sd**2:
            # Back where it was: the old level goes on, without what happened in between.
            self._recent = deque(steady)
            self._changed, self._offered = None, None
        elif seconds > settings.level_lag_s:
            self._start_resting(steady)  # too little to be a thing: the zero has moved
        return None

    def is_final(self, step: Step) -> bool:
        """Whether the load has left the plateau of ``step`` already, so that it cannot be held any longer."""
        return self._changed is not None and bool(self._changed) and self._changed[-1].end > step.now + 1e-9


def steady_tail(blocks: Sequence[Block], settings: EstimatorSettings, old: Array) -> list[Block]:
    """The longest run of newest blocks without a trend, [] while there is none of ``settle_s``."""
    length, seconds = 0, 0.0
    while length < len(blocks) and seconds < settings.settle_s:
        length += 1
        seconds += blocks[-length].end - blocks[-length].start
        if length < len(blocks):  # blocks are told by their first and last sample: add the pause between them
            seconds += blocks[-length].start - blocks[-length - 1].end
    if seconds < settings.settle_s or length < 2:
        return []
    tail = list(blocks[-length:])
    half = length // 2
    (early, early_var), (late, late_var) = average(tail[:half]), average(tail[half:])
    # A thing that still rocks by some thousandth of its weight is as good as steady.
    variance = early_var + late_var + (0.003 * (late - old)) ** 2
    trend = late - early
    if trend.sum() ** 2 > settings.settle_sd**2 * variance.sum():
        return []
    if (trend**2 / variance).sum() > chi_square_limit(settings.settle_sd, len(trend)):
        return []
    mean, mean_var = average(tail)
    for block in reversed(blocks[:-length]):
        distance, both = block.mean - mean, block.variance + mean_var
        if distance.sum() ** 2 > 6.0 * both.sum() or (distance**2 / both).sum() > chi_square_limit(2.5, len(trend)):
            break
        tail.insert(0, block)
        mean, mean_var = average(tail)
    return tail


def average(blocks: Sequence[Block]) -> tuple[Array, Array]:
    """Mean (k,) weighted by quietness, and its variance (k,)."""
    variances = np.array([b.variance for b in blocks])
    weights = 1.0 / variances.mean(axis=1)
    weights /= weights.sum()
    return weights @ np.array([b.mean for b in blocks]), (weights**2) @ variances


def chi_square_limit(sd: float, freedom: int) -> float:
    """Value of chi-square with ``freedom`` degrees that is as improbable as ``sd`` deviations (Wilson-Hilferty)."""
    share = 2.0 / (9.0 * freedom)
    # Two-sided deviations of one variable and the one-sided tail of chi-square: half a deviation less is close enough.
    return float(freedom * (1.0 - share + (sd - 0.15) * np.sqrt(share)) ** 3)
