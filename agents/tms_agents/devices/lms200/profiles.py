"""Telegrams with measured values, to ranges and back: arrays, no loop over beams."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from tms_agents.devices.lms200 import messages as m
from tms_agents.devices.lms200.messages import Unit
from tms_agents.devices.scans import Array, Sweep

_COUNT, _QUARTER, _PARTIAL, _MILLIMETRES = 0x03FF, 0x1800, 0x2000, 0x4000
#: The mirror turns 75 times a second; finer than one degree takes several turns.
TURN_S = 1 / 75
#: Codes in place of a distance, counted down from all bits set.
_NO_ECHO, _DAZZLED, _BEYOND, _LAST_CODE = 0, 1, 8, 8
_METRES = {"mm": 0.001, "cm": 0.01}


@dataclass(frozen=True, slots=True, eq=False)
class Profile:
    """``values`` (n,) as sent. ``quarter``: the first beam lies so many quarters of a degree behind the first of all.

    ``partial``: one turn of the mirror, of several that make a scan. ``reflectivity`` (k,) of the beams from
    ``first`` (0 is the first beam) on.
    """

    values: NDArray[np.uint16]
    unit: Unit
    quarter: int = 0
    partial: bool = False
    reflectivity: NDArray[np.uint8] | None = None
    first: int = 0

    @classmethod
    def of(cls, code: int, data: bytes) -> Profile:
        """Of the data of a telegram ``RANGES`` or ``RANGES_AND_REFLECTIVITY``.

        Raises:
            ValueError: it is shorter than it says.
        """
        word, values, at = _counted(data, 0, "<u2")
        profile = cls(
            values.astype(np.uint16),
            "mm" if word & 0xC000 == _MILLIMETRES else "cm",
            (word & _QUARTER) >> 11,
            bool(word & _PARTIAL),
        )
        if code == m.RANGES:
            return profile
        if len(data) < at + 6:
            raise ValueError("no reflectivity behind the ranges")
        first = int.from_bytes(data[at + 2 : at + 4], "little")
        count = int.from_bytes(data[at : at + 2], "little") & _COUNT
        reflectivity = np.frombuffer(data, np.uint8, -1, at + 6)[:count]
        if len(reflectivity) < count or not 1 <= first <= len(values) - count + 1:
            raise ValueError("reflectivity of beams that are none")
        return replace(profile, reflectivity=reflectivity, first=first - 1)

    def encode(self) -> bytes:
        word = len(self.values) | self.quarter << 11 | self.partial * _PARTIAL
        word |= _MILLIMETRES if self.unit == "mm" else 0
        data = word.to_bytes(2, "little") + self.values.astype("<u2").tobytes()
        if self.reflectivity is None:
            return data
        count = len(self.reflectivity)
        ends = np.array([count, self.first + 1, self.first + count], "<u2").tobytes()
        return data + ends + self.reflectivity.tobytes()

    def ranges(self, measuring_mode: int) -> Array:
        """(n,) m; +inf where nothing echoed within reach, NaN where the device tells of an error.

        Raises:
            KeyError: the mode measures no distances.
        """
        mask = (1 << m.DISTANCE_BITS[measuring_mode]) - 1
        values = self.values & mask
        ranges = values.astype(np.float64) * _METRES[self.unit]
        code = mask - values
        ranges[code <= _LAST_CODE] = math.nan
        ranges[(code == _NO_ECHO) | (code == _BEYOND)] = math.inf
        return ranges

    def intensities(self) -> Array | None:
        """(n,), NaN for beams of which the reflectivity was not asked; None where there is none at all."""
        if self.reflectivity is None:
            return None
        intensities = np.full(len(self.values), math.nan)
        intensities[self.first : self.first + len(self.reflectivity)] = self.reflectivity
        return intensities


def to_values(ranges: Array, measuring_mode: int, unit: Unit) -> NDArray[np.uint16]:
    """What a device sends for ``ranges`` (n,) m; NaN becomes "dazzled"."""
    mask = (1 << m.DISTANCE_BITS[measuring_mode]) - 1
    with np.errstate(invalid="ignore"):
        values = np.round(ranges / _METRES[unit])
    values[values > mask - _LAST_CODE - 1] = mask - _BEYOND
    values[np.isinf(ranges)] = mask - _NO_ECHO
    values[np.isnan(ranges)] = mask - _DAZZLED
    return values.astype(np.uint16)


@lru_cache(maxsize=32)
def sweep(
    angle_deg: int,
    resolution_deg: float,
    *,
    quarter: int = 0,
    partial: bool = False,
    measuring_mode: int = 0,
    unit: Unit = "mm",
    telegram_s: float = 0.0,
    model: str = "",
) -> Sweep:
    """The beams from right to left; ``telegram_s`` is how long the line needs for a scan.

    A whole scan finer than one degree is made of several turns of the mirror, which are interlaced: its beams are up to
    half of its ``period_s`` off the times that ``time_increment_s`` tells. Partial scans are exact.
    """
    step = 1.0 if partial else resolution_deg
    angles = np.arange(quarter / 4 if partial else 0.0, angle_deg + 1e-9, step) - angle_deg / 2
    turns = 1 if partial else round(1 / resolution_deg)
    scan_s = turns * TURN_S
    farthest = (1 << m.DISTANCE_BITS[measuring_mode]) - 2 - _LAST_CODE
    return Sweep(
        angles=np.deg2rad(angles),
        time_increment_s=step / 360 * TURN_S,
        # what is measured while the line is busy is lost
        period_s=scan_s * max(1, math.ceil(telegram_s / scan_s - 1e-9)),
        range_min_m=0.0,
        range_max_m=min(farthest * _METRES[unit], 80.0),
        model=model,
    )


def _counted(data: bytes, at: int, kind: str) -> tuple[int, NDArray[np.uint16], int]:
    """The word that counts the values, the values, and where they end."""
    word = int.from_bytes(data[at : at + 2], "little")
    count = word & _COUNT
    if len(data) < at + 2 + 2 * count or len(data) < 2:
        raise ValueError(f"{count} values announced, {max(0, len(data) - at - 2) // 2} sent")
    return word, np.frombuffer(data, kind, count, at + 2), at + 2 + 2 * count
