"""What a robot's devices told since a drive began, put together as the mapper reads a recording.

The estimator's rule is that things are moved while the robot is parked (a long pause in the records) or far away. A
robot that has stood still for a while counts as parked: what its devices tell then is left out, and when it drives on
its records are at least that long pause later, on a clock that is theirs alone.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from tms_agents.slam.geometry import Floats, compose, wrapped
from tms_agents.slam.logs import Log
from tms_agents.slam.logs_recording import Scan, put_together
from tms_agents.slam.polishing import PARKED_S
from tms_agents.slam.semidynamic import Rounds

#: A robot that has moved less than this stands still (m, rad).
_STILL_M, _STILL_RAD = 0.02, 0.02
#: Scans that come faster are left out: the mapper needs no more (s).
_SCAN_S = 0.15
_PAUSE_S = PARKED_S + 60.0

Pose = tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class Moved:
    """Odometry: where the robot is by its wheels at ``t`` (s), in a frame of its own."""

    t: float
    pose: Pose


@dataclass(frozen=True, slots=True)
class Scanned:
    """A scan as recordings have it; its own first entry is its time (s)."""

    scan: Scan


@dataclass(frozen=True, slots=True)
class Round:
    """An antenna was asked for all its tags, until ``t`` (s)."""

    t: float
    antenna: int
    tags: frozenset[str]


Record = Moved | Scanned | Round


@dataclass(frozen=True, slots=True, eq=False)
class Snapshot:
    """``log`` and ``rounds`` as the estimator takes them; ``times`` (S,) s: when the scans were made, on the clock of
    the devices; ``odometry`` (3,) of the newest record."""

    log: Log
    rounds: Rounds
    times: Floats


@dataclass(slots=True, eq=False)
class Drive:
    """Takes records in the order of their times. ``laser`` (3,) on the robot; it is parked once it stood ``park_s``.

    ``tags``: all that were ever read; ``fresh``: for the first time in this leg, until it is cleared.
    """

    laser: Floats
    park_s: float
    most_scans: int = 20_000
    parked: bool = False
    legs: int = 1
    left_out: int = 0
    tags: set[str] = field(default_factory=set)
    fresh: set[str] = field(default_factory=set)
    pose: Pose | None = None
    _read: set[str] = field(default_factory=set)
    _scans: list[Scan] = field(default_factory=list)
    _times: list[float] = field(default_factory=list)
    _odometry: list[tuple[float, float, float, float]] = field(default_factory=list)
    _rounds: list[tuple[float, int, frozenset[str]]] = field(default_factory=list)
    _still: Pose | None = None
    _still_since: float = 0.0
    _driven_m: float = 0.0
    _shift_s: float = 0.0
    _last_s: float = -np.inf
    _full: bool = False

    def take(self, record: Record) -> None:
        if isinstance(record, Moved):
            self._moved(record)
        elif self.parked or self._full:
            self.left_out += 1
        elif isinstance(record, Scanned):
            self._scanned(record.scan)
        else:
            self._round(record)

    @property
    def full(self) -> bool:
        """Whether there are too many scans: what comes now is left out."""
        return self._full

    @property
    def driven_m(self) -> float:
        return self._driven_m

    def snapshot(self) -> Snapshot | None:
        """All records so far; None before there is a scan and odometry."""
        if not self._scans or not self._odometry:
            return None
        log = put_together(list(self._scans), list(self._odometry), self.laser, 0)
        at = dict(zip((scan[0] for scan in self._scans), self._times, strict=True))
        rounds = sorted(self._rounds, key=lambda one: one[0])
        return Snapshot(
            log,
            Rounds(
                np.array([one[0] for one in rounds], dtype=np.float64),
                np.array([one[1] for one in rounds], dtype=np.int64),
                tuple(one[2] for one in rounds),
            ),
            np.array([at[float(t)] for t in log.t]),
        )

    def _moved(self, record: Moved) -> None:
        before, self.pose = self.pose, record.pose
        if before is not None:
            self._driven_m += float(np.hypot(record.pose[0] - before[0], record.pose[1] - before[1]))
        if self._still is None or _apart(self._still, record.pose):
            if self.parked:
                self._drive_on(record.t)
            self._still, self._still_since = record.pose, record.t
        elif not self.parked and record.t - self._still_since >= self.park_s:
            self.parked = True
        if not self.parked and not self._full:
            self._odometry.append((record.t + self._shift_s, *record.pose))
            self._last_s = max(self._last_s, record.t + self._shift_s)

    def _drive_on(self, t: float) -> None:
        self.parked = False
        self.legs += 1
        self._read.clear()
        self._shift_s += max(0.0, self._last_s + _PAUSE_S - (t + self._shift_s))

    def _scanned(self, scan: Scan) -> None:
        t = scan[0] + self._shift_s
        if self._scans and t - self._scans[-1][0] < _SCAN_S:
            return
        self._scans.append((t, *scan[1:]))
        self._times.append(scan[0])
        self._last_s = max(self._last_s, t)
        self._full = len(self._scans) >= self.most_scans

    def _round(self, record: Round) -> None:
        self._rounds.append((record.t + self._shift_s, record.antenna, record.tags))
        self._last_s = max(self._last_s, record.t + self._shift_s)
        self.fresh |= record.tags - self._read
        self._read |= record.tags
        self.tags |= record.tags


def placed(anchor: Floats, pose: Pose) -> Pose:
    """``pose`` seen from ``anchor`` (3,), as a pose in its frame."""
    x, y, theta = (float(one) for one in compose(anchor, np.array(pose)))
    return x, y, theta


def _apart(one: Pose, other: Pose) -> bool:
    turned = abs(float(wrapped(other[2] - one[2])))
    return bool(np.hypot(other[0] - one[0], other[1] - one[1]) > _STILL_M) or turned > _STILL_RAD
