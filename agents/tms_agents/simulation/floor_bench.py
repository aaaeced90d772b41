"""The laser of the simulated room: a Hokuyo at the height of ankles, byte for byte, that sees people, robot and things.

People are drawn by their feet, which take steps below the body that the world moves.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable

import numpy as np

from tms_agents.devices.scans import Array
from tms_agents.devices.scip import ScipDevice
from tms_agents.simulation.floor_world import FINE, Furniture, LiveRoom, Mount, Robot, Thing, Wall
from tms_agents.simulation.room import BED, CABINETS, LASER_POSE, ROBOT_SIZE, SIZE, TABLE
from tms_agents.simulation.world import OnFloor, World, Xy

#: Of a thing on the floor, metres.
_THING_M = 0.07
#: Between two calls of ``follow`` bodies move evenly; if the second is late they wait where they are.
_LONGEST_STEP_S = 0.2


class FloorBench:
    """``device`` is put behind a line that ticks often. All calls from one thread; ``clock`` gives seconds."""

    def __init__(self, rng: np.random.Generator, clock: Callable[[], float] = time.monotonic) -> None:
        self.device = ScipDevice(self.scan, "UST-20LX", clock=clock)
        mount = Mount(name="laser", laser=FINE, pose=LASER_POSE, reported=LASER_POSE)
        self._room = LiveRoom(walls(), furniture(), [mount], rng, feet="legs")
        self._clock = clock
        self._bodies: dict[str, tuple[Xy, Xy]] = {}  # before and after the last step
        self._robots: dict[str, tuple[Xy, Xy, float]] = {}
        self._stepped, self._step_s = clock(), 0.05
        #: Of the feet: time of the room while somebody walks, however fast it goes, otherwise our own.
        self._room_s = (0.0, 0.0)
        self._idle_s, self._looked = 0.0, clock()

    def follow(self, world: World) -> None:
        """People, robot and things are as in the room."""
        now = self._clock()
        self._step_s = min(max(now - self._stepped, 0.01), _LONGEST_STEP_S)
        self._stepped = now
        self._room_s = (self._room_s[1], world.time_s)
        bodies, robots = {}, {}
        for mover in world.movers.values():
            if mover.kind == "person":
                bodies[mover.id] = (self._bodies.get(mover.id, (mover.xy, mover.xy))[1], mover.xy)
            else:
                robots[mover.id] = (self._robots.get(mover.id, (mover.xy, mover.xy, 0.0))[1], mover.xy, mover.theta)
        self._bodies, self._robots = bodies, robots
        self._room.things = {
            tag: Thing(id=tag, size=_THING_M, shape="disc", pose=(*place.xy, 0.0))
            for tag, place in world.places.items()
            if isinstance(place, OnFloor)
        }

    def scan(self) -> tuple[Array, Array | None]:
        """What the laser measures now."""
        now = self._clock()
        share = (now - self._stepped) / self._step_s
        if share > 1.0:
            self._idle_s += min(now - self._looked, now - self._stepped - self._step_s)
            share = 1.0
        self._looked = now
        before, after = self._room_s
        feet_s = before + share * (after - before) + self._idle_s
        self._room.move_people(feet_s, {name: _between(*places, share) for name, places in self._bodies.items()})
        for name, walker in self._room.people.items():
            walker.sit(_on_bed(self._bodies[name][1]), feet_s)
        length, width = ROBOT_SIZE
        self._room.robots = {
            name: Robot(id=name, length=length, width=width, pose=(*_between(start, end, share), theta))
            for name, (start, end, theta) in self._robots.items()
        }
        ranges, _ = self._room.scan("laser", feet_s)  # the time of whatever moves
        return ranges, None


def _between(start: Xy, end: Xy, share: float) -> Xy:
    return (start[0] + share * (end[0] - start[0]), start[1] + share * (end[1] - start[1]))


def _on_bed(xy: Xy) -> bool:
    (x0, y0), (x1, y1) = BED[0], BED[2]
    return x0 <= xy[0] <= x1 and y0 <= xy[1] <= y1


def walls() -> list[Wall]:
    w, d = SIZE
    corners = [(0.0, 0.0), (w, 0.0), (w, d), (0.0, d)]
    return [Wall(a, b) for a, b in zip(corners, corners[1:] + corners[:1], strict=True)]


def furniture() -> list[Furniture]:
    """Cabinets stand on the floor, bed and table on legs."""
    pieces = [_piece(f"leg of {name}", outline, "legs") for name, outline in (("bed", BED), ("table", TABLE))]
    return pieces + [_piece(one.id, one.outline, "box") for one in CABINETS]


def _piece(name: str, outline: list[Xy], kind: str) -> Furniture:
    (x0, y0), (x1, y1), (x2, y2) = outline[:3]
    pose = ((x0 + x2) / 2, (y0 + y2) / 2, math.atan2(y1 - y0, x1 - x0))
    width, depth = math.dist((x0, y0), (x1, y1)), math.dist((x1, y1), (x2, y2))
    return Furniture(id=name, kind="box" if kind == "box" else "legs", width=width, depth=depth, pose=pose)
