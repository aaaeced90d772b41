"""What people and robots do all day: reusable pieces of scripted lives."""

from __future__ import annotations

import math
from collections.abc import Generator
from itertools import pairwise
from typing import Literal

import numpy as np

from tms_agents.simulation.floor_world.life import Life
from tms_agents.simulation.floor_world.movers import Mover
from tms_agents.simulation.floor_world.room import Thing
from tms_agents.simulation.floor_world.shapes import Material, Pose, Xy
from tms_agents.simulation.floor_world.tasks import Do, Drag, Face, Go, Sit, Story, Task, Wait

#: Who was kept from where he would go tries again, so often at most; so near (m) he is there. What he puts down or
#: takes is within reach, and he does not stand on it.
_TRIES, _THERE_M, _BESIDE_M, _REACH_M = 4, 0.3, 0.3, 0.75


def wander(life: Life, me: Mover, until: float, pause: float = 0.4) -> Story:
    """Here and there, with a pause at the end of some ways."""
    while life.now < until:
        yield Go(life.random_place())
        if me.rng.random() < pause:
            yield Wait(me.rng.uniform(0.5, 7.0))


def cross(life: Life, me: Mover, until: float, eager: float) -> Story:
    """Wander; this share of the ways leads past somebody else, at less than half a metre."""
    while life.now < until:
        others = [other for other in life.others(me) if life.plan.contains(other.xy, 0.2)]
        goal = life.random_place()
        for _ in range(8 if others and me.rng.random() < eager else 0):
            other = others[me.rng.integers(len(others))]
            soon = math.dist(me.xy, other.xy) / (me.speed + 1.0)  # where they will meet
            meet = (other.xy[0] + soon * other.velocity[0], other.xy[1] + soon * other.velocity[1])
            reach = 1 + me.rng.uniform(0.5, 1.8) / (math.dist(me.xy, meet) or 1.0)
            past = (me.xy[0] + reach * (meet[0] - me.xy[0]), me.xy[1] + reach * (meet[1] - me.xy[1]))
            if life.plan.contains(past, 0.3) and life.ways(me).is_free(past):
                goal = past
                break
        yield Go(goal)
        if me.rng.random() < 0.3:
            yield Wait(me.rng.uniform(0.5, 6.0))


def arrival(life: Life, i: int = 0) -> Xy:
    """Where somebody comes from: a place in the corridor by a door, out of sight; ``i`` counts the doors through."""
    doors = life.plan.doors
    return life.plan.outside(doors[i % len(doors)], life.rng)


def leave(life: Life, me: Mover) -> Story:
    """Out of the nearest door and out of sight; nobody vanishes from the room."""
    doors = life.plan.doors
    door = min(doors, key=lambda d: math.dist(me.xy, (life.plan.width if d.wall == "e" else 0.0, d.y)))
    yield Go(life.plan.outside(door, me.rng), 40.0)
    while life.plan.contains(me.xy, -0.3):
        yield Wait(me.rng.uniform(0.5, 3.0))
        yield Go(life.plan.outside(door, me.rng), 40.0)


def put(life: Life, me: Mover, thing: Thing) -> Story:
    """Go there, bend down, put it, get up; nothing where one does not get or where something else lies by now."""
    reaches = yield from _stand_before(life, me, thing.pose[:2])
    while any(math.dist(other.xy, thing.pose[:2]) < other.radius + 0.2 for other in life.others(me)):
        yield Wait(0.5)
    if reaches and not _is_taken(life, thing):
        yield Do(lambda t: life.place(thing, me.id, t))
        yield Wait(me.rng.uniform(0.4, 1.2))


def pick(life: Life, me: Mover, thing: str) -> Story:
    """The same the other way round; nothing where somebody else was faster."""
    if thing not in life.room.things:
        return
    reaches = yield from _stand_before(life, me, life.room.things[thing].pose[:2])
    if reaches:
        yield Do(lambda t: life.pick(thing, me.id, t) if thing in life.room.things else None)
        yield Wait(me.rng.uniform(0.4, 1.2))


def push(life: Life, me: Mover, furniture: str, to: Pose) -> Story:
    """Go beside a piece of furniture, best behind it, and take it along to another pose."""
    piece = life.room.furniture[furniture]
    reach = math.hypot(piece.width, piece.depth) / 2 + 0.27
    way = math.atan2(to[1] - piece.pose[1], to[0] - piece.pose[0])
    for turn in sorted(np.linspace(-math.pi, math.pi, 24), key=abs):
        dx, dy = reach * math.cos(way + math.pi + turn), reach * math.sin(way + math.pi + turn)
        start, end = (piece.pose[0] + dx, piece.pose[1] + dy), (to[0] + dx, to[1] + dy)
        tight = life.tight_ways()
        if all(life.plan.contains(xy, 0.15) for xy in (start, end)) and tight.is_free(start) and tight.is_free(end):
            break
    else:
        return
    if not (yield from _arrive(me, start)):
        return
    yield Face(piece.pose[:2])
    corners = life.clear_way(me, furniture, to)
    far = sum(math.dist(a, b) for a, b in pairwise([piece.pose[:2], *corners]))
    yield Drag(furniture, to, max(1.5, far / 0.4), tuple(corners))
    yield Wait(me.rng.uniform(0.5, 1.5))


