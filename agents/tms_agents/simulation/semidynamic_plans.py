"""Corridors and rooms with doors, bins, chairs and wheeled cabinets that are moved while the robot is not looking."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from tms_agents.simulation.building import Rectangle, edges

Floats = NDArray[np.float64]
Pose = tuple[float, float, float]
#: A door stands so deep in its wall (m).
_RECESS = 0.11


@dataclass(frozen=True, slots=True, eq=False)
class Thing:
    """``parts`` closed polygons (P, 2) m in its frame, ``tag`` pose on it; ``poses``: one for each interval of time.

    ``closed`` is the angle of a door that is closed, its origin is the hinge."""

    label: str
    kind: str
    parts: tuple[Floats, ...]
    tag: Pose
    poses: list[Pose]
    closed: float | None = None


@dataclass(slots=True, eq=False)
class Plan:
    """``rectangles`` are where one can walk, ``route`` (W, 2) m is driven in every pass, or ``laps`` times in one."""

    rectangles: list[Rectangle]
    route: Floats
    passes: int = 3
    laps: int = 0
    antennas: list[Pose] = field(default_factory=lambda: [(0.15, 0.0, 0.0)])
    things: list[Thing] = field(default_factory=list)

    @property
    def walls(self) -> Floats:
        return edges(self.rectangles)


def short(random: np.random.Generator) -> Plan:
    """A corridor of 9 to 12 m with two doors and two bins."""
    length, width = random.uniform(9, 12), random.uniform(2.0, 2.6)
    plan = _corridor(length, width)
    _doors(plan, [(0.35 * length, 0), (0.62 * length, 1)], width, random, ("door_large", "door_small"))
    _bins(plan, [(0.2 * length, 1), (0.55 * length, 0)], width, random)
    return plan


def long(random: np.random.Generator) -> Plan:
    """A corridor of 50 m with 13 doors and 11 bins."""
    width = random.uniform(2.0, 2.5)
    plan = _corridor(50.0, width)
    places = [(3.0 + 3.6 * n + random.uniform(-0.5, 0.5), n % 2) for n in range(13)]
    kinds = ["door_large", "door_small"] * 6 + ["door_small"]
    _doors(plan, places, width, random, kinds)
    _bins(plan, [(x + 1.8, side) for x, side in places[:11]], width, random)
    return plan


def clutter(random: np.random.Generator) -> Plan:
    """A bin right beside each of five doors."""
    length, width = random.uniform(13, 16), random.uniform(2.1, 2.6)
    plan = _corridor(length, width, passes=2)
    places = [(2.2 + n * (length - 4) / 5, n % 2) for n in range(5)]
    _doors(plan, places, width, random, ["door_small", "door_large", "door_small", "door_large", "door_small"])
    _bins(plan, [(x - 0.4 + random.uniform(-0.1, 0.1), side) for x, side in places], width, random, near=0.25)
    return plan


def room(random: np.random.Generator) -> Plan:
    """A furnished room with wheeled cabinets, chairs, a bin and a door."""
    side = random.uniform(7.0, 8.5)
    route = np.array([(1.6, 1.6), (side - 1.6, 1.6), (side - 1.6, side - 1.6), (1.6, side - 1.6), (1.6, 1.6)])
    plan = Plan([(0.0, 0.0, side, side)], route, antennas=[(0.1, 0.12, 0.87), (0.1, -0.12, -0.87)])
    plan.rectangles.append((side, 0.45 * side - 0.55, side + _RECESS, 0.45 * side + 0.55))
    plan.rectangles.append((side + _RECESS, 0.45 * side - 1.2, side + 2.5, 0.45 * side + 1.2))
    angles = _swings(plan.passes, np.pi / 2, 1.0, random)
    hinge = (side + _RECESS, 0.45 * side - 0.55)
    poses = [(*hinge, angle) for angle in angles]
    plan.things.append(
        Thing("door_1", "door_large", (_box(0.0, -0.02, 1.08, 0.02),), (0.4, 0.02, np.pi / 2), poses, np.pi / 2)
    )
    middle = np.array([side / 2, side / 2])
    for number in range(3):
        _free(plan, f"cabinet_{number + 1}", "cabinet", middle, 0.5 * side - 0.5, random)
    for number in range(4):
        _free(plan, f"chair_{number + 1}", "chair", middle, 0.5 * side - 0.4, random)
    _free(plan, "bin_1", "bin_round", middle, 0.5 * side - 0.3, random)
    return plan


def loop(random: np.random.Generator) -> Plan:
    """A ring of corridors of 120 m, driven twice without a stop."""
    width = random.uniform(2.0, 2.4)
    half = width / 2
    plan = Plan(
        [
            (-half, -half, 40 + half, half),
            (40 - half, -half, 40 + half, 20 + half),
            (-half, 20 - half, 40 + half, 20 + half),
            (-half, -half, half, 20 + half),
        ],
        np.array([(0.0, 0.0), (40.0, 0.0), (40.0, 20.0), (0.0, 20.0), (0.0, 0.0)]),
        passes=2,
        laps=2,
    )
    for level, sign in ((0.0, -1), (20.0, 1)):
        places = [3.0 + 6.0 * n + random.uniform(-1, 1) for n in range(6)]
        for n, x in enumerate(places):
            _door(plan, x, level + sign * half, sign, random, ("door_large", "door_small")[n % 2])
            _bin(plan, x + 2.5, level + sign * (half - 0.25), random)
    return plan


def shifted(random: np.random.Generator) -> Plan:
    """A bare corridor in which all wheeled things shift alike between passes."""
    length, width = random.uniform(18, 24), random.uniform(2.0, 2.6)
    plan = _corridor(length, width)
    way = random.uniform(0.25, 0.5)
    for number in range(7):
        x, side = 2.0 + number * (length - 5) / 7, number % 2
        y = width - 0.3 if side else 0.3
        theta = float(random.uniform(-0.2, 0.2) + np.pi / 2 * random.integers(4))
        kind = ("cabinet", "bin_box")[number % 2]
        poses = [(x + way * k, y, theta) for k in range(plan.passes)]
        plan.things.append(_thing(f"{kind}_{number}", kind, poses))
    return plan


def ward(random: np.random.Generator) -> Plan:
    """A short corridor with two doors and two bins; between two passes the one door is closed and the other opened."""
    while True:
        plan = _corridor(7.0, 2.3, passes=2)
        plan.antennas = [(0.1, 0.12, 0.87), (0.1, -0.12, -0.87)]
        _doors(plan, [(1.9, 1), (4.0, 0)], 2.3, random, ("door_large", "door_small"))
        _bins(plan, [(1.4, 0), (4.4, 1)], 2.3, random, near=0.4)
        turned = [[abs(pose[2] - (door.closed or 0.0)) for pose in door.poses] for door in plan.things[:2]]
        if min(turned[0][0], turned[1][1]) > 0.8 and max(turned[0][1], turned[1][0]) < 1e-9:
            return plan


PLANS: dict[str, Callable[[np.random.Generator], Plan]] = {
    "short": short,
    "long": long,
    "clutter": clutter,
    "room": room,
    "ward": ward,
    "loop": loop,
    "shifted": shifted,
}


def _corridor(length: float, width: float, passes: int = 3) -> Plan:
    middle = width / 2
    route = np.array([(1.0, middle), (length - 1.0, middle), (1.0, middle)])
    return Plan([(0.0, 0.0, length, width)], route, passes)


def _doors(
    plan: Plan, places: list[tuple[float, int]], width: float, random: np.random.Generator, kinds: object
) -> None:
    assert isinstance(kinds, (list, tuple))
    for (x, side), kind in zip(places, kinds, strict=True):
        _door(plan, x, width if side else 0.0, 1 if side else -1, random, kind)


def _door(plan: Plan, x: float, wall: float, sign: int, random: np.random.Generator, kind: str) -> None:
    """In a wall along x at y = ``wall``; ``sign`` is the side of the room behind it."""
    long, thick = {"door_large": (random.uniform(0.95, 1.15), 0.04), "door_small": (random.uniform(0.62, 0.75), 0.035)}[
        kind
    ]
    into_room = random.uniform() < 0.7
    # What opens into the corridor hangs at its side of the wall.
    plane, far = wall + sign * (_RECESS if into_room else 0.03), wall + sign * _RECESS
    plan.rectangles.append((x, min(wall, far), x + long + 0.02, max(wall, far)))
    deep = far + sign * random.uniform(1.8, 2.6)
    plan.rectangles.append((x - 0.5, min(far, deep), x + long + 0.6, max(far, deep)))
    # Hinged at the right or left; opens into the corridor or the room.
    left = random.uniform() < 0.5
    hinge, closed = ((x + 0.01, plane), 0.0) if left else ((x + long + 0.01, plane), np.pi)
    turn = (1.0 if left else -1.0) * (sign if into_room else -sign)
    poses = [(*hinge, angle) for angle in _swings(plan.passes, closed, turn, random)]
    face = -1.0 if (np.cos(closed) > 0) == (sign > 0) else 1.0
    tag = (long * random.uniform(0.3, 0.5), face * thick / 2, face * np.pi / 2)
    number = sum(thing.kind == kind for thing in plan.things) + 1
    parts = (_box(0.0, -thick / 2, long, thick / 2),)
    plan.things.append(Thing(f"{kind}_{number}", kind, parts, tag, poses, closed))


def _swings(passes: int, closed: float, turn: float, random: np.random.Generator) -> list[float]:
    """Open and closed by turns, sometimes as before."""
    found: list[float] = []
    for _ in range(passes):
        if found and random.uniform() < 0.3:
            found.append(found[-1])
        else:
            found.append(closed + turn * (0.0 if random.uniform() < 0.45 else random.uniform(0.5, 1.6)))
    return found


def _bins(
    plan: Plan, places: list[tuple[float, int]], width: float, random: np.random.Generator, near: float = 0.7
) -> None:
    for x, side in places:
        _bin(plan, x, width - 0.25 if side else 0.25, random, near)


def _bin(plan: Plan, x: float, y: float, random: np.random.Generator, near: float = 0.7) -> None:
    number = sum(thing.kind.startswith("bin") for thing in plan.things) + 1
    kind = "bin_round" if random.uniform() < 0.35 else "bin_box"
    poses: list[Pose] = []
    inward = np.pi / 2 if y < plan.route[0, 1] or y < 0 else -np.pi / 2
    for _ in range(plan.passes):
        if poses and random.uniform() < 0.3:
            poses.append(poses[-1])
        else:
            theta = inward + random.uniform(-0.9, 0.9)
            poses.append((x + random.uniform(-near, near), y + random.uniform(-0.04, 0.04), theta))
    plan.things.append(_thing(f"bin_{number}", kind, poses))


def _free(plan: Plan, label: str, kind: str, middle: Floats, reach: float, random: np.random.Generator) -> None:
    """Somewhere in a room, off the route and off other things."""
    poses: list[Pose] = []
    for n in range(plan.passes):
        if poses and random.uniform() < 0.3:
            poses.append(poses[-1])
            continue
        for _ in range(500):
            at = middle + random.uniform(-reach, reach, 2)
            others = [np.hypot(*(at - thing.poses[n][:2])) for thing in plan.things]
            off = np.abs(np.abs(at - middle).max() - np.abs(plan.route[0] - middle).max())
            if off > 0.75 and min(others, default=9.0) > 0.8:
                break
        poses.append((float(at[0]), float(at[1]), float(random.uniform(-np.pi, np.pi))))
    plan.things.append(_thing(label, kind, poses))


def _thing(label: str, kind: str, poses: list[Pose]) -> Thing:
    if kind == "bin_box":
        return Thing(label, kind, (_box(-0.15, -0.15, 0.15, 0.15),), (0.15, 0.0, 0.0), poses)
    if kind == "bin_round":
        turns = np.pi / 8 * (np.arange(16) + 0.5)
        ring = 0.16 * np.stack([np.cos(turns), np.sin(turns)], axis=-1)
        return Thing(label, kind, (ring,), (0.157, 0.0, 0.0), poses)
    if kind == "chair":
        legs = tuple(_box(x - 0.02, y - 0.02, x + 0.02, y + 0.02) for x in (-0.19, 0.19) for y in (-0.19, 0.19))
        return Thing(label, kind, legs, (0.21, 0.0, 0.0), poses)
    return Thing(label, kind, (_box(-0.22, -0.3, 0.22, 0.3),), (0.22, 0.0, 0.0), poses)


def _box(x0: float, y0: float, x1: float, y1: float) -> Floats:
    return np.array([(x0, y0), (x1, y0), (x1, y1), (x0, y1)])
