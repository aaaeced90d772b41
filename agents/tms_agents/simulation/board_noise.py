"""Electronics of a board's load cells: from true grams on each cell to the counts that a host reads.

Signal chain: load, creep, gain, zero (drift, daily swing of the room's temperature, offset), mechanical vibration,
noise (more of it while a tag reader's antenna is on), quantisation, and the end of the scale.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
DAY_S, HOUR_S = 86400.0, 3600.0


@dataclass(frozen=True, kw_only=True, slots=True)
class CellParameters:
    """What is wrong with load cells and their converter; grams are per cell, the defaults the laboratory's board."""

    gram_per_count: float = 5.0
    noise_sd_g: float = 8.0
    rf_noise_factor: float = 2.0
    #: Spread of the gains, of the zeros, and what a calibration leaves of the former.
    gain_sd: float = 0.01
    offset_sd_g: float = 200.0
    gain_error_sd: float = 0.001
    #: Share of a load by which its reading has grown after an hour, which parts of that creep at which time constants.
    creep_per_hour: float = 0.01
    creep_tau_s: tuple[float, ...] = (300.0, 7200.0)
    creep_part: tuple[float, ...] = (0.3, 0.7)
    #: The zero walks at random (standard deviation after an hour), and swings once a day with the temperature.
    drift_g: float = 5.0
    daily_swing_g: float = 10.0
    #: A compressor runs for a while (means of exponential times) and shakes the cells with a few tones of one burst;
    #: the amplitude is the root of the sum of their squares, at the cell that is shaken most.
    vibration_g: float = 20.0
    vibration_hz: tuple[float, float] = (10.0, 50.0)
    vibration_tones: int = 3
    vibration_on_s: float = 40.0
    vibration_off_s: float = 120.0
    #: Beyond this load a cell says nothing.
    capacity_g: float = 10_000.0
    #: How much the zeros jump when the board is switched on again.
    power_on_sd_g: float = 5.0


