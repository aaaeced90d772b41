"""Recorded scans out of files: ours, npz, CSV, ROS bags. All come out alike, whatever stands for "nothing" in them."""

from __future__ import annotations

import heapq
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from tms_agents.bags import is_bag
from tms_agents.devices.scans import Array, Scan, Sweep
from tms_client.cli import CommandError

Pose = tuple[float, float, float]

#: A range so close to the end of the reach stands for "nothing within reach" in recordings of many drivers.
_FILL_M = 5e-4
#: What some devices deliver in place of a range that is too far, as a number of millimetres; smaller ones are errors.
_FAR_M = 0.0


@dataclass(frozen=True, slots=True, eq=False)
class Recorded:
    """Scans of one sensor: ``t`` (T,) s of the first beams, rising, ``ranges`` (T, B) m as in ``Scan``.

    ``pose`` is that of the sensor in the room: x, y in metres, yaw in radians.
    """

    name: str
    sweep: Sweep
    pose: Pose
    t: Array
    ranges: Array
    intensities: Array | None = None

    def __len__(self) -> int:
        return len(self.t)

    def scan(self, n: int) -> Scan:
        """One of them, as a driver delivers it."""
        return Scan(self.sweep, self.ranges[n], None if self.intensities is None else self.intensities[n])


def read_scans(path: Path) -> list[Recorded]:
    """Everything that a file holds, a recording per sensor.

    Raises:
        CommandError: the file cannot be read, is of no known kind or holds no scan; one line that says why.
    """
    try:
        found = _read(path)
    except OSError as error:
        raise CommandError(f"{path}: {error.strerror or error}") from error
    except ValueError as error:
        raise CommandError(f"{path}: {error}") from error
    found = [forward(one) for one in found if len(one)]
    if not found:
        raise CommandError(f"{path}: it holds no scan")
    return found


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


def _read(path: Path) -> list[Recorded]:
    kind = path.suffix.lower()
    if kind == ".npz":
        from tms_agents.floor.formats_npz import read_npz

        return [read_npz(path)]
    if kind == ".csv":
        from tms_agents.floor.formats_csv import read_csv

        return [read_csv(path)]
    if kind == ".scans":
        from tms_agents.floor.recording import read_recording

        return read_recording(path)
    if is_bag(path):
        from tms_agents.floor.formats_rosbag import read_rosbag

        return read_rosbag(path)
    path.open("rb").close()  # a file that is not there is said to be so
    raise ValueError("not a recording: its name ends in .scans, .npz, .csv, .bag, .db3 or .mcap")
