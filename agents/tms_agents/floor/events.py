"""What the floor estimator tells: labels that are there now, and what happened."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

Kind = Literal["mover", "object"]
#: Labels of movers that may have acted, each with its probability; what is missing to 1 is nobody known.
Candidates = tuple[tuple[int, float], ...]
#: var_x, cov_xy, var_y in m².
Covariance = tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class FloorLabel:
    """Something on the floor now. ``stale``: a mover that is hidden or seated, at the place where it was last seen."""

    id: int
    kind: Kind
    xy: tuple[float, float]
    cov: Covariance
    since: float
    seen_at: float
    velocity: tuple[float, float] | None = None
    robot: bool = False
    stale: bool = False


@dataclass(frozen=True, slots=True)
class Appeared:
    """A new label. ``since`` is when it was first seen, before it was believed; ``candidates`` who may have put it."""

    t: float
    label: int
    kind: Kind
    xy: tuple[float, float]
    cov: Covariance
    robot: bool = False
    since: float = 0.0
    candidates: Candidates = ()
    width_m: float | None = None


@dataclass(frozen=True, slots=True)
class Moved:
    """A mover is somewhere else now."""

    t: float
    label: int
    xy: tuple[float, float]
    cov: Covariance


@dataclass(frozen=True, slots=True)
class Vanished:
    """A label is gone: it was last seen at ``earliest``, and its place was seen to be free at ``latest``.

    ``into``: it was the same mover as this one, which has what it held.
    """

    t: float
    label: int
    earliest: float
    latest: float
    candidates: Candidates = ()
    into: int | None = None


@dataclass(frozen=True, slots=True)
class Stale:
    """A mover is hidden or has left the scan plane; it is still in the room and keeps what it holds."""

    t: float
    label: int


@dataclass(frozen=True, slots=True)
class Back:
    """A stale mover is seen again."""

    t: float
    label: int
    xy: tuple[float, float]
    cov: Covariance


@dataclass(frozen=True, slots=True)
class Confused:
    """Two movers who met were taken for each other with probability ``p``: since then each has what the other had.

    They were nearest ``since``; what was told before of where each is stands. ``since`` now, and 1: from now on their
    labels are exchanged, to give back to each his own.
    """

    t: float
    label: int
    other: int
    p: float
    since: float


@dataclass(frozen=True, slots=True)
class Met:
    """Two people have stood within reach of each other ``since``: one may have handed the other something then."""

    t: float
    label: int
    other: int
    since: float


FloorEvent = Appeared | Moved | Vanished | Stale | Back | Confused | Met
