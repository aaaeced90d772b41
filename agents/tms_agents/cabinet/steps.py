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
from tms_agents.cabinet.loudness import Loudness
from tms_agents.cabinet.placing import Way
from tms_agents.cabinet.settings import EstimatorSettings
from tms_agents.cabinet.steady import average, chi_square_limit, restlessness, steady_tail

_CHANGING_BLOCKS = 1000
#: Blocks remembered before a change.
_HISTORY_BLOCKS = 75
#: Longer without a sample, and something may have happened meanwhile; it is noticed within as much.
_GAP_S = 0.4
#: Loudness is judged for so many blocks at a time, knowing so many before and after them.
_JUDGED, _CONTEXT = 6, 3


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
    #: How it went from one to the other: block means (n, k) above the old level, and their variances.
    path: Array
    path_variance: Array
    #: Scatter of the steady blocks along the change, relative to noise.
    restless: float
    #: All of it, block by block; None for what is no step of the load.
    way: Way | None = None
    #: Nothing was measured from then to ``onset``: it may have come at any time between.
    unwatched_since: float | None = None

    @property
    def weight_g(self) -> float:
        return float(self.change.sum())

    @property
    def earliest(self) -> float:
        """When it may have begun."""
        return self.onset if self.unwatched_since is None else self.unwatched_since


