"""Rooms drawn at random: size, niche, doors, furniture that leaves room to walk, lasers at the walls."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from tms_agents.simulation.floor_world.gait import FeetKind
from tms_agents.simulation.floor_world.lasers import Laser, Mount, misplaced
from tms_agents.simulation.floor_world.plan import Door, Plan, Ways
from tms_agents.simulation.floor_world.room import Furniture, LiveRoom, Wall
from tms_agents.simulation.floor_world.shapes import MIRROR, Material, Pose, Xy, box_corners, to_box

_DARK = Material(0.1, 0.7)
#: (id, kind, width, depth, leg radius, stands at a wall)
_PIECES = (
    ("bed", "legs", 2.0, 0.95, 0.03, True),
    ("cabinet1", "box", 0.8, 0.42, 0.0, True),
    ("cabinet2", "box", 0.6, 0.4, 0.0, True),
    ("table", "legs", 1.2, 0.7, 0.025, False),
    ("chair", "legs", 0.44, 0.42, 0.013, False),
    ("bin", "box", 0.26, 0.26, 0.0, True),
    ("trolley", "box", 0.55, 0.35, 0.0, True),
)


#: Share of the places where somebody can stand that some laser must see.
IN_SIGHT = 0.92


@dataclass(frozen=True, kw_only=True, slots=True)
class Setting:
    """What kind of room a scenario needs."""

    lasers: int = 1
    mirror: bool = False
    divider: bool = False  # a wall between two parts, each laser sees one
    doors: int = 1
    spacious: bool = False
    extrinsic: bool = False  # also the first laser is not quite where its user believes


@dataclass(frozen=True, slots=True)
class Home:
    plan: Plan
    furniture: list[Furniture]
    mounts: list[Mount]


def furnish(setting: Setting, laser: Laser, rng: np.random.Generator) -> Home:
    """A room as the setting wants it: there is a way to all of the open floor, and nearly all of it is in sight, since
    an installer puts a laser where it sees."""
    while True:
        plan = _plan(setting, rng)
        mounts = _mounts(plan, setting, laser, rng)
        furniture = _pieces(plan, mounts, setting, rng)
        if furniture is not None and _walkable(plan, furniture):
            home = Home(plan, furniture, mounts)
            if _in_sight(home) >= IN_SIGHT:
                return home


def live_room(home: Home, rng: np.random.Generator, feet: FeetKind) -> LiveRoom:
    return LiveRoom(home.plan.walls(), home.furniture, home.mounts, rng, feet)


def _plan(setting: Setting, rng: np.random.Generator) -> Plan:
    width, depth = rng.uniform(5.4, 6.8), rng.uniform(4.2, 5.2)
    if setting.spacious:
        width, depth = width + 1.0, depth + 0.8
    niche = (rng.uniform(0.8, 1.5), rng.uniform(0.8, 1.2)) if rng.random() < 0.5 else (0.0, 0.0)
    doors = [Door(wall="e", y=rng.uniform(0.9, depth - niche[1] - 0.9))]
    if setting.doors > 1:
        doors.append(Door(wall="w", y=rng.uniform(0.9, depth - 0.9)))
    inner: list[Wall] = []
    if setting.mirror:
        x = rng.uniform(0.6, width - 2.2)
        inner.append(Wall((x, 0.012), (x + 1.5, 0.012), MIRROR))
    if setting.divider:
        x = width * rng.uniform(0.42, 0.58)
        reach = depth * rng.uniform(0.45, 0.55)
        inner += [Wall((x, 0.0), (x, reach)), Wall((x, reach), (x + 0.1, reach)), Wall((x + 0.1, reach), (x + 0.1, 0))]
    return Plan(width=width, depth=depth, niche=niche, doors=tuple(doors), inner=tuple(inner))


def _mounts(plan: Plan, setting: Setting, laser: Laser, rng: np.random.Generator) -> list[Mount]:
    w, d = plan.width, plan.depth
    off = 0.06
    north_east = w - plan.niche[0] - off if plan.niche[0] else w - off
    spots: list[Pose] = [(off, off, math.pi / 4), (rng.uniform(0.4, 0.6) * w, off, math.pi / 2)]
    if setting.mirror:  # it must see the mirror on the south wall
        spots = [(off, d - off, -math.pi / 4), (rng.uniform(0.35, 0.6) * w, d - off, -math.pi / 2)]
        spots = [pose for pose in spots if plan.contains(pose[:2], 0.05)]
    if setting.divider:
        spots = [(off, off, math.pi / 4)]
    first = spots[rng.integers(len(spots))]
    error = (0.012, 0.3) if setting.extrinsic else (0.0, 0.0)
    mounts = [misplaced("A", laser, first, rng, *error)]
    if setting.lasers > 1:
        second: Pose = (w - off, off, 3 * math.pi / 4) if setting.divider else (north_east, d - off, -3 * math.pi / 4)
        mounts.append(misplaced("B", laser, second, rng, 0.012, 0.3))
    return mounts


def _pieces(plan: Plan, mounts: list[Mount], setting: Setting, rng: np.random.Generator) -> list[Furniture] | None:
    placed: list[Furniture] = []
    for name, kind, width, depth, leg, at_wall in _PIECES:
        if setting.divider and name in ("table", "cabinet2"):
            continue
        for _ in range(60):
            pose = _pose(plan, depth, at_wall, rng)
            material = _DARK if kind == "box" and rng.random() < 0.15 else Material(rng.uniform(0.3, 0.8))
            piece = Furniture(
                id=name, kind="legs" if kind == "legs" else "box", width=width, depth=depth, pose=pose,
                leg_radius=leg, material=material,
            )  # fmt: skip
            if _fits(plan, mounts, placed, piece):
                placed.append(piece)
                break
        else:
            return None
    return placed


def _pose(plan: Plan, depth: float, at_wall: bool, rng: np.random.Generator) -> Pose:
    if not at_wall:
        return (rng.uniform(1, plan.width - 1), rng.uniform(0.9, plan.depth - 0.9), rng.uniform(-0.3, 0.3))
    gap = depth / 2 + rng.uniform(0.01, 0.05)
    side = rng.integers(4)
    along = rng.uniform(0.1, 0.9)
    if side == 0:
        return (along * plan.width, gap, 0.0)
    if side == 1:
        return (along * plan.width, plan.depth - gap, math.pi)
    if side == 2:
        return (gap, along * plan.depth, -math.pi / 2)
    return (plan.width - gap, along * plan.depth, math.pi / 2)


def _fits(plan: Plan, mounts: list[Mount], placed: list[Furniture], piece: Furniture) -> bool:
    corners = box_corners(piece.pose, piece.width, piece.depth)
    border = [
        (a[0] + u * (b[0] - a[0]), a[1] + u * (b[1] - a[1]))
        for a, b in zip(corners, corners[1:] + corners[:1], strict=True)
        for u in np.linspace(0, 1, 9)
    ]
    if not all(plan.contains(point) for point in border):
        return False
    keep_off: list[tuple[Xy, float]] = [((plan.width if door.wall == "e" else 0.0, door.y), 1.0) for door in plan.doors]
    keep_off += [(mount.pose[:2], 0.9) for mount in mounts]
    for wall in plan.inner:
        keep_off += [((wall.a[0], wall.a[1] + u * (wall.b[1] - wall.a[1])), 0.4) for u in np.linspace(0, 1, 6)]
        keep_off += [((wall.a[0] + u * (wall.b[0] - wall.a[0]), wall.a[1]), 0.4) for u in np.linspace(0, 1, 6)]
    if any(math.dist(point, spot) < gap for point in border for spot, gap in keep_off):
        return False
    return not any(_near(piece, other, border) for other in placed)


def _near(piece: Furniture, other: Furniture, border: list[Xy]) -> bool:
    points = np.array([*border, piece.pose[:2]])
    theirs = np.array([*box_corners(other.pose, other.width, other.depth), other.pose[:2]])
    nearest = min(
        float(to_box(points, other.pose, other.width, other.depth).min()),
        float(to_box(theirs, piece.pose, piece.width, piece.depth).min()),
    )
    return nearest < 0.25


def _in_sight(home: Home) -> float:
    """Share of the floor, in steps of 30 cm, to which a laser has a free line of sight."""
    ways = Ways(home.plan, home.furniture, (), 0.24)
    grid = [(x, y) for x in np.arange(0.3, home.plan.width, 0.3) for y in np.arange(0.3, home.plan.depth, 0.3)]
    spots = [xy for xy in grid if home.plan.contains(xy, 0.25) and ways.is_free(xy)]
    room = live_room(home, np.random.default_rng(0), "legs")
    return float(np.mean([any(room.in_view(name, xy, 0.05) for name in room.mounts) for xy in spots]))


def _walkable(plan: Plan, furniture: list[Furniture]) -> bool:
    """From the first door one comes to nearly all of the open floor."""
    ways = Ways(plan, furniture, (), 0.24)
    door = plan.doors[0]
    start = (plan.width - 0.4 if door.wall == "e" else 0.4, door.y)
    spots = [(x * plan.width, y * plan.depth) for x in (0.2, 0.4, 0.6, 0.8) for y in (0.25, 0.5, 0.75)]
    spots = [xy for xy in spots if plan.contains(xy, 0.3) and ways.is_free(xy)]
    reached = [ways.path(start, xy) is not None for xy in spots]
    return len(spots) >= 6 and sum(reached) >= len(spots) - 1
