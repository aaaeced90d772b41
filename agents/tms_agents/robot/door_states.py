"""Is a door open? Nobody told where it is closed: that is where it lies in line with the wall on both its sides.

A closed panel fills a gap of the wall, so behind its hinge and past its other end the wall goes on in line with it,
perhaps a little before or behind the plane of the panel. The direction from the hinge that has most of a wall on both
sides is the closed one; the angle from there to where the panel points says whether it is open.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from tms_agents.slam.geometry import Floats, wrapped

#: So far beside the plane of the door the wall may be (m): a door hangs in a recess.
_BESIDE_M = 0.16
#: Wall that is looked for at either side (m), in pieces of so much, and how many must be there.
_WALL_M, _PIECE_M, _LEAST = 0.6, 0.05, 3
#: What is thinner than this is in line (m).
_THICK_M = 0.035
#: Directions tried.
_DIRECTIONS = np.radians(np.arange(0.0, 360.0, 2.0))
#: A door is open from this angle on.
OPEN_RAD = np.radians(15.0)


@dataclass(frozen=True, slots=True)
class DoorAngle:
    """``angle`` (rad, counter-clockwise) from where the door is closed, in [-pi, pi)."""

    angle: float

    @property
    def state(self) -> Literal["open", "closed"]:
        return "open" if abs(self.angle) >= OPEN_RAD else "closed"


def door_angle(pose: Floats, width: float, wall: Floats) -> DoorAngle | None:
    """Of a door at ``pose`` (3,) (its hinge, +x along the panel) and ``width`` m; ``wall`` (M, 2) m are places where
    beams ended on what is no object. None where the wall beside it was not seen on both sides."""
    closed = closed_direction(pose[:2], width, wall)
    return None if closed is None else DoorAngle(float(wrapped(pose[2] - closed)))


def closed_direction(hinge: Floats, width: float, wall: Floats) -> float | None:
    """Where the panel points when the door is closed (rad)."""
    near = wall[np.hypot(*(wall - hinge).T) < width + _WALL_M + _BESIDE_M] - hinge
    if not len(near):
        return None
    scores = np.array([_on_both_sides(near, direction, width) for direction in _DIRECTIONS])
    if scores.max() < _LEAST:
        return None
    best = _DIRECTIONS[scores >= scores.max() - 0.5]
    return float(np.angle(np.exp(1j * best).sum()))


def _on_both_sides(points: Floats, direction: float, width: float) -> float:
    """Pieces of wall at the side that has fewer, of the plane parallel to the door that has most."""
    along = points @ np.array([np.cos(direction), np.sin(direction)])
    aside = points @ np.array([-np.sin(direction), np.cos(direction)])
    best = 0.0
    for plane in np.arange(-_BESIDE_M, _BESIDE_M + 1e-9, _THICK_M):
        s = along[np.abs(aside - plane) < _THICK_M]
        before = _pieces(-s)
        behind = _pieces(s - width)
        gap = _pieces(s[(s > 0.1) & (s < width - 0.1)] - 0.1)
        best = max(best, min(before, behind) + 0.01 * (before + behind) - gap)
    return best


def _pieces(distances: Floats) -> int:
    """Into how many pieces of the first stretch of wall the distances fall."""
    inside = distances[(distances > 0) & (distances < _WALL_M)]
    return len(np.unique((inside / _PIECE_M).astype(int)))