class StepDetector:
    """Feed blocks; a returned step must be answered by ``accept``, ``hold`` or ``ignore`` before the next block."""

    def __init__(self, cells: int, settings: EstimatorSettings) -> None:
        self._settings, self._cells = settings, cells
        self.level = Level(cells, settings.level_memory_s)
        self._recent: deque[Block] = deque()
        self._history: deque[Block] = deque(maxlen=_HISTORY_BLOCKS)
        self._loudness = Loudness()
        self._resting_blocks = 0
        #: The end of the newest block, and the newest gap between two; what was before the first nobody knows.
        self._until, self._gap = 0.0, (0.0, 0.0)
        #: Since when the load rests at its level, or rested there last.
        self.since = 0.0
        self._changed: list[Block] | None = None
        self._offered: tuple[Step, list[Block]] | None = None
        self._whole_limit = chi_square_limit(settings.departure_sd, cells) / settings.departure_sd**2

    @property
    def resting(self) -> bool:
        return self._changed is None

    @property
    def unwatched_since(self) -> float | None:
        """Where samples were missing when the load left its level: since when."""
        start, end = self._gap
        return start if self._changed and 0.0 <= self._changed[0].start - end < _GAP_S else None

    def push(self, block: Block) -> Step | None:
        """Take one block; a step if the load is steady at another level."""
        if block.start - self._until > _GAP_S:
            self._gap = (self._until, block.start)
        self._until = block.end
        self._history.append(block)
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
        self._history.clear()
        self._resting_blocks = 0

    def accept(self, step: Step) -> None:
        """``step`` is explained: its steady load is the resting level from now on."""
        assert self._offered is not None and self._changed is not None
        steady = self._offered[1]
        after = [block for block in self._changed if block.start >= step.now]
        self._start_resting(steady)
        if after:
            self._changed, self._offered = after, None
            self._history.extend(after)

    def hold(self, step: Step) -> None:
        """``step`` is not explained yet: offer it again with more samples, or with what comes after it."""

    def ignore(self, step: Step) -> None:
        """``step`` is nothing to be told of by itself: go on waiting for the end of the change."""
        self._offered = None

    # --- at rest

    def _rest(self, block: Block) -> None:
        self._recent.append(block)
        self._resting_blocks += 1
        self._judge(self._recent)
        if not (self.level.known or self._begin()) or self._departed():
            return
        lag = min(self._settings.level_lag_s / self._settings.block_s, self._resting_blocks / 2)
        while len(self._recent) > max(lag, 1) and self._recent[0].sharp is not None:
            self.level.add(self._recent.popleft())

    def _begin(self) -> bool:
        """The first two blocks that agree are a level: what follows may be a change already."""
        while len(self._recent) > 2:
            first, second = self._recent[0], self._recent[1]
            apart = (first.mean - second.mean) ** 2 / (first.variance + second.variance)
            self._recent.popleft()
            if apart.max() < self._settings.departure_sd**2:
                self._recent.popleft()
                self.level.add(first)
                self.level.add(second)
                return True
        return False

    def _departed(self) -> bool:
        blocks = list(self._recent)
        count = np.arange(1, len(blocks) + 1)[:, None]
        means = np.add.accumulate(np.array([b.mean for b in reversed(blocks)])) / count - self.level.mean
        variances = np.add.accumulate(np.array([b.variance for b in reversed(blocks)])) / count**2 + self.level.variance
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

    def _judge(self, blocks: Sequence[Block], *, all_of_them: bool = False) -> None:
        """Find how loud the newest of ``blocks`` were that this is not known of."""
        known = next((i for i in range(len(blocks) - 1, -1, -1) if blocks[i].sharp is not None), -1)
        if len(blocks) - 1 - known < (1 if all_of_them else _JUDGED + _CONTEXT):
            return
        # The newest ones are judged again when what follows them is known.
        kept = [block.sharp for block in blocks]
        first = max(known + 1 - (_JUDGED if all_of_them else 2 * _CONTEXT), 0)
        self._loudness.sharpen(list(blocks)[first:])
        if not all_of_them:
            for block, sharp in zip(list(blocks)[: max(known + 1 - _CONTEXT, 0)], kept, strict=False):
                block.sharp = sharp

    def _start_resting(self, blocks: Sequence[Block]) -> None:
        self.level = Level(self._cells, self._settings.level_memory_s)
        half = len(blocks) // 2
        for block in blocks[:half]:
            self.level.add(block)
        self._recent = deque(blocks[half:])
        self._history = deque(blocks, maxlen=_HISTORY_BLOCKS)
        self._resting_blocks = len(blocks)
        self.since = blocks[0].start
        self._changed, self._offered = None, None

    # --- while it changes

    def _settle(self) -> Step | None:
        settings, blocks = self._settings, self._changed
        assert blocks is not None
        steady = steady_tail(list(self._history), self.level.mean, self.level.variance, settings)
        if not steady:
            return None
        steady = [block for block in steady if block.start >= blocks[0].start]
        if self._offered is not None and steady[0].start >= self._offered[0].now:
            # The load went on from a plateau that was on offer: that one comes first, and finally.
            return self._offered[0]
        self._judge(steady, all_of_them=True)
        mean, variance = average(steady)
        change, variance = mean - self.level.mean, variance + self.level.variance
        way = [block for block in blocks if block.start < steady[0].start]
        step = Step(
            onset=blocks[0].start,
            settled=steady[0].start,
            now=steady[-1].end,
            change=change,
            variance=variance,
            before=self.level.mean,
            before_variance=self.level.variance,
            path=np.array([block.mean for block in way]).reshape(-1, self._cells) - self.level.mean,
            path_variance=np.array([block.variance for block in way]).reshape(-1, self._cells),
            restless=restlessness(steady, change),
            way=self._way([*way, *steady], len(way)),
            unwatched_since=self.unwatched_since,
        )
        total = step.weight_g**2 / float(variance.sum())
        score = max(total, float((change**2 / variance).sum()) / self._whole_limit)
        seconds = step.now - step.settled
        if score >= settings.change_sd**2:
            self._offered = (step, steady)
            return step
        if score < 0.6 * settings.change_sd**2:
            # Back where it was: the old level goes on, without what happened in between.
            self._recent = deque(steady)
            self._changed, self._offered = None, None
        elif seconds > settings.level_lag_s:
            self._start_resting(steady)  # too little to be a thing: the zero has moved
        return None

    def _way(self, blocks: list[Block], tail: int) -> Way:
        first = max(len(blocks) - _HISTORY_BLOCKS, 0)
        blocks = blocks[first:]
        means, variances = zip(*(block.sharp or (block.mean, block.variance) for block in blocks), strict=True)
        return Way(
            onset=blocks[0].start,
            now=blocks[-1].end,
            times=np.array([0.5 * (block.start + block.end) for block in blocks]),
            means=np.array(means) - self.level.mean,
            variances=np.array(variances),
            tail=max(tail - first, 0),
            before=self.level.variance,
        )

    def is_final(self, step: Step) -> bool:
        """Whether the load has left the plateau of ``step`` already, so that it cannot be held any longer."""
        return self._changed is not None and bool(self._changed) and self._changed[-1].end > step.now + 1e-9
