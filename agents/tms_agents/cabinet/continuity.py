"""Zeros that jump when a board or scale is switched off and on again, kept from looking like things put or taken."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence
from operator import add

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
#: The laboratory's own threshold for a thing.
_SMALL_SUM_G = 20.0
#: Fewer samples tell no level (some may be from before the interruption), unless the device is as slow as that.
_FEW, _SLOW_S = 10, 2.0


class Continuity:
    """Adds to every cell what makes the load after an interruption go on where it was.

    ``interrupted`` is called when the device stopped delivering. The first ``settle_s`` seconds after that are held
    back. The zero is corrected where their median differs from the level before by at most ``small_g`` in every cell
    and 20 g in sum, or, for a device that ``zeroes_itself`` at power-on, where it shows about nothing at all. Any
    other difference is what people did meanwhile, and is left to the estimator.
    """

    def __init__(
        self, cells: int, *, zeroes_itself: bool, settle_s: float = 0.3, small_g: float = 15.0, memory_s: float = 0.5
    ) -> None:
        self._zeroes_itself, self._settle_s, self._small_g, self._memory_s = (
            zeroes_itself,
            settle_s,
            small_g,
            memory_s,
        )
        #: Grams added to each cell.
        self.shift = [0.0] * cells
        self._level: Floats | None = None
        self._late: deque[tuple[float, list[float]]] = deque()
        self._held: list[Sequence[float]] = []
        self._held_since: float | None = None
        self._waiting = False

    @property
    def level(self) -> Floats | None:
        """What the cells showed of late, shape (k,); None: nothing is known yet."""
        # The median: what a cell showed while it was stuck is forgotten at once, not bit by bit.
        return np.median([grams for _, grams in self._late], axis=0) if self._late else self._level

    def interrupted(self) -> None:
        self._level = self.level
        self._late.clear()
        self._waiting, self._held, self._held_since = True, [], None

    def take(self, t: float, grams: Sequence[float]) -> list[float] | None:
        """Corrected grams of every cell; None while held back. Samples with NaN pass as they are."""
        if not all(map(math.isfinite, grams)):
            return list(map(add, grams, self.shift))
        if self._waiting:
            if self._held_since is None:
                self._held_since = t
            self._held.append(grams)
            long = t - self._held_since
            if long < self._settle_s or (len(self._held) < _FEW and long < _SLOW_S):
                return None
            self._resume(np.median(self._held, axis=0))
        corrected = list(map(add, grams, self.shift))
        self._late.append((t, corrected))
        while t - self._late[0][0] > self._memory_s:
            self._late.popleft()
        return corrected

    def _resume(self, now: Floats) -> None:
        self._waiting, self._held = False, []
        level = self.level
        if level is None:
            return
        jump = now + self.shift - level
        # Zeros jump each for itself, up and down; a thing loads all cells in the same direction.
        drifted = np.abs(jump).max() <= self._small_g and abs(jump.sum()) <= _SMALL_SUM_G
        if drifted or (self._zeroes_itself and np.abs(now).max() <= self._small_g):
            self.shift = (level - now).tolist()

    def to_dict(self) -> dict[str, list[float] | None]:
        level = self.level
        return {"shift": self.shift, "level": None if level is None else level.tolist()}

    def restore(self, shift: Sequence[float], level: Sequence[float] | None) -> None:
        """Go on from a former run: the device may have been switched off since.

        Raises:
            ValueError: another number of cells.
        """
        if len(shift) != len(self.shift) or (level is not None and len(level) != len(self.shift)):
            raise ValueError("another number of cells")
        self.shift = [float(one) for one in shift]
        self._late.clear()
        self._level = None if level is None else np.array(level, dtype=float)
        self.interrupted()
