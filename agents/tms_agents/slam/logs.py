"""A recorded drive: odometry and scans, whatever file they came from."""

from __future__ import annotations

import gzip
import io
import json
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from tms_agents.slam.geometry import Floats, between, compose

#: A longest range that repeats so often stands for "no return".
_REPEATED = 3
#: What else comes so close to it is a code of the device, too (SICK: 81.83 to 81.91).
_CODES_M = 0.1
_GZIP = b"\x1f\x8b"


class LogError(ValueError):
    """The file is no log that can be used; the text says why in one line."""


@dataclass(frozen=True, slots=True, eq=False)
class Log:
    """``t`` (S,) s of the scans, not falling; ``odometry`` (S, 3) of the robot at those times; ``ranges`` (S, B) m.

    ``driven`` (S, 2) is the way (m) and the turn (rad) until then, to and fro added up, over all records of odometry.
    ``angles`` (B,) rad seen from the laser, whose pose on the robot is ``laser`` (3,). A range counts if it is above 0
    and below ``range_max`` m. ``intensities`` (S, B) are as recorded. ``bad_lines`` could not be read and were left
    out."""

    t: Floats
    odometry: Floats
    driven: Floats
    ranges: Floats
    angles: Floats
    range_max: float
    laser: Floats
    intensities: Floats | None = None
    bad_lines: int = 0

    def __len__(self) -> int:
        return len(self.t)

    def points(self, n: int) -> Floats:
        """(M, 2) m: where the beams of scan ``n`` that returned ended, seen from the robot."""
        valid = self.returned(n)
        r, a = self.ranges[n, valid], self.angles[valid] + self.laser[2]
        return np.stack([self.laser[0] + r * np.cos(a), self.laser[1] + r * np.sin(a)], axis=-1)

    def returned(self, n: int) -> np.ndarray[tuple[int], np.dtype[np.bool_]]:
        """(B,) which beams of scan ``n`` met something."""
        ranges = self.ranges[n]
        found: np.ndarray[tuple[int], np.dtype[np.bool_]] = (ranges > 0.0) & (ranges < self.range_max)
        return found


def parse_laser(models: str) -> Floats:
    """Pose (3,) of the laser on the robot, out of the text of a ``models.json``.

    Raises:
        LogError: it does not say.
    """
    try:
        pose: Floats = np.asarray(json.loads(models)["robot"]["laser_pose"], dtype=np.float64)
        if pose.shape != (3,) or not np.isfinite(pose).all():
            raise ValueError("laser_pose is no pose")
    except (ValueError, KeyError, TypeError) as error:
        raise LogError(f"models.json: no usable robot.laser_pose ({error})") from error
    return pose


def longest_range(ranges: Floats, cap: float = np.inf) -> float:
    """The range from which on a reading says "nothing there" (m): what repeats itself at the end of all readings.

    Ranges may hold inf or nan, which are no readings.
    """
    with np.errstate(invalid="ignore"):
        readings = ranges[np.isfinite(ranges) & (ranges > 0.0)]
    if not len(readings):
        return cap
    top = float(readings.max())
    codes = int(np.count_nonzero(readings > top - _CODES_M))
    repeated = codes >= _REPEATED and codes > 10 * np.count_nonzero(
        (readings <= top - _CODES_M) & (readings > top - 2 * _CODES_M)
    )
    return min(cap, top - _CODES_M if repeated else float(np.nextafter(top, np.inf)))


def odometry_at(times: Floats, poses: Floats, t: Floats) -> Floats:
    """Odometry (N, 3) at rising ``times`` (N,), at the times ``t`` (S,): between two poses on the straight way."""
    if len(times) == 1:
        return np.repeat(poses, len(t), axis=0)
    turned = np.unwrap(poses[:, 2])
    columns = [np.interp(t, times, column) for column in (poses[:, 0], poses[:, 1], turned)]
    return compose(np.zeros((len(t), 3)), np.stack(columns, axis=-1))


def driven_at(times: Floats, poses: Floats, t: Floats) -> Floats:
    """(S, 2) m and rad that odometry (N, 3) at ``times`` (N,) had driven and turned, to and fro added up, at ``t``
    (S,)."""
    steps = between(poses[:-1], poses[1:])
    parts = np.stack([np.hypot(steps[:, 0], steps[:, 1]), np.abs(steps[:, 2])], axis=-1)
    sums = np.concatenate([np.zeros((1, 2)), np.cumsum(parts, axis=0)])
    return np.stack([np.interp(t, times, column) for column in sums.T], axis=-1)


def lines_of_file(path: Path) -> Iterator[str]:
    """Lines of text; a file that is broken off ends where it breaks."""
    with path.open("rb") as raw:
        packed = raw.read(2) == _GZIP
        raw.seek(0)
        stream = io.TextIOWrapper(gzip.GzipFile(fileobj=raw) if packed else raw, encoding="ascii", errors="replace")
        try:
            yield from stream
        except (EOFError, gzip.BadGzipFile, OSError) as error:
            if not packed:
                raise
            yield f"BROKEN {error}\n"
