"""CARMEN logs: ``FLASER n r1..rn x y theta odom_x odom_y odom_theta t host logger_t``, and the newer
``ROBOTLASER1``."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass, field

import numpy as np

from tms_agents.slam.geometry import Floats, between
from tms_agents.slam.logs import Log, LogError, driven_at, longest_range

#: A range of more than this is no measurement of the lasers these logs come from (m).
_FARTHEST_M = 80.0
_MESSAGES = ("FLASER", "ROBOTLASER1", "ODOM")
#: Messages that are known and not needed.
_OTHERS = ("RLASER", "ROBOTLASER2", "PARAM", "SYNC", "TRUEPOS", "BROKEN")


@dataclass(slots=True)
class _Scan:
    t: float
    odometry: tuple[float, float, float]
    laser: tuple[float, float, float]
    first: float
    step: float
    ranges: list[float] = field(repr=False)


def parse_carmen(lines: Iterable[str]) -> Log:
    """Scans of the front laser; lines that cannot be read, or are of another laser than most, are counted as bad.

    Scans without a rising time keep their order and the time before them.

    Raises:
        LogError: not one scan.
    """
    scans: list[_Scan] = []
    records: list[tuple[float, float, float, float]] = []
    bad = 0
    for line in lines:
        words = line.split()
        if not words or words[0].startswith("#"):
            continue
        if words[0] not in _MESSAGES:
            bad += words[0] == "BROKEN" or (words[0] not in _OTHERS and not words[0].isupper())
            continue
        try:
            if words[0] == "ODOM":
                x, y, theta, t = _numbers([*words[1:4], words[7]])
                records.append((t, x, y, theta))
                continue
            scans.append(_flaser(words) if words[0] == "FLASER" else _robotlaser(words))
            records.append((scans[-1].t, *scans[-1].odometry))
        except (ValueError, IndexError):
            bad += 1
    if not scans:
        raise LogError(
            "it holds no FLASER or ROBOTLASER1 message that can be read" + (f", {bad} bad lines" * (bad > 0))
        )
    shape, _ = Counter((len(s.ranges), s.first, s.step) for s in scans).most_common(1)[0]
    alike = [s for s in scans if (len(s.ranges), s.first, s.step) == shape]
    ranges = np.array([s.ranges for s in alike])
    odometry: Floats = np.array([s.odometry for s in alike])
    seen_from = between(odometry, np.array([s.laser for s in alike]))
    times: Floats = np.maximum.accumulate(np.array([s.t for s in alike]))
    track = np.array(records)
    track[:, 0] = np.maximum.accumulate(track[:, 0])
    return Log(
        times,
        odometry,
        driven_at(track[:, 0], track[:, 1:], times),
        ranges,
        shape[1] + shape[2] * np.arange(float(shape[0])),
        longest_range(ranges, _FARTHEST_M),
        np.median(seen_from, axis=0),
        bad_lines=bad + len(scans) - len(alike),
    )


def _flaser(words: list[str]) -> _Scan:
    n = _count(words[1])
    numbers = _numbers(words[2 : n + 8])
    if len(numbers) != n + 6 or len(words) < n + 9:
        raise ValueError("too short")
    t = _numbers(words[n + 8 : n + 9])[0]
    first, step = _sweep(n)
    return _Scan(t, _pose(numbers[n + 3 :]), _pose(numbers[n:]), first, step, numbers[:n])


def _robotlaser(words: list[str]) -> _Scan:
    """ROBOTLASER1 type start fov step max accuracy mode n r1..rn m e1..em laser_pose robot_pose tv rv ... t host t."""
    first, _, step = _numbers(words[2:5])
    n = _count(words[8])
    ranges = _numbers(words[9 : 9 + n])
    remissions = int(words[9 + n])
    if remissions < 0:
        raise ValueError("negative count")
    rest = _numbers(words[10 + n + remissions : 16 + n + remissions])
    if len(ranges) != n or len(rest) != 6 or len(words) < 24 + n + remissions:
        raise ValueError("too short")
    t = _numbers(words[21 + n + remissions : 22 + n + remissions])[0]
    return _Scan(t, _pose(rest[3:]), _pose(rest), first, step, ranges)


def _sweep(n: int) -> tuple[float, float]:
    """(first angle, step) rad: half a circle; an odd count has beams at both ends."""
    step = math.pi / (n - 1 if n % 2 else n)
    return -math.pi / 2, step


def _count(word: str) -> int:
    n = int(word)
    if not 2 <= n <= 20000:
        raise ValueError("no plausible number of beams")
    return n


def _numbers(words: list[str]) -> list[float]:
    numbers = [float(word) for word in words]
    if not all(map(math.isfinite, numbers)):
        raise ValueError("not finite")
    return numbers


def _pose(numbers: list[float]) -> tuple[float, float, float]:
    return numbers[0], numbers[1], numbers[2]
