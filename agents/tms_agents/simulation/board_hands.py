"""Hands at a shelf board: the force on it, and where, while somebody puts, takes, moves or leans.

A hand does not lower a weight as a step: it presses, trembles, tilts the thing onto an edge first, and takes its time.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Xy = tuple[float, float]


@dataclass(frozen=True, kw_only=True, slots=True)
class HandParameters:
    """Ranges are drawn from uniformly; times in seconds, forces in grams."""

    slow_share: float = 0.3  # of the changes take longer than two seconds
    quick_s: tuple[float, float] = (0.15, 1.5)
    slow_s: tuple[float, float] = (2.0, 5.0)
    #: The hand presses by up to this share of the weight, and this much whatever the weight, and trembles.
    press_share: float = 0.4
    press_g: float = 80.0
    tremor_share: float = 0.05
    #: Standard deviation of where the thing touches first against where it stands in the end.
    tilt_m: float = 0.01
    #: Time in a reader's field before the thing touches the board, and after it has left.
    approach_s: tuple[float, float] = (0.0, 0.8)
    #: A thing that is moved through the air is off the board for so long; one that is pushed takes at least so long.
    lift_s: tuple[float, float] = (0.3, 4.0)
    slide_s: float = 0.4
    lean_g: tuple[float, float] = (300.0, 5000.0)
    lean_s: tuple[float, float] = (1.0, 15.0)


@dataclass(frozen=True, slots=True)
class Trace:
    """A vertical force and where it acts, linear between the times ``t`` (m,), constant before and after."""

    t: Floats
    force_g: Floats
    x: Floats
    y: Floats

    @property
    def end(self) -> float:
        return float(self.t[-1])

    def moments(self, t: Floats) -> Floats:
        """(F, F x, F y, F x y) at times (n,), as (n, 4)."""
        force, x, y = (np.interp(t, self.t, values) for values in (self.force_g, self.x, self.y))
        return np.column_stack([force, force * x, force * y, force * x * y])


class Hands:
    """Draws how a hand does it. All methods take the time at which the force begins to change."""

    def __init__(self, parameters: HandParameters, rng: np.random.Generator) -> None:
        self.parameters = parameters
        self._rng = rng

    def seconds(self, slow: bool | None) -> float:
        """How long a change takes; ``slow`` None: as often slow as people are."""
        p = self.parameters
        if slow is None:
            slow = bool(self._rng.random() < p.slow_share)
        return float(self._rng.uniform(*(p.slow_s if slow else p.quick_s)))

    def approach(self) -> float:
        return float(self._rng.uniform(*self.parameters.approach_s))

    def put(self, start: float, weight_g: float, xy: Xy, seconds: float) -> Trace:
        """From nothing over too much to the weight."""
        p, rng = self.parameters, self._rng
        s = np.linspace(0.0, 1.0, 9)
        press = rng.uniform(0, p.press_share) * weight_g + rng.uniform(0, p.press_g)
        steepness = rng.uniform(0.7, 2.0)
        force = weight_g * np.minimum(s / 0.7, 1.0) ** steepness + press * np.sin(np.pi * s**2)
        force[1:-1] *= 1.0 + p.tremor_share * rng.standard_normal(7)
        force = np.maximum(force, 0.0)
        tilt = rng.normal(0, p.tilt_m, 2)
        return Trace(start + s * seconds, force, xy[0] + tilt[0] * (1 - s), xy[1] + tilt[1] * (1 - s))

    def take(self, start: float, weight_g: float, xy: Xy, seconds: float) -> Trace:
        """A put that runs backwards: the grip presses, then the weight goes."""
        put = self.put(0.0, weight_g, xy, seconds)
        return Trace(start + seconds - put.t[::-1], put.force_g[::-1], put.x[::-1], put.y[::-1])

    def lift_and_put(self, start: float, weight_g: float, old: Xy, new: Xy, slow: bool | None) -> tuple[Trace, float]:
        """Taken, held, put elsewhere; also the time at which the thing is off the board."""
        first = self.take(start, weight_g, old, self.seconds(slow))
        put_at = first.end + float(self._rng.uniform(*self.parameters.lift_s))
        second = self.put(put_at, weight_g, new, self.seconds(slow))
        return _joined(first, second), first.end

    def slide(self, start: float, weight_g: float, old: Xy, new: Xy, slow: bool | None) -> Trace:
        """Pushed along the board: the hand presses or relieves a little, the weight stays on."""
        p, rng = self.parameters, self._rng
        s = np.linspace(0.0, 1.0, 9)
        hand = rng.uniform(-0.3, 1.0) * p.press_share * weight_g * np.sin(np.pi * s) ** 2
        force = weight_g + hand
        force[1:-1] *= 1.0 + p.tremor_share * rng.standard_normal(7)
        way = s * s * (3 - 2 * s)
        x, y = old[0] + (new[0] - old[0]) * way, old[1] + (new[1] - old[1]) * way
        return Trace(start + s * max(p.slide_s, self.seconds(slow)), np.maximum(force, 0.0), x, y)

    def lean(self, start: float, xy: Xy, force_g: float | None, seconds: float | None) -> Trace:
        """An arm on the board: a large force that is never still, and leaves nothing behind."""
        p, rng = self.parameters, self._rng
        force_g = float(rng.uniform(*p.lean_g)) if force_g is None else force_g
        seconds = float(rng.uniform(*p.lean_s)) if seconds is None else seconds
        points = max(4, int(seconds / 0.3))
        force = force_g * np.clip(1.0 + 0.15 * rng.standard_normal(points), 0.2, None)
        force[0] = force[-1] = 0.0
        wander = rng.normal(0, 0.01, (2, points))
        return Trace(start + np.linspace(0, seconds, points), force, xy[0] + wander[0], xy[1] + wander[1])


def resting(t: float, weight_g: float, xy: Xy) -> Trace:
    """A thing that stands there already."""
    return Trace(*(np.array([value], dtype=np.float64) for value in (t, weight_g, *xy)))


def _joined(a: Trace, b: Trace) -> Trace:
    return Trace(
        np.concatenate([a.t, b.t]),
        np.concatenate([a.force_g, b.force_g]),
        np.concatenate([a.x, b.x]),
        np.concatenate([a.y, b.y]),
    )
