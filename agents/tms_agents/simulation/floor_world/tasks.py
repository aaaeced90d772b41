"""What people and robots in a scripted life can do, one after the other."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

from tms_agents.simulation.floor_world.shapes import Pose, Xy


@dataclass(frozen=True, slots=True)
class Go:
    """Walk there; ``patience_s`` after which one gives up, somebody being in the way."""

    to: Xy
    patience_s: float = 20.0


@dataclass(frozen=True, slots=True)
class Wait:
    seconds: float


@dataclass(frozen=True, slots=True)
class Face:
    """Turn to look at a place."""

    at: Xy


@dataclass(frozen=True, slots=True)
class Do:
    """Something that takes no time."""

    what: Callable[[float], None]  # called with the time


@dataclass(frozen=True, slots=True)
class Drag:
    """Move a piece of furniture, walking beside it; over the places ``way``, straight if there are none."""

    furniture: str
    to: Pose
    seconds: float
    way: tuple[Xy, ...] = ()


@dataclass(frozen=True, slots=True)
class Sit:
    """Sit down there, on a bed or the like, with both feet off the floor."""

    seat: Xy
    seconds: float


Task = Go | Wait | Face | Do | Drag | Sit
Story = Iterator[Task]
