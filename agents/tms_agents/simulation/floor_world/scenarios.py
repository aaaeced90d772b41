"""The scenarios: which room, how long, and who does what in it."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

from tms_agents.simulation.floor_world.furnishing import Setting
from tms_agents.simulation.floor_world.life import Life
from tms_agents.simulation.floor_world.movers import Mover
from tms_agents.simulation.floor_world.room import Thing
from tms_agents.simulation.floor_world.shapes import BLACK, Material, Pose, Xy
from tms_agents.simulation.floor_world.standing import standing
from tms_agents.simulation.floor_world.stories import arrival, cross, leave, new_thing, pick, push, put, sit, wander
from tms_agents.simulation.floor_world.tasks import Drag, Face, Go, Story, Wait
from tms_agents.simulation.floor_world.visits import visits

#: Nobody is in the room before, so that a background can be learnt.
QUIET_S = 8.0
#: Length and width.
ROBOT_SIZE = (0.55, 0.42)
_USUAL, _LARGE = Setting(), Setting(doors=2, spacious=True)


@dataclass(frozen=True, kw_only=True, slots=True)
class Scenario:
    """``write`` fills the life of a room that is as ``setting`` says, for ``duration`` seconds."""

    description: str
    duration: float
    write: Callable[[Life, float], None]
    setting: Setting = _USUAL
    quiet_s: float = QUIET_S


def _crossing(people: int, eager: float, closest_m: float = 0.38) -> Callable[[Life, float], None]:
    def write(life: Life, duration: float) -> None:
        life.closest_m = closest_m
        for i in range(people):
            until = duration - life.rng.uniform(0, 12)

            def story(me: Mover, until: float = until) -> Story:
                yield from cross(life, me, until, eager)
                yield from leave(life, me)

            life.person(f"p{i + 1}", QUIET_S + life.rng.uniform(0, 1.5) + 2.2 * i, arrival(life, i), story)

    return write


def _things(life: Life, duration: float, materials: tuple[Material | None, ...] = (None,), at_wall: int = 0) -> None:
    """Two people put down things of all sizes, walk about, and pick up most of them."""
    sizes = [0.03, 0.05, 0.08, 0.15, 0.03, 0.05, 0.08, 0.15]
    order = list(life.rng.permutation(len(sizes)))

    def story(me: Mover) -> Story:
        for _ in range(4):
            k = int(order.pop())
            material = materials[k % len(materials)]
            thing = new_thing(life, sizes[k], f"o{k + 1}", material, "wall" if k < at_wall else "open")
            yield from put(life, me, thing)
            yield from wander(life, me, life.now + me.rng.uniform(0, 8))
        yield from wander(life, me, 0.55 * duration)
        yield from leave(life, me)
        yield Wait(me.rng.uniform(3, 10))
        mine = [stay.thing.id for stay in life.stays]
        for k in me.rng.permutation(len(mine))[: len(mine) // 2]:
            if life.now < duration - 25:
                yield from pick(life, me, mine[int(k)])
                yield from wander(life, me, life.now + me.rng.uniform(0, 5))
        yield from leave(life, me)

    for i in range(2):
        life.person(f"p{i + 1}", QUIET_S + 1 + 6 * i, arrival(life), story)


def _glossy(life: Life, duration: float) -> None:
    _things(life, duration, (BLACK, Material(0.12, 0.6)))


def _near_wall(life: Life, duration: float) -> None:
    _things(life, duration, at_wall=6)


def _hidden(life: Life, duration: float) -> None:
    """A trolley, a parked robot and a foot stand before things for more than a minute; some are taken meanwhile."""

    def before(thing: Thing, gap: float) -> Pose:
        laser = life.room.mounts["A"].pose
        dx, dy = laser[0] - thing.pose[0], laser[1] - thing.pose[1]
        reach = gap / math.hypot(dx, dy)
        return (thing.pose[0] + reach * dx, thing.pose[1] + reach * dy, math.atan2(dy, dx) + math.pi / 2)

    taken: list[Xy] = []

    def free(name: str, size: float, gap: float, room: float) -> Thing:
        """With a place before it that nobody else wants."""
        for attempt in range(600):
            thing = new_thing(life, size, name)
            spot = before(thing, gap)
            wanted = [math.dist(xy, one) < 0.9 - attempt / 1000 for xy in (thing.pose[:2], spot[:2]) for one in taken]
            if any(wanted):
                continue
            others = [piece for piece in life.room.furniture.values() if piece.id != "trolley"]
            clear = all(piece.distance(spot[:2]) > room for piece in others)
            if clear and life.plan.contains(spot[:2], room) and all(
                math.dist(spot[:2], other.pose[:2]) > room + 0.2 for other in life.room.things.values()
            ):  # fmt: skip
                taken.extend((thing.pose[:2], spot[:2]))
                return thing
        raise RuntimeError("no place to hide a thing")

    def porter(me: Mover) -> Story:
        things = [free("o1", 0.08, 0.5, 0.4), free("o2", 0.12, 0.5, 0.4)]
        yield from put(life, me, things[0])
        home = life.room.furniture["trolley"].pose
        yield from push(life, me, "trolley", before(things[0], 0.5))
        yield from leave(life, me)
        yield Wait(me.rng.uniform(62, 75))
        yield from push(life, me, "trolley", home)
        yield from put(life, me, things[1])
        yield from push(life, me, "trolley", before(things[1], 0.5))
        yield from wander(life, me, life.now + 10)
        yield from pick(life, me, "o2")  # while nobody can see it
        yield from wander(life, me, life.now + 8)
        yield from push(life, me, "trolley", home)
        yield from leave(life, me)

    def visitor(me: Mover) -> Story:
        thing = free("o3", float(me.rng.choice([0.05, 0.07])), 0.35, 0.25)
        yield from put(life, me, thing)
        yield from wander(life, me, life.now + 6)
        x, y, across = before(thing, 0.33)
        side = me.walker.build.half_width if me.walker else 0.0
        along = across - math.pi / 2 + math.pi  # looks at the thing
        yield Go((x + side * math.sin(along), y - side * math.cos(along)))
        yield Face((thing.pose[0] + side * math.sin(along), thing.pose[1] - side * math.cos(along)))
        yield Wait(me.rng.uniform(20, 70))
        yield from wander(life, me, life.now + 10)
        yield from leave(life, me)

    def machine(me: Mover) -> Story:
        thing = free("o4", 0.1, 0.6, 0.45)
        life.place(thing, None, life.now)
        yield Wait(12)
        x, y, across = before(thing, 0.6)
        yield Go((x, y), 60)
        yield Face((x + math.cos(across), y + math.sin(across)))
        yield Wait(me.rng.uniform(60, 80))
        yield Go(life.random_place(0.5, life.ways(me)), 40)
        yield from leave(life, me)

    life.person("p1", QUIET_S + 1, arrival(life), porter)
    life.person("p2", QUIET_S + 14, arrival(life), visitor)
    life.robot("r1", QUIET_S + 30, arrival(life), machine, ROBOT_SIZE)


def _start(life: Life, duration: float) -> None:
    """Two people and two things are there before the sensor is switched on; one person stands for long."""

    def standing(me: Mover) -> Story:
        yield Wait(me.rng.uniform(15, 30))
        yield from wander(life, me, duration - 15)
        yield from leave(life, me)

    def walking(me: Mover) -> Story:
        yield from wander(life, me, 0.4 * duration)
        yield from put(life, me, new_thing(life, 0.08, "o1"))
        yield from wander(life, me, duration)

    life.person("p1", 0.0, life.random_place(0.5), standing)
    life.person("p2", 0.0, life.random_place(0.5), walking)


def _bed(life: Life, duration: float) -> None:
    """People sit down on the bed with what they carry, and get up again; others pass meanwhile."""

    def sitter(me: Mover) -> Story:
        yield from wander(life, me, life.now + 8)
        yield from put(life, me, new_thing(life, 0.08, "o1"))
        yield from sit(life, me, me.rng.uniform(25, 45))
        yield from pick(life, me, "o1")
        yield from sit(life, me, me.rng.uniform(15, 30))
        yield from wander(life, me, duration - 15)
        yield from leave(life, me)

    def visitor(me: Mover) -> Story:
        yield from wander(life, me, duration - 20)
        yield from leave(life, me)

    life.person("p1", QUIET_S + 1, arrival(life), sitter)
    life.person("p2", QUIET_S + 18, arrival(life), visitor)


def _furniture(life: Life, duration: float) -> None:
    """Chair, bin, trolley and a cabinet are moved, a door swings; things lie about meanwhile."""

    def spot(name: str, far: float) -> Pose:
        piece = life.room.furniture[name]
        for _ in range(500):
            xy = life.random_place(0.5)
            others = [p for p in life.room.furniture.values() if p.id not in (name, "door")]
            gap = math.hypot(piece.width, piece.depth) / 2 + 0.15
            if (
                0.35 < math.dist(xy, piece.pose[:2]) < far
                and all(p.distance(xy) > gap for p in others)
                and all(math.dist(xy, thing.pose[:2]) > gap + 0.1 for thing in life.room.things.values())
                and all(math.dist(xy, mount.pose[:2]) > 1.0 for mount in life.room.mounts.values())
            ):
                return (*xy, piece.pose[2] + life.rng.uniform(-0.8, 0.8))
        return piece.pose

    def mover(me: Mover) -> Story:
        yield from put(life, me, new_thing(life, 0.11, "o1"))
        names = ["chair", "bin", "chair", "trolley", "cabinet2"]
        for k in me.rng.permutation(len(names)):
            to = spot(names[k], 1.0 if names[k] == "cabinet2" else 2.0)
            if to != life.room.furniture[names[k]].pose:
                yield from push(life, me, names[k], to)
            yield from wander(life, me, life.now + me.rng.uniform(4, 14))
        yield from put(life, me, new_thing(life, 0.08, "o2"))
        yield from pick(life, me, "o1")
        yield from leave(life, me)

    def swing(to: float) -> Callable[[float], None]:
        def start(t: float) -> None:
            door = life.room.furniture["door"]
            hinge = (door.pose[0] - door.width / 2 * math.cos(door.pose[2]),
                     door.pose[1] - door.width / 2 * math.sin(door.pose[2]))  # fmt: skip
            pose = (hinge[0] + door.width / 2 * math.cos(to), hinge[1] + door.width / 2 * math.sin(to), to)
            life.drag(Drag("door", pose, life.rng.uniform(1.2, 2.5)), t)

        return start

    life.hang_door()
    life.at(QUIET_S + 0.5, swing(life.rng.uniform(0.0, 0.35)))
    life.at(duration - 12, swing(math.pi / 2))
    life.person("p1", QUIET_S + 3, arrival(life), mover)


def _robots(life: Life, duration: float) -> None:
    """Two robots drive among people and things."""

    def machine(me: Mover) -> Story:
        while life.now < duration - 30:
            yield Go(life.random_place(0.5, life.ways(me)), 25)
            yield Wait(me.rng.uniform(1, 12))
        yield from leave(life, me)

    def person(me: Mover) -> Story:
        name = f"o{me.id[1:]}"
        yield from put(life, me, new_thing(life, float(me.rng.choice([0.05, 0.08, 0.15])), name))
        yield from wander(life, me, duration - 40)
        yield from pick(life, me, name)
        yield from leave(life, me)

    for i in range(2):
        life.robot(f"r{i + 1}", QUIET_S + 1 + 12 * i, arrival(life), machine, ROBOT_SIZE)
        life.person(f"p{i + 1}", QUIET_S + 5 + 9 * i, arrival(life), person)


def _parts(life: Life, duration: float) -> None:
    """Three people between two parts of a room, things in both."""

    def person(me: Mover) -> Story:
        name = f"o{me.id[1:]}"
        yield from wander(life, me, life.now + 5)
        yield from put(life, me, new_thing(life, float(me.rng.choice([0.05, 0.08, 0.15])), name))
        yield from cross(life, me, duration - 45, 0.4)
        yield from pick(life, me, name)
        yield from leave(life, me)

    for i in range(3):
        life.person(f"p{i + 1}", QUIET_S + 1 + 5 * i, arrival(life), person)


def _mirror(life: Life, duration: float) -> None:
    def person(me: Mover) -> Story:
        name = f"o{me.id[1:]}"
        yield from put(life, me, new_thing(life, float(me.rng.choice([0.05, 0.08, 0.15])), name))
        yield from wander(life, me, duration - 35)
        yield from pick(life, me, name)
        yield from leave(life, me)

    for i in range(2):
        life.person(f"p{i + 1}", QUIET_S + 1 + 7 * i, arrival(life), person)


def _nobody(life: Life, duration: float) -> None:
    """Nothing happens."""


def _crowd(life: Life, duration: float) -> None:
    """Eight people, two robots, twenty things: for speed."""
    left = [(f"o{k + 1}", (0.03, 0.05, 0.08, 0.15)[k % 4]) for k in range(20)]

    def person(me: Mover) -> Story:
        for _ in range(3):
            if left:
                name, size = left.pop()
                yield from put(life, me, new_thing(life, size, name))
        yield from cross(life, me, duration, 0.4)

    def machine(me: Mover) -> Story:
        while life.now < duration:
            yield Go(life.random_place(0.5, life.ways(me)), 25)
            yield Wait(me.rng.uniform(1, 5))

    for i in range(8):
        life.person(f"p{i + 1}", QUIET_S + 1.5 * i, arrival(life, i), person)
    for i in range(2):
        life.robot(f"r{i + 1}", QUIET_S + 14 + 8 * i, arrival(life, i), machine, ROBOT_SIZE)


SCENARIOS: dict[str, Scenario] = {
    "one": Scenario(description="one walker", duration=60, write=_crossing(1, 0.0)),
    "three": Scenario(description="three walkers cross within half a metre", duration=100, write=_crossing(3, 0.4)),
    "three close": Scenario(description="three walkers at close quarters", duration=100, write=_crossing(3, 1.0, 0.3)),
    "eight": Scenario(description="eight walkers", duration=90, write=_crossing(8, 0.4), setting=_LARGE),
    "things": Scenario(description="things of 3 to 15 cm come and go", duration=260, write=_things),
    "near wall": Scenario(description="things less than 10 cm before a wall", duration=260, write=_near_wall),
    "glossy": Scenario(description="black and glossy things", duration=220, write=_glossy),
    "hidden": Scenario(description="things hidden for more than a minute", duration=300, write=_hidden),
    "start": Scenario(description="people are there before the sensor", duration=100, write=_start, quiet_s=0.0),
    "bed": Scenario(description="people sit on the bed", duration=170, write=_bed),
    "standing": Scenario(
        description="people stand for minutes, things beside them", duration=420,
        write=lambda life, duration: standing(life, duration, QUIET_S),
    ),
    "visits": Scenario(
        description="visitors of seconds, one after the other", duration=180,
        write=lambda life, duration: visits(life, duration, QUIET_S, ROBOT_SIZE),
    ),
    "furniture": Scenario(description="furniture is moved, a door swings", duration=200, write=_furniture),
    "robots": Scenario(description="robots among people", duration=170, write=_robots),
    "two lasers": Scenario(
        description="two lasers, each sees a part", duration=150, write=_parts,
        setting=Setting(lasers=2, divider=True),
    ),
    "mirror": Scenario(description="a mirror on a wall", duration=130, write=_mirror, setting=Setting(mirror=True)),
    "misplaced": Scenario(
        description="three walkers, the laser 12 mm and 0.3 degrees off", duration=100, write=_parts,
        setting=Setting(extrinsic=True),
    ),
    "static": Scenario(description="an hour without anybody", duration=3600, write=_nobody),
    "crowd": Scenario(
        description="eight people, two robots, twenty things", duration=120, write=_crowd, setting=_LARGE
    ),
}  # fmt: skip
