"""The room after figure 6 of the paper: a care room of 6 x 5 m with three smart cabinets, a bed and a table.

  0            3            6 m
5 +-------------------------+
  | [A A A A]      [B B B B]|
  |                         |
  |             +-------+   |
  | +---+       | table |   |
  | |bed|       +-------+   |
  | |   |                [C]|
  | +---+      robot     [C]|
0 +-------------------------+
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from itertools import pairwise
from typing import Any

from tms_agents.simulation.catalogue import ITEMS
from tms_agents.simulation.world import Cabinet, Mover, Outside, World, Xy
from tms_schemas.rooms import Furniture, RoomIn, Sensor, Surface, Zone

PERSON, ROBOT = "person", "robot"
TABLE_SURFACE, TABLE_Z = "table/top", 0.7
FLOOR_AGENT, ROBOT_AGENT = "floor", "robot"
#: Maps a ward in the demo of the robot.
MAPPER_AGENT = "mapper"
#: Where the things of the experiment are at its start: cabinet -> numbers of the objects, slot by slot.
START: Mapping[str, tuple[int, ...]] = {"cabinet-a": (0, 1, 2, 3), "cabinet-b": (4, 5, 6), "cabinet-c": (7, 8, 9)}


def _cabinet(letter: str, corner: Xy, theta: float) -> Cabinet:
    return Cabinet(
        id=f"cabinet-{letter.lower()}",
        name=f"Cabinet {letter}",
        corner=corner,
        theta=theta,
        width=1.45,
        depth=0.46,
        spots=tuple((0.21 + 0.26 * i, 0.23) for i in range(5)),
    )


CABINETS = (
    _cabinet("A", (0.15, 4.45), 0.0),
    _cabinet("B", (4.4, 4.45), 0.0),
    _cabinet("C", (5.92, 0.14), math.pi / 2),
)
#: Metres; the corner is the origin.
SIZE = (6.0, 5.0)
BED = [(0.15, 0.25), (1.15, 0.25), (1.15, 2.3), (0.15, 2.3)]
TABLE = [(3.3, 2.3), (4.6, 2.3), (4.6, 3.1), (3.3, 3.1)]
#: Where the laser of the floor sensor is, and the robot's length and width as it sees them.
LASER_POSE = (0.05, 3.3, -0.1)
ROBOT_SIZE = (0.45, 0.4)
#: Where only the robot drives, which reports itself: the floor sensor need not look there.
ROBOT_LANE = [(2.65, 0.1), (4.35, 0.1), (4.35, 2.25), (2.65, 2.25)]
#: Zone of the reader in the robot's hand: whatever it reads is somewhere in the room.
HAND_ZONE = "hand"

#: Places to stand, and the straight ways between them that touch no furniture.
SPOTS: Mapping[str, Xy] = {
    "bed": (0.75, 1.3),
    "bedside": (1.55, 1.0),
    "middle": (2.2, 2.0),
    "front of A": (0.9, 3.95),
    "north": (2.9, 3.8),
    "front of B": (5.1, 3.95),
    "east": (5.25, 2.2),
    "front of C": (4.95, 0.9),
    "south": (3.3, 1.0),
    "dock": (2.9, 0.45),
    "meeting": (3.1, 2.0),
    "table side": (3.9, 1.85),
}
WAYS = (
    ("bed", "bedside"),
    ("bedside", "middle"),
    ("bedside", "south"),
    ("middle", "front of A"),
    ("middle", "north"),
    ("middle", "south"),
    ("middle", "meeting"),
    ("front of A", "north"),
    ("north", "front of B"),
    ("front of B", "east"),
    ("east", "front of C"),
    ("front of C", "south"),
    ("south", "dock"),
    ("south", "meeting"),
    ("south", "table side"),
    ("meeting", "table side"),
)


def route(start: str, *stops: str) -> list[Xy]:
    """Waypoints from one spot over others, the fewest ways between each two of them."""
    found: list[Xy] = []
    for here, there in pairwise((start, *stops)):
        found += [SPOTS[name] for name in _fewest_ways(here, there)]
    return found


def new_world() -> World:
    """The room before the experiment: the person on the bed, the cabinets empty, all ten things still outside."""
    return World(
        (item.thing() for item in ITEMS),
        CABINETS,
        (
            Mover(id=PERSON, kind="person", xy=SPOTS["bed"]),
            Mover(id=ROBOT, kind="robot", xy=SPOTS["dock"], theta=1.57, speed=0.7),
        ),
        {item.tag: Outside() for item in ITEMS},
    )


def description(params: Mapping[str, Any] | None = None, seed: int = 0) -> RoomIn:
    """The room as the server is told of it."""
    outline = _box(0.0, 0.0, *SIZE)
    return RoomIn(
        name="Care room (simulated)",
        frame="origin at the south-west corner, x to the east, y to the north",
        outline=outline,
        furniture=[
            *(
                Furniture(
                    id=one.id,
                    name=one.name,
                    polygon=one.outline,
                    surfaces=[Surface(id="shelf", polygon=one.outline, z=one.z)],
                    agent=one.id,
                )
                for one in CABINETS
            ),
            Furniture(id="bed", name="Bed", polygon=BED),
            Furniture(
                id="table",
                name="Table",
                polygon=TABLE,
                surfaces=[Surface(id="top", polygon=TABLE, z=TABLE_Z)],
            ),
        ],
        sensors=[
            *(Sensor(agent=one.id, kind="cabinet", zones=[Zone(id=one.id, polygon=one.outline)]) for one in CABINETS),
            Sensor(agent=FLOOR_AGENT, kind="floor", pose=LASER_POSE),
            Sensor(agent=ROBOT_AGENT, kind="robot", zones=[Zone(id=HAND_ZONE, polygon=outline)]),
        ],
        params=dict(params or {}),
        seed=seed,
    )


def _fewest_ways(start: str, end: str) -> list[str]:
    paths = [[start]]
    seen = {start}
    while paths[0][-1] != end:
        path = paths.pop(0)
        for way in WAYS:
            if path[-1] in way:
                there = way[1] if way[0] == path[-1] else way[0]
                if there not in seen:
                    seen.add(there)
                    paths.append([*path, there])
    return paths[0][1:]


def _box(x0: float, y0: float, x1: float, y1: float) -> list[Xy]:
    return [(x0, y0), (x1, y0), (x1, y1), (x0, y1)]
