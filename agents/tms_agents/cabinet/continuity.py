"""Zeros that jump when a board or scale is switched off and on again, kept from looking like things put or taken."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
#: The laboratory's own threshold for a thing.
_SMALL_SUM_G = 20.0


class Continuity:
    """Adds to every cell what makes the load after an interruption go on where it was.

    ``interrupted`` is called when the device stopped delivering. The first ``settle_s`` seconds after that are held
    back and averaged. The zero is corrected where that mean differs from the level before by at most ``small_g`` in
    every cell and 20 g in sum, or, for a device that ``zeroes_itself`` at power-on, where it shows about nothing at
    all. Any other difference is what people did meanwhile, and is left to the estimator.
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
        #: Grams added to each cell, and the level of late (None: nothing is known yet), shape (k,).
        self.shift: Floats = np.zeros(cells)
        self.level: Floats | None = None
        self._last_t: float | None = None
        self._held: list[Floats] = []
        self._held_since: float | None = None
        self._waiting = False

    def interrupted(self) -> None:
        self._waiting, self._held, self._held_since, self._last_t = True, [], None, None

    def take(self, t: float, grams: Floats) -> Floats | None:
        """Corrected grams; None while held back. Samples with NaN pass as they are."""
        if not np.isfinite(grams).all():
            return grams + self.shift
        if self._waiting:
            if self._held_since is None:
                self._held_since = t
            self._held.append(grams)
            if t - self._held_since < self._settle_s and len(self._held) < 1000:
                return None
            self._resume(np.mean(self._held, axis=0))
        grams = grams + self.shift
        self._follow(t, grams)
        return grams

    def _resume(self, now: Floats) -> None:
        self._waiting, self._held = False, []
        if self.level is None:
            return
        jump = now + self.shift - self.level
        # Zeros jump each for itself, up and down; a thing loads all cells in the same direction.
        drifted = np.abs(jump).max() <= self._small_g and abs(jump.sum()) <= _SMALL_SUM_G
        if drifted or (self._zeroes_itself and np.abs(now).max() <= self._small_g):
            self.shift = self.level - now

    def _follow(self, t: float, grams: Floats) -> None:
        step = 1.0 if self._last_t is None else min(1.0, max(0.0, t - self._last_t) / self._memory_s)
        self.level = grams.copy() if self.level is None else self.level + step * (grams - self.level)
        self._last_t = t

    def to_dict(self) -> dict[str, list[float] | None]:
        return {"shift": self.shift.tolist(), "level": None if self.level is None else self.level.tolist()}

    def restore(self, shift: Sequence[float], level: Sequence[float] | None) -> None:
        """Go on from a former run: the device may have been switched off since.

        Raises:
            ValueError: another number of cells.
        """
        if len(shift) != len(self.shift) or (level is not None and len(level) != len(self.shift)):
            raise ValueError("another number of cells")
        self.shift = np.array(shift, dtype=float)
        self.level = None if level is None else np.array(level, dtype=float)
        self.interrupted()
