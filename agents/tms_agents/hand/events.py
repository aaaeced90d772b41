"""What happens to the thing in a hand. Times in seconds, distances in metres, room frame."""

from __future__ import annotations

import math
from typing import NamedTuple


class Spot(NamedTuple):
    """Where a gripper is in the room (m); ``cov`` is (xx, xy, yy), m^2."""

    xy: tuple[float, float]
    z: float | None = None
    cov: tuple[float, float, float] | None = None


class Grasped(NamedTuple):
    at: float
    spot: Spot
    tag: str | None


class Identified(NamedTuple):
    """The tag of what is in the hand; also where another one turns out to be it."""

    at: float
    tag: str


class Unread(NamedTuple):
    """The reader works and reads no tag at all of what is in the hand."""

    at: float


class Carried(NamedTuple):
    at: float
    spot: Spot


class Released(NamedTuple):
    """Put down, or given away, at ``spot``."""

    at: float
    spot: Spot


class Dropped(NamedTuple):
    """No longer in the hand since ``at``; ``spot`` None: nobody knows where."""

    at: float
    spot: Spot | None


GraspEvent = Grasped | Identified | Unread | Carried | Released | Dropped


def gap(a: Spot | None, b: Spot | None) -> float:
    """Distance (m); 0 where one of them is not known."""
    if a is None or b is None:
        return 0.0
    up = 0.0 if a.z is None or b.z is None else a.z - b.z
    return math.hypot(a.xy[0] - b.xy[0], a.xy[1] - b.xy[1], up)