def sit(life: Life, me: Mover, seconds: float) -> Story:
    """On the bed: feet off the floor."""
    bed = life.room.furniture["bed"]
    c, s = math.cos(bed.pose[2]), math.sin(bed.pose[2])
    sides = [(bed.pose[0] - v * s, bed.pose[1] + v * c) for v in (0.85, -0.85)]
    side = max(sides, key=lambda xy: life.plan.contains(xy, 0.2) and life.ways(me).is_free(xy))
    if not (yield from _arrive(me, life.ways(me).nearest_free(side))):
        return
    inward = (bed.pose[0] - side[0], bed.pose[1] - side[1])
    yield Sit((side[0] + 0.75 * inward[0], side[1] + 0.75 * inward[1]), seconds)


def new_thing(
    life: Life,
    size: float,
    name: str,
    material: Material | None = None,
    where: Literal["open", "wall"] = "open",
) -> Thing:
    """A thing at a place that a laser can see now: on the open floor, or less than 10 cm before a wall.

    On the open floor, too, where no wall has such a place. Raises RuntimeError where there is none at all.
    """
    shape: Literal["disc", "box"] = "disc" if life.rng.random() < 0.5 or size < 0.05 else "box"
    for _ in range(4000):
        xy = _by_the_wall(life, size) if where == "wall" else life.random_place(0.35)
        if xy is None:
            continue
        if all(math.dist(xy, thing.pose[:2]) > 0.45 for thing in life.room.things.values()) and all(
            math.dist(xy, mover.xy) > 0.5 for mover in life.movers.values()
        ):
            pose = (*xy, life.rng.uniform(-math.pi, math.pi))
            thing = Thing(id=name, size=size, shape=shape, pose=pose, material=material or _plain(life.rng))
            if would_see(life, thing):
                return thing
    if where == "wall":
        return new_thing(life, size, name, material)
    raise RuntimeError(f"no place for {name} in 4000 attempts")


def would_see(life: Life, thing: Thing) -> bool:
    """More than a beam and a half of a laser would meet the thing, were it there and nobody in the way."""
    for name, mount in life.room.mounts.items():
        distance = math.dist(mount.pose[:2], thing.pose[:2])
        width = thing.size if thing.shape == "disc" else 0.6 * thing.size
        large = width / distance > 1.6 * mount.laser.step and distance < 0.9 * mount.laser.range_max_m
        if large and life.room.in_view(name, thing.pose[:2], thing.size / 2 + 0.02):
            return True
    return False


def _arrive(me: Mover, to: Xy) -> Generator[Task, None, bool]:
    """Walk there, again where somebody was in the way: whether one has come there."""
    for _ in range(_TRIES):
        yield Go(to)
        if math.dist(me.xy, to) < _THERE_M:
            return True
        yield Wait(me.rng.uniform(1.0, 4.0))
    return False


def _stand_before(life: Life, me: Mover, xy: Xy) -> Generator[Task, None, bool]:
    """Walk to a place beside this one and look at it: whether it is within reach."""
    for _ in range(_TRIES):
        spots = []
        for turn in np.linspace(0, 2 * math.pi, 24, endpoint=False):
            gap = me.rng.uniform(0.36, 0.46)
            spot = (xy[0] + gap * math.cos(turn), xy[1] + gap * math.sin(turn))
            if life.plan.contains(spot, 0.22) and life.tight_ways().is_free(spot):
                spots.append(spot)
        spot = spots[me.rng.integers(len(spots))] if spots else life.ways(me).nearest_free(xy)
        yield Go(spot)
        yield Face(xy)
        yield Wait(me.rng.uniform(0.6, 1.4))
        if _BESIDE_M < math.dist(me.xy, xy) < _REACH_M:
            return True
    return False


def _is_taken(life: Life, thing: Thing) -> bool:
    """Whether something else lies where the thing is to be put."""
    others = [other for other in life.room.things.values() if other is not thing]
    return any(math.dist(thing.pose[:2], other.pose[:2]) < 0.6 * (thing.size + other.size) for other in others)


def _by_the_wall(life: Life, size: float) -> Xy | None:
    """Its near side is 1 to 8 cm off a wall."""
    plan, gap = life.plan, size / 2 + life.rng.uniform(0.01, 0.08)
    side, along = life.rng.integers(4), life.rng.uniform(0.08, 0.92)
    xy = (
        (along * plan.width, gap),
        (along * plan.width, plan.depth - gap),
        (gap, along * plan.depth),
        (plan.width - gap, along * plan.depth),
    )[side]
    at_door = any(abs(xy[1] - door.y) < 0.8 for door in plan.doors) and side >= 2
    blocked = any(piece.distance(xy) < 0.35 for piece in life.room.furniture.values())
    reachable = life.tight_ways().is_free(_inward(plan.width, plan.depth, xy, 0.45))
    if at_door or blocked or not reachable or not plan.contains(xy):
        return None
    return xy


def _inward(width: float, depth: float, xy: Xy, by: float) -> Xy:
    return (min(max(xy[0], by), width - by), min(max(xy[1], by), depth - by))


def _plain(rng: np.random.Generator) -> Material:
    return Material(rng.uniform(0.3, 0.8))
