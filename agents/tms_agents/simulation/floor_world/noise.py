"""From what a perfect laser would measure to what a real one says: every error has its own memory."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numba import njit

from tms_agents.simulation.floor_world.lasers import Laser
from tms_agents.simulation.floor_world.raycaster import Cast
from tms_agents.simulation.floor_world.shapes import NOBODY, Floats, Ints


@dataclass(frozen=True, slots=True, eq=False)
class Measured:
    """``ranges`` (n,) m as a driver gives them (+inf no echo, NaN error), ``intensities`` (n,), and whom each beam
    really met (n,): an owner, or NOBODY also where nothing came back."""

    ranges: Floats
    intensities: Floats
    owners: Ints


class LaserErrors:
    """The errors of one device."""

    def __init__(self, laser: Laser, rng: np.random.Generator) -> None:
        self._laser, self._rng = laser, rng
        p, n = laser.noise, laser.beams
        self._before = rng.normal(size=n)
        self._silent = np.zeros(n, dtype=np.bool_)
        self._intermittent = rng.random(n) < p.intermittent
        self._scale = p.warm_up_m * rng.choice([-1.0, 1.0])
        self._wander = p.drift_m * rng.normal()
        self._at: float | None = None
        self._longer = 1.0 + p.longer * rng.spawn(1)[0].uniform(-1.0, 1.0)

    def first_angle(self) -> float:
        """Of this sweep: the mirror does not start twice at the very same place."""
        return self._laser.first_angle + self._laser.noise.angle_jitter * self._laser.step * self._rng.normal()

    def measure(self, seen: Cast, t: float) -> Measured:
        """What the device says of ``seen`` at ``t`` seconds."""
        p, n, rng = self._laser.noise, self._laser.beams, self._rng
        drift = self._drift(t)
        raw = rng.normal(size=n + 2)
        b, c = p.moving_average
        fresh = (raw[2:] + b * raw[1:-1] + c * raw[:-2]) / math.sqrt(1 + b * b + c * c)
        self._before = p.memory * self._before + math.sqrt(1 - p.memory**2) * fresh
        ranges = _mixed(seen.ranges, rng.random(n), rng.random(n), p.mixed)
        mixed = ranges != seen.ranges
        near = np.where(np.isfinite(ranges), ranges, 0.0)
        sigma = np.interp(near, p.sigma_at_m, p.sigma_m)
        steep = np.clip((np.arccos(np.clip(seen.cosines, 0, 1)) - math.pi / 3) / (math.pi / 6), 0, 1)
        sigma *= 1 + (p.grazing - 1) * steep
        ranges = self._longer * ranges + sigma * self._before + p.common_m * rng.normal() + drift
        ranges = np.round(ranges / p.quantum_m) * p.quantum_m
        chance = rng.random((3, n))
        self._silent = self._intermittent & (chance[0] < np.where(self._silent, p.silent_again, p.silent_next))
        none = (
            self._silent | (chance[1] < p.isolated) | (chance[2] > seen.echo * self._strength(near, seen.reflectivity))
        )
        none |= (ranges > self._laser.range_max_m) | ~np.isfinite(ranges)
        ranges[none] = np.inf
        ranges[ranges < self._laser.range_min_m] = np.nan
        ranges[rng.random(n) < p.error_code] = np.nan
        back = np.isfinite(ranges)
        light = np.zeros(n)
        light[back] = 3000 * seen.reflectivity[back] * seen.cosines[back] ** 0.2 / np.maximum(near[back], 0.3) ** 0.3
        light[back] += rng.normal(0, 25, int(back.sum()))
        owners = np.where(back & ~mixed, seen.owners, NOBODY)
        return Measured(ranges, np.maximum(np.round(light), 0.0), owners)

    def _strength(self, ranges: Floats, reflectivity: Floats) -> Floats:
        """The share (n,) of beams whose echo is not too weak."""
        p = self._laser.noise
        if not math.isfinite(p.fades_at_m):
            return np.ones(ranges.size)
        weak = (ranges - p.fades_at_m * reflectivity**p.fades_power) / p.fades_over_m
        return np.asarray(1 / (1 + np.exp(weak)))

    def _drift(self, t: float) -> float:
        """Metres: it warms up, and wanders."""
        p = self._laser.noise
        if self._at is not None and t > self._at:
            keep = math.exp(-(t - self._at) / p.drift_s)
            self._wander = keep * self._wander + p.drift_m * math.sqrt(1 - keep * keep) * self._rng.normal()
        self._at = t
        return float(self._wander + self._scale * math.exp(-t / p.warm_up_s))

    def period(self) -> float:
        """Seconds until the next scan that arrives; now and then one is lost, or a few."""
        p, scans = self._laser.noise, 1
        if self._rng.random() < p.missing:
            scans += 1
            while self._rng.random() < p.missing_more:
                scans += 1
        return scans * self._laser.period_s

    def jitter(self) -> float:
        """Seconds between the true time of a scan and its stamp."""
        return float(np.clip(self._rng.normal(), -3, 3)) * self._laser.noise.time_jitter_s


@njit(cache=True)
def _mixed(ranges: Floats, chance: Floats, share: Floats, probability: float) -> Floats:
    """At an edge the spot of a beam lies on both sides, and its range now and then between the two."""
    out = ranges.copy()
    for i in range(len(ranges) - 1):
        a, b = ranges[i], ranges[i + 1]
        if not (np.isfinite(a) and np.isfinite(b)) or abs(a - b) < 0.05:
            continue
        if chance[i] < probability:
            out[i if share[i] < 0.5 else i + 1] = a + share[i] * (b - a)
    return out