class CellBank:
    """The cells of one board. ``read`` must be called with times that go on where the last call ended.

    The draws do not depend on how the time is cut into calls.
    """

    def __init__(self, parameters: CellParameters, cells: int, period_s: float, rng: np.random.Generator) -> None:
        self.parameters = p = parameters
        self._period_s = period_s
        self._noise, self._walk, self._shaking, fixed, self._switch = rng.spawn(5)
        self.gain = 1.0 + p.gain_sd * fixed.standard_normal(cells)
        self.offset_g = p.offset_sd_g * fixed.standard_normal(cells)
        self._gain_error = p.gain_error_sd * fixed.standard_normal(cells)
        self._measured_offset_g = self.offset_g.copy()
        self._day = fixed.uniform(0, 2 * math.pi, cells)
        self._day_g = p.daily_swing_g * fixed.uniform(0.5, 1.0, cells)
        self._creep_g = np.zeros((len(p.creep_tau_s), cells))
        self._drift_g = np.zeros(cells)
        self._burst = _Burst(0.0, 0.0, np.zeros(0), np.zeros((0, cells)), np.zeros((0, cells)))
        self._stuck: dict[int, float] = {}
        self.last = np.full(cells, np.nan)  # counts read last
        self.powered = True

    def read(self, t: Floats, load_g: Floats, rf_on: NDArray[np.bool_]) -> Floats:
        """Counts (n, k) at times ``t`` (n,) under true loads (n, k); NaN where a cell says nothing."""
        p = self.parameters
        clean = self.gain * (load_g + self._crept(load_g)) + self.offset_g + self._drifted(t)
        sd = p.noise_sd_g * np.where(rf_on, p.rf_noise_factor, 1.0)
        grams = clean + self._shaken(t) + sd[:, None] * self._noise.standard_normal(load_g.shape)
        counts: Floats = np.round(grams / p.gram_per_count)
        counts[np.abs(load_g) > p.capacity_g] = np.nan
        for cell, value in self._stuck.items():
            counts[:, cell] = value
        if not self.powered:
            counts[:] = np.nan
        if len(counts):
            self.last = counts[-1]
        return counts

    def grams(self, counts: Floats) -> Floats:
        """Counts as grams by the calibration that an installer made with an empty board and known weights."""
        gain = self.gain * (1.0 + self._gain_error)
        grams: Floats = (counts * self.parameters.gram_per_count - self._measured_offset_g) / gain
        return grams

    def stick(self, cell: int) -> None:
        """From now on the cell repeats what it said last."""
        self._stuck[cell] = float(self.last[cell])

    def repair(self, cell: int) -> None:
        self._stuck.pop(cell, None)

    def power(self, on: bool) -> None:
        """Switch the board off (it says nothing), or on again with slightly other zeros."""
        if on and not self.powered:
            self.offset_g = self.offset_g + self.parameters.power_on_sd_g * self._switch.standard_normal(len(self.gain))
        self.powered = on

    def _crept(self, load_g: Floats) -> Floats:
        """Each part of the creep follows the load as a first-order lag: c' = c + (a w - c) (1 - exp(-dt / tau))."""
        p = self.parameters
        total = np.zeros_like(load_g)
        for j, (tau, part) in enumerate(zip(p.creep_tau_s, p.creep_part, strict=True)):
            full = p.creep_per_hour * part / -math.expm1(-HOUR_S / tau)
            # The recursion in closed form, in pieces of at most tau so that the growing factor stays small.
            piece = max(1, int(tau / self._period_s))
            for first in range(0, len(load_g), piece):
                w = load_g[first : first + piece]
                growth = np.exp(np.arange(1, len(w) + 1) * (self._period_s / tau))[:, None]
                gained = np.cumsum(w * growth, axis=0) * (-full * math.expm1(-self._period_s / tau))
                crept = (self._creep_g[j] + gained) / growth
                self._creep_g[j] = crept[-1]
                total[first : first + piece] += crept
        return total

    def _drifted(self, t: Floats) -> Floats:
        p = self.parameters
        step = p.drift_g * math.sqrt(self._period_s / HOUR_S)
        walk = self._drift_g + np.cumsum(step * self._walk.standard_normal((len(t), len(self.gain))), axis=0)
        if len(t):
            self._drift_g = walk[-1]
        angle = 2 * math.pi * t[:, None] / DAY_S + self._day
        # A calibration was made at the start: the swing counts from there.
        swing = self._day_g * (np.sin(angle) - np.sin(self._day))
        drifted: Floats = walk + swing
        return drifted

    def _shaken(self, t: Floats) -> Floats:
        shaken = np.zeros((len(t), len(self.gain)))
        if self.parameters.vibration_g == 0 or not len(t):
            return shaken
        while True:
            inside = (t >= self._burst.start) & (t < self._burst.end)
            if inside.any():
                shaken[inside] = self._burst.at(t[inside])
            if self._burst.end > t[-1]:
                return shaken
            self._burst = self._next_burst(self._burst.end)

    def _next_burst(self, after: float) -> _Burst:
        p, rng, k = self.parameters, self._shaking, len(self.gain)
        start = after + rng.exponential(p.vibration_off_s)
        parts = rng.dirichlet(np.ones(p.vibration_tones))  # of the energy
        amplitude = p.vibration_g * np.sqrt(parts)[:, None] * rng.uniform(0.5, 1.0, (p.vibration_tones, k))
        return _Burst(
            start,
            start + rng.exponential(p.vibration_on_s),
            rng.uniform(*p.vibration_hz, p.vibration_tones),
            amplitude,
            rng.uniform(0, 2 * math.pi, (p.vibration_tones, k)),
        )


@dataclass(frozen=True, slots=True)
class _Burst:
    """One run of the compressor: tones (m,) in Hz, amplitude and phase of each at each cell (m, k)."""

    start: float
    end: float
    hz: Floats
    amplitude_g: Floats
    phase: Floats

    def at(self, t: Floats) -> Floats:
        angle = 2 * math.pi * t[:, None] * self.hz
        # sin(a + b) in products: far fewer sines than one per tone and cell.
        cos_part, sin_part = self.amplitude_g * np.cos(self.phase), self.amplitude_g * np.sin(self.phase)
        shaken: Floats = np.sin(angle) @ cos_part + np.cos(angle) @ sin_part
        return shaken
