"""Scans of one sensor, as they come out of a file, whatever its kind."""

from __future__ import annotations

import heapq
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from tms_agents.devices.scans import Array, Scan, Sweep
from tms_agents.floor.settings import Pose

#: Of one scan: ranges (B,) m as in ``Scan``, intensities (B,) where it has them.
Row = tuple[Array, Array | None]

#: A range so close to the end of the reach stands for "nothing within reach" in recordings of many drivers.
_FILL_M = 5e-4
#: What some devices deliver in place of a range that is too far, as a number of millimetres; smaller ones are errors.
_FAR_M = 0.0


class Rows(Protocol):
    """Scans by their numbers; of a large file they are read when they are wanted."""

    def __len__(self) -> int: ...

    def __getitem__(self, n: int, /) -> Row: ...


@dataclass(frozen=True, slots=True, eq=False)
class Recorded:
    """Scans of one sensor: ``t`` (T,) s of the first beams, and what was measured.

    ``pose`` is that of the sensor in the room: x, y in metres, yaw in radians; ``range_scale``: what it measures times
    this is how far it is, if that is known. ``upside_down``: its angles are those of a laser with its top to the floor,
    told as seen from above; False as the device itself tells them, None where that was not written down.
    """

    name: str
    sweep: Sweep
    pose: Pose
    t: Array
    rows: Rows
    range_scale: float | None = None
    upside_down: bool | None = False

    def __len__(self) -> int:
        return len(self.t)

    def scan(self, n: int) -> Scan:
        """One of them, as a driver delivers it."""
        return Scan(self.sweep, *self.rows[n])

    @property
    def ranges(self) -> Array:
        """Of all scans (T, B): to be asked of recordings that are not large."""
        return np.array([self.rows[n][0] for n in range(len(self))])


def rows_of(ranges: Array, intensities: Array | None = None) -> Rows:
    """Of arrays (T, B)."""
    return [(one, None if intensities is None else intensities[n]) for n, one in enumerate(ranges)]


def in_time(recordings: Sequence[Recorded]) -> Iterator[tuple[int, int]]:
    """(recording, scan) of all in the order of their times."""
    for _, number, n in heapq.merge(*(_timed(number, one.t) for number, one in enumerate(recordings))):
        yield number, n


def _timed(number: int, t: Array) -> Iterator[tuple[float, int, int]]:
    for n in range(len(t)):
        yield float(t[n]), number, n


def clean_ranges(ranges: Array, range_min_m: float, range_max_m: float) -> Array:
    """Ranges as in ``Scan``, whatever stands for "nothing" or for an error; shape is kept, the input is not changed.

    Recordings say "no echo" as inf, as 0 or as the end of the reach, and errors as nan or as codes of a few
    millimetres. Where nan is the only code, it is what that driver says for "no echo".
    """
    cleaned = np.array(ranges, dtype=np.float64)
    nan = np.isnan(cleaned)
    with np.errstate(invalid="ignore"):
        far = (cleaned >= range_max_m - _FILL_M) | (cleaned == _FAR_M)
        error = ~far & (cleaned < range_min_m)
    cleaned[far] = np.inf
    cleaned[error] = np.nan
    if nan.any() and not far.any() and not error.any():
        cleaned[nan] = np.inf
    return cleaned


def forward(one: Recorded) -> Recorded:
    """Without the scans whose time is not after all those before: no estimator can use them."""
    rising = one.t > np.concatenate([[-np.inf], np.maximum.accumulate(one.t)[:-1]])
    return one if rising.all() else _chosen(one, np.flatnonzero(rising))


def within(one: Recorded, reach_m: float | None) -> Recorded:
    """As of a sensor of which nothing farther than that is used."""
    if reach_m is None or reach_m >= one.sweep.range_max_m:
        return one
    return replace(one, sweep=replace(one.sweep, range_max_m=reach_m))


def mounted(one: Recorded, *, upside_down: bool) -> Recorded:
    """As of a laser that hangs so. Of what was not written down it is believed that it was told as it hung."""
    if one.upside_down is None or one.upside_down == upside_down:
        return one
    return replace(one, sweep=replace(one.sweep, angles=-one.sweep.angles), upside_down=upside_down)


def thinned(one: Recorded, most: int) -> Recorded:
    """At most so many of the scans, evenly spread: for what does not need all of them."""
    return one if len(one) <= most else _chosen(one, np.linspace(0, len(one) - 1, most).round().astype(np.intp))


def _chosen(one: Recorded, numbers: NDArray[np.intp]) -> Recorded:
    return replace(one, t=one.t[numbers], rows=_Chosen(one.rows, numbers))


class _Chosen:
    """Some rows of others."""

    def __init__(self, rows: Rows, numbers: NDArray[np.intp]) -> None:
        self._rows, self._numbers = rows, numbers

    def __len__(self) -> int:
        return len(self._numbers)

    def __getitem__(self, n: int, /) -> Row:
        return self._rows[int(self._numbers[n])]
