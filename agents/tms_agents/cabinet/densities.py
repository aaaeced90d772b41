"""How probable is a load vector, (k,) g, if it is nothing, one thing, a push, or a thing that was slid?"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from tms_agents.cabinet.geometry import Array, Geometry, KnownWeight
from tms_agents.cabinet.position import centre_free, off_board
from tms_agents.cabinet.stays import Thing

#: Weights of things are spread evenly in their logarithm between these.
_LIGHTEST_G, _HEAVIEST_G = 3.0, 20_000.0
_LOG_RANGE = math.log(math.log(_HEAVIEST_G / _LIGHTEST_G))


def normal(value: Array, variance: Array) -> float:
    """Log density of independent normal errors."""
    return float(-0.5 * (value**2 / variance + np.log(2 * math.pi * variance)).sum())


def balanced(value: Array, variance: Array, total: float) -> float:
    """The same, but the sum of the errors is known to have the variance ``total``."""
    weight, sd2 = float(value.sum()), float(variance.sum())
    sharper = -0.5 * (weight**2 / total + math.log(total)) + 0.5 * (weight**2 / sd2 + math.log(sd2))
    return normal(value, variance) + sharper


class PutDensity:
    """Log density of a load vector (k,), per g^k, if it is that of one thing somewhere on the board."""

    def __init__(
        self,
        geometry: Geometry,
        least_g: float,
        weights: Sequence[KnownWeight] = (),
        *,
        trust: float = 0.5,
        clear: float = 4.0,
    ) -> None:
        """``trust``: how probable it is that the thing is one of those with the known ``weights``.

        A load less than ``clear`` of its standard deviations is nobody's.
        """
        self.geometry, self._least_g, self._weights = geometry, least_g, weights
        self._trust, self._clear = trust, clear
        self._area = geometry.width * geometry.depth
        self._jacobian = float(np.linalg.slogdet(np.vstack([geometry.moments, geometry.twist]))[1])

    def __call__(self, load: Array, variance: Array, total: float | None = None) -> float:
        """``total``: variance of the sum of the load, where that is not what the cells have together."""
        weight, sd2 = float(load.sum()), float(variance.sum()) if total is None else total
        if weight < max(self._clear * math.sqrt(sd2), self._least_g):
            return -math.inf
        place = off_board(load, variance, self.geometry) - math.log(self._area) - 2 * math.log(weight)
        return self._weight(weight, sd2) + place + self._twist(load, variance, weight) + self._jacobian

    def of(self, weight: KnownWeight) -> PutDensity:
        """The same for a load of that weight."""
        return PutDensity(self.geometry, self._least_g, [weight])

    def same_place(self, thing: Thing, change: Array, variance: Array, apart_m: float = 0.005) -> float:
        """Density of a further ``change`` where ``thing`` stands: it was still being put down, or pressed."""
        weight = float(change.sum())
        size = max(abs(weight), 1.0)
        if weight + float(thing.load.sum()) < self._least_g:
            return -math.inf
        here = np.array(thing.centre(self.geometry).xy) - np.array(centre_free(change, self.geometry))
        at = np.array(self.geometry.cells)
        arms, own = (at - thing.centre(self.geometry).xy).T, float(thing.load.sum())
        cov = (arms * variance) @ arms.T / size**2 + (arms * thing.variance) @ arms.T / own**2
        cov = cov + np.eye(2) * apart_m**2
        place = -0.5 * float(here @ np.linalg.solve(cov, here)) - 0.5 * math.log(float(np.linalg.det(cov)))
        place -= math.log(2 * math.pi) + 2 * math.log(size)
        return self._weight(size, 0.0, known=False) + place + self._twist(change, variance, size) + self._jacobian

    def slid(self, change: Array, load: Array, variance: Array) -> tuple[float, float]:
        """Densities of a step that makes ``load`` of a thing's load vector: with its weight, or still pressed."""
        weight, sd2, more = float(load.sum()), float(variance.sum()), float(change.sum())
        place = off_board(load, variance, self.geometry) - math.log(self._area) - 2 * math.log(weight)
        place += self._twist(load, variance, weight) + self._jacobian
        still = -0.5 * (more**2 / sd2 + math.log(2 * math.pi * sd2))
        return still + place, -math.log(weight) + place

    def anything(self, change: Array, variance: Array) -> float:
        """Density of a change that no thing makes: any size and sign, shared among the cells in any way."""
        size = np.sqrt(change**2 + variance).sum()
        return -math.log(2 * size) - _LOG_RANGE - (len(change) - 1) * math.log(size)

    def _weight(self, weight: float, sd2: float, *, known: bool = True) -> float:
        broad = -math.log(max(weight, 1.0)) - _LOG_RANGE
        if not known or not self._weights:
            return broad
        peaks = sum(
            math.exp(-0.5 * (weight - item.mean_g) ** 2 / (item.sd_g**2 + sd2))
            / math.sqrt(2 * math.pi * (item.sd_g**2 + sd2))
            for item in self._weights
        )
        return math.log((1 - self._trust) * math.exp(broad) + self._trust * peaks / len(self._weights))

    def _twist(self, load: Array, variance: Array, weight: float) -> float:
        twist = self.geometry.twist
        if not len(twist):
            return 0.0
        # A soft board gives a corner more than its share: up to half the weight, a fifth of it on average.
        spread = (twist**2) @ variance + (0.2 * weight) ** 2
        return normal(twist @ load, spread)
