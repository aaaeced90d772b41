"""What lies under a gripper that lets go: a smart cabinet, a table, the floor, or nothing within reach."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

from tms_agents.hand.events import Spot
from tms_client.grasping import Onto
from tms_schemas.base import Xy
from tms_schemas.rooms import Furniture, Room, Surface


class Below(NamedTuple):
    """Where a released thing comes to lie. ``watched``: a sensor of another agent sees it and tells it itself."""

    onto: Onto
    surface: str | None
    watched: bool
    z: float | None


@dataclass(frozen=True, kw_only=True, slots=True)
class Reach:
    """Distances in metres.

    Args:
        above: a thing is put on a surface from at most this high (the gripper's point above it; things are tall).
        beside: a gripper so far off the edge may still have put the thing on the surface.
        through: the gripper may be so much below the surface (error of the kinematics).
    """

    above: float = 0.5
    beside: float = 0.1
    through: float = 0.05


class Surfaces:
    """The furniture of a room. ``floor_watched`` None: watched where the room has a sensor of kind ``floor``."""

    def __init__(self, room: Room | None, *, reach: Reach | None = None, floor_watched: bool | None = None) -> None:
        self._reach = reach or Reach()
        self._furniture = () if room is None else tuple(room.furniture)
        sensed = room is None or any(sensor.kind == "floor" for sensor in room.sensors)
        self._floor_watched = sensed if floor_watched is None else floor_watched

    def under(self, spot: Spot) -> Below:
        """The highest surface right under the gripper; else one just beside it; else the floor if it is near.

        In mid-air nothing is under it: it was taken by a person, or fell; ``person`` says that nobody saw where.
        Without a height the highest surface is taken.
        """
        for margin in (0.0, self._reach.beside):
            found = [
                (surface.z, piece, surface)
                for piece in self._furniture
                for surface in piece.surfaces or [Surface(id="whole", polygon=piece.polygon)]
                if distance_outside(spot.xy, surface.polygon) <= margin and self._within(spot, piece, surface)
            ]
            if found:
                _, piece, surface = max(found, key=lambda one: one[0])
                return self._on(piece, surface)
        if spot.z is not None and spot.z > self._reach.above:
            return Below("person", None, True, None)
        return Below("floor", None, self._floor_watched, 0.0)

    def _within(self, spot: Spot, piece: Furniture, surface: Surface) -> bool:
        if spot.z is None or not piece.surfaces:  # furniture without surfaces: nobody told how high it is
            return True
        return -self._reach.through <= spot.z - surface.z <= self._reach.above

    @staticmethod
    def _on(piece: Furniture, surface: Surface) -> Below:
        if piece.agent is not None:
            return Below("cabinet", None, True, None)
        if not piece.surfaces:
            return Below("table", None, False, None)
        return Below("table", f"{piece.id}/{surface.id}", False, surface.z)


def distance_outside(point: Xy, polygon: list[Xy]) -> float:
    """0 inside a polygon or on its edge, else the distance to its edge."""
    x, y = point
    inside, nearest = False, math.inf
    for (ax, ay), (bx, by) in zip(polygon, [*polygon[1:], polygon[0]], strict=True):
        if (ay > y) != (by > y) and x < ax + (y - ay) * (bx - ax) / (by - ay):
            inside = not inside
        dx, dy = bx - ax, by - ay
        length2 = dx * dx + dy * dy
        along = 0.0 if length2 == 0.0 else max(0.0, min(1.0, ((x - ax) * dx + (y - ay) * dy) / length2))
        nearest = min(nearest, math.hypot(x - ax - along * dx, y - ay - along * dy))
    return 0.0 if inside else nearest
