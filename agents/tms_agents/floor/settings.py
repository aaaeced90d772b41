"""What the floor estimator is told: where the lasers are, what is known of the room, and how careful it is."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from tms_agents.devices.scans import Sweep

Point = tuple[float, float]
Polygon = Sequence[Point]
Pose = tuple[float, float, float]


@dataclass(frozen=True, slots=True, eq=False)
class Sensor:
    """A laser: how it sweeps and where it is in the room (x m, y m, heading rad, counter-clockwise).

    ``range_scale``: what it measures times this is how far it is (None: as the walls of a known region tell).
    """

    sweep: Sweep
    pose: Pose
    range_scale: float | None = None

    def __post_init__(self) -> None:
        if self.range_scale is not None and not 0.9 < self.range_scale < 1.1:
            raise ValueError("no laser measures a tenth too long or too short")


@dataclass(frozen=True, slots=True)
class Scene:
    """What is known of the room, in its frame, metres. Everything may be left out.

    ``region``: where labels are wanted. ``gates``: where people come in and go out (none: learned from who comes).
    ``masks``: where nothing is looked for. ``seats``: where people leave the scan plane without leaving the room (bed,
    chair). ``mirrors``: flat mirrors on the floor, each a segment. ``robots``: their width and length (none: learned).
    """

    region: Polygon | None = None
    gates: Sequence[Polygon] = ()
    masks: Sequence[Polygon] = ()
    seats: Sequence[Polygon] = ()
    mirrors: Sequence[tuple[Point, Point]] = ()
    robots: Sequence[tuple[float, float]] = ()

    def __post_init__(self) -> None:
        polygons = [*self.gates, *self.masks, *self.seats, *([] if self.region is None else [self.region])]
        if any(len(polygon) < 3 for polygon in polygons):
            raise ValueError("a polygon needs at least three corners")
        if any(math.dist(*mirror) < 0.05 for mirror in self.mirrors):
            raise ValueError("a mirror must be at least 5 cm wide")
        if any(min(robot) <= 0 for robot in self.robots):
            raise ValueError("a robot's width and length must be positive")


@dataclass(frozen=True, slots=True)
class FloorSettings:
    """How careful the estimator is; the defaults suit a room of some metres and scans at 7 to 40 Hz.

    Nothing is set for the height of the laser: whether it sees legs, or shoes only while they stand, is learned from
    everybody's feet.
    """

    #: Background: how long it is only learned, from when on something may be called foreground, and how it forgets.
    learn_s: float = 6.0
    start_s: float = 1.5
    forget_s: float = 300.0
    drift_s: float = 20.0
    raise_s: float = 1.5
    #: Foreground is nearer than the background by both.
    sigmas: float = 4.0
    threshold_m: float = 0.02
    #: Segmentation: the smallest angle at which a surface is still one thing (Borges and Aldon 2004).
    grazing_rad: float = math.radians(15.0)
    #: A mover is believed after this time and way.
    confirm_s: float = 0.35
    confirm_m: float = 0.25
    #: A mover that should be seen and is not has left after this time.
    leave_s: float = 1.5
    #: A mover hidden behind something is kept for so long (on a seat: a day).
    hidden_s: float = 60.0
    #: A mover is stale when it has not been seen for so long.
    stale_s: float = 1.0
    #: An object has rested for so long (alone: nobody near since), and is so wide at most.
    rest_s: float = 1.2
    alone_s: float = 0.7
    object_width_m: float = 0.26
    #: Removal: so much time of beams passing beyond.
    free_s: float = 0.5
    #: Something wide that rests so long without a mover at it is furniture.
    absorb_s: float = 2.0

    def __post_init__(self) -> None:
        numbers = [getattr(self, name) for name in self.__dataclass_fields__]
        if not all(number > 0 and math.isfinite(number) for number in numbers):
            raise ValueError("the floor settings must be positive numbers")
