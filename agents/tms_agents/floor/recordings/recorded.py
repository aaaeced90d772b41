"""Scans of one sensor, as they come out of a file, whatever its kind."""

from __future__ import annotations

import heapq
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from tms_agents.devices.scans import Array, Scan, Sweep

Pose = tuple[float, float, float]

#: A range so close to the end of the reach stands for "nothing within reach" in recordings of many drivers.
_FILL_M = 5e-4
#: What some devices deliver in place of a range that is too far, as a number of millimetres; smaller ones are errors.
_FAR_M = 0.0


@dataclass(frozen=True, slots=True, eq=False)
class Recorded:
    """Scans of one sensor: ``t`` (T,) s of the first beams, rising, ``ranges`` (T, B) m as in ``Scan``.

    ``pose`` is that of the sensor in the room: x, y in metres, yaw in radians; ``range_scale``: what it measures times
    this is how far it is, if that is known.
    """

    name: str
    sweep: Sweep
    pose: Pose
    t: Array
    ranges: Array
    intensities: Array | None = None
    range_scale: float | None = None

    def __len__(self) -> int:
        return len(self.t)

    def scan(self, n: int) -> Scan:
        """One of them, as a driver delivers it."""
        return Scan(self.sweep, self.ranges[n], None if self.intensities is None else self.intensities[n])


def in_time(recordings: Sequence[Recorded]) -> Iterator[tuple[int, int]]:
    """(recording, scan) of all in the order of their times."""
    streams = ([(float(t), number, n) for n, t in enumerate(one.t)] for number, one in enumerate(recordings))
    for _, number, n in heapq.merge(*streams):
        yield number, n


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
    if rising.all():
        return one
    kept = None if one.intensities is None else one.intensities[rising]
    return replace(one, t=one.t[rising], ranges=one.ranges[rising], intensities=kept)
