"""The laboratory's cabinet algorithm as it was published: the yardstick for ours, with its defects.

After the description of the Intelligent Board System of ROS-TMS (Kyushu University): four cells every 20 ms, one tag
reader, an event when both have something to say. Not repaired: the absolute difference in the centre of gravity, no
zero tracking, no time limit for standing still, one missed read is an exit, of two tags that change in one cycle the
second is lost for ever, untagged things are ignored.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
STABLE_G = 60.0  # sum over the cells of the change from one sample to the next
STABLE_SAMPLES = 5
ZERO_SAMPLES = 10
NOTHING_G = 20.0
SIGNATURE_G = 5000.0


@dataclass(frozen=True, slots=True)
class Told:
    """What the laboratory's cabinet publishes of one thing."""

    kind: Literal["in", "out", "move"]
    t: float
    tag: str
    xy: tuple[float, float] | None = None
    weight_g: float | None = None


class LaboratoryCabinet:
    def __init__(self, cells: Sequence[tuple[float, float]]) -> None:
        self._cells = np.asarray(cells, dtype=np.float64)
        self._baseline: Floats | None = None
        self._zero: list[Floats] = []
        self._before: list[float] | None = None
        self._still: list[Floats] = []
        self._read: frozenset[str] = frozenset()
        self._listed: frozenset[str] = frozenset()
        self._inside: dict[str, Floats] = {}  # tag -> what it added to each cell
        self._entering: str | None = None
        self._lifted: str | None = None

    def inventory(self, tags: frozenset[str]) -> None:
        """The reader's last round; it is looked at when the weight stands still."""
        self._read = tags

    def load(self, t: float, grams: Floats) -> list[Told]:
        """One sample of the cells. A cycle is over when five in a row have stood still."""
        if self._baseline is None:
            self._zero.append(grams)
            if len(self._zero) == ZERO_SAMPLES:
                self._baseline = np.mean(self._zero, axis=0)
            return []
        now = grams.tolist()
        before, self._before = self._before, now
        if before is None or not sum(abs(a - b) for a, b in zip(now, before, strict=True)) < STABLE_G:
            self._still.clear()
            return []
        self._still.append(grams)
        if len(self._still) < STABLE_SAMPLES:
            return []
        average = np.mean(self._still, axis=0)
        self._still.clear()
        difference = average - self._baseline
        if abs(difference.sum()) < NOTHING_G:
            return self._cycle(t, None)
        self._baseline = average
        return self._cycle(t, difference)

    @property
    def inside(self) -> tuple[str, ...]:
        """Tags of what it holds to be inside."""
        return tuple(self._inside)

    def _cycle(self, t: float, difference: Floats | None) -> list[Told]:
        told = self._tags(t)
        if difference is not None:
            told += self._weight(t, difference)
        return told

    def _tags(self, t: float) -> list[Told]:
        """The first tag that came or went; the list is overwritten, so another one is never noticed."""
        came, went = sorted(self._read - self._listed), sorted(self._listed - self._read)
        self._listed = self._read
        if came:
            self._entering = came[0]
        elif went:
            tag = went[0]
            self._entering = None if self._entering == tag else self._entering
            self._lifted = None if self._lifted == tag else self._lifted
            if self._inside.pop(tag, None) is not None:
                return [Told("out", t, tag)]
        return []

    def _weight(self, t: float, difference: Floats) -> list[Told]:
        weight = float(difference.sum())
        if weight < 0:
            self._lifted = self._most_like(difference)
            return []
        if self._entering is not None:
            tag, kind, self._entering = self._entering, "in", None
        elif self._lifted is not None:
            tag, kind, self._lifted = self._lifted, "move", None
        else:
            return []
        self._inside[tag] = difference
        x, y = (np.abs(difference) @ self._cells / abs(weight)).tolist()
        return [Told("in" if kind == "in" else "move", t, tag, (x, y), weight)]

    def _most_like(self, difference: Floats) -> str | None:
        """The thing whose stored difference is nearest, cell by cell and without signs."""
        apart = {tag: float(np.abs(np.abs(stored) - np.abs(difference)).sum()) for tag, stored in self._inside.items()}
        tag = min(apart, key=apart.__getitem__, default=None)
        return tag if tag is not None and apart[tag] < SIGNATURE_G else None
