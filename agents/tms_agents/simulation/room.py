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

from collections.abc import Mapping
from itertools import pairwise
from typing import Any

from tms_agents.simulation.catalogue import ITEMS
from tms_agents.simulation.world import Cabinet, InCabinet, Mover, World, Xy
from tms_schemas.rooms import Furniture, RoomIn, Sensor, Surface

PERSON, ROBOT = "person", "robot"
TABLE_SURFACE = "table/top"
FLOOR_AGENT, ROBOT_AGENT = "floor", "robot"
#: Where the things of the experiment are at its start: cabinet -> numbers of the objects, slot by slot.
START: Mapping[str, tuple[int, ...]] = {"cabinet-a": (0, 1, 2, 3), "cabinet-b": (4, 5, 6), "cabinet-c": (7, 8, 9)}

CABINETS = (
    Cabinet(id="cabinet-a", surface="cabinet-a/shelf", slots=tuple((0.35 + 0.26 * i, 4.68) for i in range(5))),
    Cabinet(id="cabinet-b", surface="cabinet-b/shelf", slots=tuple((4.62 + 0.26 * i, 4.68) for i in range(5))),
    Cabinet(id="cabinet-c", surface="cabinet-c/shelf", slots=tuple((5.7, 0.35 + 0.26 * i) for i in range(5))),
)

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
    "meeting": (2.95, 2.0),
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
    """The room as the experiment finds it: the person on the bed, all ten things in the cabinets."""
    return World(
        (item.thing() for item in ITEMS),
        CABINETS,
        (
            Mover(id=PERSON, kind="person", xy=SPOTS["bed"]),
            Mover(id=ROBOT, kind="robot", xy=SPOTS["dock"], theta=1.57, speed=0.7),
        ),
        {
            ITEMS[number].tag: InCabinet(cabinet, slot)
            for cabinet, numbers in START.items()
            for slot, number in enumerate(numbers)
        },
    )


def description(params: Mapping[str, Any] | None = None, seed: int = 0) -> RoomIn:
    """The room as the server is told of it."""
    return RoomIn(
        name="Care room (simulated)",
        frame="origin at the south-west corner, x to the east, y to the north",
        outline=_box(0.0, 0.0, 6.0, 5.0),
        furniture=[
            *(
                Furniture(
                    id=cabinet,
                    name=name,
                    polygon=_box(*box),
                    surfaces=[Surface(id="shelf", polygon=_box(*box), z=0.9)],
                    agent=cabinet,
                )
                for cabinet, name, box in (
                    ("cabinet-a", "Cabinet A", (0.15, 4.45, 1.6, 4.92)),
                    ("cabinet-b", "Cabinet B", (4.4, 4.45, 5.85, 4.92)),
                    ("cabinet-c", "Cabinet C", (5.46, 0.12, 5.92, 1.6)),
                )
            ),
            Furniture(id="bed", name="Bed", polygon=_box(0.15, 0.25, 1.15, 2.3)),
            Furniture(
                id="table",
                name="Table",
                polygon=_box(3.3, 2.3, 4.6, 3.1),
                surfaces=[Surface(id="top", polygon=_box(3.3, 2.3, 4.6, 3.1), z=0.7)],
            ),
        ],
        sensors=[
            *(Sensor(agent=cabinet.id, kind="cabinet") for cabinet in CABINETS),
            Sensor(agent=FLOOR_AGENT, kind="floor", pose=(3.0, 0.05, 1.57)),
            Sensor(agent=ROBOT_AGENT, kind="robot"),
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
