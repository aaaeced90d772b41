"""What the cells show at rest: their zeros and the loads of everything on the board, and how the errors hang together.

A resting level tells the sum of all of them well, and none of them by itself. So zeros and loads are one Gaussian with
all its correlations (a Kalman filter per cell): what a zero took up because a thing was measured badly goes back when
that thing goes, and a zero that was known when the board was empty is still known when many things have come.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import replace
from typing import Any, Self

import numpy as np

from tms_agents.cabinet.geometry import Array
from tms_agents.cabinet.stays import Thing

#: A load is as measured within its own errors, some g, and a share of itself: something light may have been taken for a
#: part of it.
_SHARE, _GRAMS = 0.02, 1.0
#: A stay whose load is said to be another one by more than that is looked at afresh.
_CHANGED_SD, _CHANGED_G = 4.0, 6.0
#: What was measured is wrong if it is off by so many standard deviations of both.
_WRONG_SD = 3.0
#: A stay of which so little is left, and no more than so many g (standard deviation) uncertain, was nothing.
_FADED, _FADED_SD_G = 0.4, 8.0


class Ledger:
    """Zeros (row 0) and loads of ``ids``: ``mean`` (m, k) g and per cell a covariance ``cov`` (k, m, m) g^2."""

    def __init__(self, zero: Array, variance: Array) -> None:
        self.ids: list[int] = []
        self.mean = np.array(zero, dtype=float)[None]
        self.cov = np.array(variance, dtype=float)[:, None, None]
        #: The loads, (k,) g, as the shelf had them when they were entered or looked at last.
        self._said: dict[int, Array] = {}
        #: What they weighed when they were entered, g.
        self._entered: dict[int, float] = {}

    def keep(self, things: Mapping[int, Thing]) -> None:
        """Enter new stays, strike out those that are over, and enter those afresh whose load is another now."""
        gone = [i for i in self.ids if i not in things or self._another(things[i])]
        if gone:
            rows = [0, *(1 + n for n, i in enumerate(self.ids) if i not in gone)]
            self.mean, self.cov = self.mean[rows], self.cov[np.ix_(range(len(self.cov)), rows, rows)]
            self.ids = [i for i in self.ids if i not in gone]
        for thing in [thing for i, thing in things.items() if i not in self.ids]:
            self.mean = np.vstack([self.mean, thing.load])
            size = len(self.mean)
            cov = np.zeros((len(self.cov), size, size))
            cov[:, :-1, :-1] = self.cov
            cov[:, -1, -1] = thing.variance + (_SHARE * np.abs(thing.load) + _GRAMS) ** 2
            self.cov = cov
            self.ids.append(thing.id)
            self._said[thing.id], self._entered[thing.id] = thing.load.copy(), float(thing.load.sum())
        self._entered = {i: self._entered[i] for i in self.ids}
        self._said = {i: things[i].load.copy() for i in self.ids}

    def _another(self, thing: Thing) -> bool:
        off = np.abs(thing.load - self._said[thing.id])
        return bool((off > _CHANGED_SD * np.sqrt(thing.variance) + _CHANGED_G).any())

    def walk(self, variance: Array | float) -> None:
        """The errors of the zeros grow by ``variance``, (k,) g^2."""
        self.cov[:, 0, 0] += variance

    def expected(self, without: Collection[int] = ()) -> tuple[Array, Array]:
        """The level, (k,) g, and its variance, (k,) g^2, if the stays ``without`` were not there."""
        there = np.array([True, *(i not in without for i in self.ids)])
        return self.mean[there].sum(axis=0), self.cov[:, there][:, :, there].sum(axis=(1, 2))

    def observe(self, level: Array, variance: Array) -> None:
        """The board rests at ``level`` (k,) g with errors of ``variance`` (k,) g^2."""
        expected, spread = self.expected()
        gain = self.cov.sum(axis=2) / (spread + variance)[:, None]
        self.mean = self.mean + (gain * (level - expected)[:, None]).T
        self.cov = self.cov - gain[:, :, None] * self.cov.sum(axis=1)[:, None, :]

    def teach(self, things: Mapping[int, Thing], measured: int | None = None) -> None:
        """Tell the shelf what is known by now of each load; of things that came together it keeps what it has.

        The stay that is being ``measured`` now is told only that it was wrong: all that this rest says of it is in its
        load already, and better, since here one level of a rest after the other counts as if it were news.
        """
        for row, i in enumerate(self.ids, start=1):
            thing, variance = things[i], self.cov[:, row, row].copy()
            both = float(variance.sum() + thing.variance.sum())
            wrong = float((self.mean[row] - thing.load).sum()) ** 2 > _WRONG_SD**2 * both
            if thing.joint or (not wrong and (i == measured or float(variance.sum()) > float(thing.variance.sum()))):
                continue
            if self._another(replace(thing, load=self.mean[row])):
                thing.forget_place()
            thing.load, thing.variance = self.mean[row].copy(), variance
            self._said[i] = thing.load.copy()

    def faded(self) -> list[int]:
        """Stays that turn out to weigh next to nothing: something else was taken for them."""
        spread = np.sqrt(np.einsum("kmm->m", self.cov))[1:]
        weights = self.mean[1:].sum(axis=1)
        return [
            i
            for i, weight, sd in zip(self.ids, weights, spread, strict=True)
            if weight < _FADED * self._entered[i] and sd < _FADED_SD_G
        ]

    def to_dict(self) -> dict[str, Any]:
        return {
            "ids": self.ids,
            "mean": self.mean.tolist(),
            "cov": self.cov.tolist(),
            "said": [self._said[i].tolist() for i in self.ids],
            "entered": [self._entered[i] for i in self.ids],
        }

    @classmethod
    def from_dict(cls, state: Mapping[str, Any]) -> Self:
        mean, cov = np.array(state["mean"], dtype=float), np.array(state["cov"], dtype=float)
        self = cls(mean[0], cov[:, 0, 0])
        self.ids, self.mean, self.cov = [int(i) for i in state["ids"]], mean, cov
        self._said = {i: np.array(load, dtype=float) for i, load in zip(self.ids, state["said"], strict=True)}
        self._entered = {i: float(weight) for i, weight in zip(self.ids, state["entered"], strict=True)}
        return self
