"""The experiment of the paper's section 4, step by step, and the pies it shows."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

from tms_agents.simulation.room import PERSON, ROBOT, SPOTS, START, TABLE_SURFACE, TABLE_Z, route
from tms_agents.simulation.script import Firm, Script, Told, reach, wait, walk
from tms_agents.simulation.world import World

#: Numbers of the objects that are moved, as in the paper.
MOVED = (2, 3, 4)
TOLERANCE = 0.02
#: Object number -> place in words (see ``pies.place_of``) -> probability.
Pies = Mapping[int, Mapping[str, float]]
#: Where a thing falls to the floor.
DROPPED = (1.42, 0.62)
#: The robot's gripper, metres ahead and above the floor.
TO_A_PERSON, CARRYING = (0.4, 0.8), (0.4, 1.1)


@dataclass(frozen=True, kw_only=True, slots=True)
class Step:
    """One step: what happens, and the pies afterwards. ``pies_weighed`` where registered weights tell more."""

    title: str
    act: Callable[[World], Script]
    pies: Pies
    pies_weighed: Pies = field(default_factory=dict)

    def expected(self, weighed: bool) -> Pies:
        return self.pies_weighed if weighed and self.pies_weighed else self.pies


def furnish(world: World) -> Script:
    """Before the story: the room is empty, and its things come one by one, as at an installation."""
    yield Told(connected=True)
    for slot in range(max(map(len, START.values()))):
        for cabinet, numbers in START.items():
            if slot < len(numbers):
                world.bring(world.tag_of(numbers[slot]), cabinet, slot)
        yield Told()


def start(world: World) -> Script:
    yield Told()


def take_three(world: World) -> Script:
    yield from walk(world, PERSON, "bed", "front of A")
    for number in (2, 3):
        world.take(PERSON, world.tag_of(number))
        yield Told()
    yield from walk(world, PERSON, "front of A", "front of B")
    world.take(PERSON, world.tag_of(4))
    yield Told()


def drop_one(world: World) -> Script:
    world.movers[ROBOT].walk(route("dock", "meeting"))
    yield from walk(world, PERSON, "front of B", "north", "bedside")
    world.drop(PERSON, world.tag_of(3), DROPPED)
    yield from wait(world, 4.0)
    yield from walk(world, PERSON, "bedside", "middle")
    yield Told()


def hand_over(world: World) -> Script:
    world.movers[ROBOT].face(SPOTS["middle"])
    yield from reach(world, ROBOT, TO_A_PERSON)
    world.give(PERSON, world.tag_of(2), ROBOT)
    yield Firm()
    yield from reach(world, ROBOT, CARRYING)
    yield Told()


def carry_to_table(world: World) -> Script:
    yield from walk(world, ROBOT, "meeting", "table side")
    spot = (4.3, 2.5)
    world.movers[ROBOT].face(spot)
    yield from reach(world, ROBOT, (math.dist(SPOTS["table side"], spot), TABLE_Z + 0.1))
    world.set_down(ROBOT, TABLE_SURFACE, spot)
    yield Told()
    yield from reach(world, ROBOT, CARRYING)


def put_last(world: World) -> Script:
    yield from walk(world, PERSON, "middle", "north", "front of B")
    tag = world.tag_of(4)
    world.put(PERSON, tag, "cabinet-b", 3, cover=True)
    yield Told(unread=frozenset({tag}))


def read_last(world: World) -> Script:
    world.uncover(world.tag_of(4))
    yield Told()


def _all_at(number_2: str, number_3: str, number_4: str) -> Pies:
    return {2: {number_2: 1.0}, 3: {number_3: 1.0}, 4: {number_4: 1.0}}


STEPS = (
    Step(
        title="the room is switched on: every thing is in its cabinet",
        act=start,
        pies=_all_at("cabinet A", "cabinet A", "cabinet B"),
    ),
    Step(
        title="the person takes objects 2 and 3 from cabinet A and object 4 from cabinet B",
        act=take_three,
        pies=_all_at("person", "person", "person"),
    ),
    Step(
        title="object 3 falls beside the bed; the floor sensor sees that something lies there, not what",
        act=drop_one,
        pies={number: {"floor": 1 / 3, "person": 2 / 3} for number in MOVED},
    ),
    Step(
        title="object 2 is handed to the robot, whose hand reads its tag",
        act=hand_over,
        pies={
            2: {"robot's hand": 1.0},
            3: {"floor": 1 / 2, "person": 1 / 2},
            4: {"floor": 1 / 2, "person": 1 / 2},
        },
    ),
    Step(
        title="the robot puts it on the table and says so",
        act=carry_to_table,
        pies={
            2: {"table": 1.0},
            3: {"floor": 1 / 2, "person": 1 / 2},
            4: {"floor": 1 / 2, "person": 1 / 2},
        },
    ),
    Step(
        title="object 4 goes into cabinet B: the load cells feel it at once, the hand still covers its tag",
        act=put_last,
        pies={
            2: {"table": 1.0},
            3: {"floor": 1 / 2, "cabinet B": 1 / 2},
            4: {"floor": 1 / 2, "cabinet B": 1 / 2},
        },
        pies_weighed=_all_at("table", "floor", "cabinet B"),
    ),
    Step(
        title="the hand is gone and the tag is read: everything is certain, object 3 by elimination",
        act=read_last,
        pies=_all_at("table", "floor", "cabinet B"),
    ),
)
