"""The scripted life in a room: time goes on, movers act their stories, furniture moves, things come and go.

It keeps the truth that nobody can see: who was where, and when each thing was put down and picked up.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from tms_agents.simulation.floor_world.gait import Walker
from tms_agents.simulation.floor_world.movers import Mover
from tms_agents.simulation.floor_world.plan import Plan, Ways
from tms_agents.simulation.floor_world.room import Furniture, LiveRoom, Robot, Thing
from tms_agents.simulation.floor_world.shapes import Pose, Xy
from tms_agents.simulation.floor_world.tasks import Drag, Story

#: Seconds; feet and bodies move on in steps of this.
STEP_S = 0.025
#: Half as wide (m) is who walks, and who squeezes through; feet keep off things by the first in any case.
_BODY_M, _TIGHT_M = 0.24, 0.16


@dataclass(slots=True)
class Stay:
    """A thing on the floor, from when to when, and through whom."""

    thing: Thing
    placed_at: float
    placed_by: str | None
    picked_at: float | None = None
    picked_by: str | None = None


@dataclass(frozen=True, slots=True)
class Motion:
    """A piece of furniture that moved."""

    furniture: str
    start: float
    end: float
    before: Pose
    after: Pose
    way: tuple[Xy, ...] = ()

    def pose(self, t: float) -> Pose:
        """On the way at ``t``: slow at both ends."""
        u = min(1.0, max(0.0, (t - self.start) / (self.end - self.start)))
        u = u * u * (3 - 2 * u)
        a, b = self.before, self.after
        points = [a[:2], *self.way[:-1], b[:2]]
        legs = [math.dist(p, q) for p, q in pairwise(points)]
        left, i = u * sum(legs), 0
        while i < len(legs) - 1 and left > legs[i]:
            left -= legs[i]
            i += 1
        v = left / legs[i] if legs[i] > 0 else 0.0
        (x0, y0), (x1, y1) = points[i], points[i + 1]
        turn = math.remainder(b[2] - a[2], 2 * math.pi)
        return (x0 + v * (x1 - x0), y0 + v * (y1 - y0), a[2] + u * turn)


class Life:
    """``stories`` are functions of the mover that tell what it does; they may look at everything here."""

    def __init__(self, plan: Plan, room: LiveRoom, rng: np.random.Generator) -> None:
        self.plan, self.room, self.rng = plan, room, rng
        self.now = 0.0
        #: Between the middles of two people: shoulders are 45 cm wide, and turn a little where it is narrow.
        self.closest_m = 0.38
        self.movers: dict[str, Mover] = {}
        self.stays: list[Stay] = []
        self.motions: list[Motion] = []
        self.sizes: dict[str, tuple[float, float]] = {}  # of robots
        self.arrivals: list[tuple[float, str, str]] = []  # (time, "enter" | "leave", mover)
        self._due: list[tuple[float, Callable[[float], None]]] = []
        self._ways: dict[float, Ways] = {}
        self._look_again_s = 0.0

    # what a scenario says

    def at(self, t: float, what: Callable[[float], None]) -> None:
        """Let something happen at a time."""
        self._due.append((t, what))
        self._due.sort(key=lambda item: item[0])

    def person(self, name: str, at: float, xy: Xy, story: Callable[[Mover], Story]) -> None:
        """Somebody appears (mostly in the corridor) and lives that story."""

        def come(t: float) -> None:
            rng = self.rng.spawn(1)[0]
            yaw = rng.uniform(-math.pi, math.pi)
            mover = Mover(name, iter(()), xy, yaw, rng.uniform(0.75, 1.25), rng, walker=Walker(xy, yaw, t, rng))
            self._add(mover, story, t)

        self._come(at, come)

    def robot(self, name: str, at: float, xy: Xy, story: Callable[[Mover], Story], size: tuple[float, float]) -> None:
        def come(t: float) -> None:
            rng = self.rng.spawn(1)[0]
            self._add(Mover(name, iter(()), xy, rng.uniform(-3, 3), rng.uniform(0.3, 0.5), rng, size), story, t)

        self._come(at, come)

    def place(self, thing: Thing, by: str | None, t: float) -> None:
        self.room.things[thing.id] = thing
        self.stays.append(Stay(thing, t, by))
        self._ways.clear()

    def pick(self, thing: str, by: str | None, t: float) -> None:
        del self.room.things[thing]
        stay = next(stay for stay in reversed(self.stays) if stay.thing.id == thing)
        stay.picked_at, stay.picked_by = t, by
        self._ways.clear()

    def drag(self, task: Drag, t: float) -> None:
        """Begin to move a piece of furniture; it goes on by itself."""
        before = self.room.furniture[task.furniture].pose
        self.motions.append(Motion(task.furniture, t, t + task.seconds, before, task.to, task.way))

    def dragged(self, task: Drag, t: float, dt: float) -> Xy:
        """How far it went in the last ``dt`` seconds."""
        motion = next(m for m in reversed(self.motions) if m.furniture == task.furniture)
        a, b = motion.pose(t - dt), motion.pose(t)
        return (b[0] - a[0], b[1] - a[1])

    def hang_door(self) -> None:
        """A closed leaf in the first opening, hinged at its southern side."""
        door = self.plan.doors[0]
        x = self.plan.width + 0.03 if door.wall == "e" else -0.03
        self.room.furniture["door"] = Furniture(
            id="door", kind="box", width=door.width - 0.04, depth=0.04, pose=(x, door.y, math.pi / 2)
        )

    # time

    def advance(self, t: float) -> None:
        """Live on until ``t``."""
        while self.now < t - 1e-9:
            step = min(STEP_S, t - self.now)
            self.now += step
            while self._due and self._due[0][0] <= self.now:
                self._due.pop(0)[1](self.now)
            self._move_furniture()
            for mover in list(self.movers.values()):
                mover.step(self, self.now, step)
                mover.follow(self.now)
                if mover.gone:
                    self._remove(mover)
            for mover in self.movers.values():
                if mover.size is not None:
                    self.room.robots[mover.id] = Robot(
                        id=mover.id,
                        length=mover.size[0],
                        width=mover.size[1],
                        pose=(*mover.xy, mover.yaw),
                        velocity=mover.velocity,
                    )

    # where one can go

    def ways(self, mover: Mover) -> Ways:
        """For a body like this one."""
        return self._ways_of(_BODY_M if mover.size is None else mover.radius + 0.03)

    def tight_ways(self) -> Ways:
        """Where a person can squeeze through, without a foot on anything that lies there."""
        return self._ways_of(_TIGHT_M)

    def clear_way(self, who: Mover, furniture: str, to: Pose) -> list[Xy]:
        """Corners of a way for a piece of furniture past everything and everybody; empty where there is none."""
        piece = self.room.furniture[furniture]
        blocked = [other for other in self.room.furniture.values() if other.id not in (furniture, "door")]
        things = [(thing.pose[:2], thing.size) for thing in self.room.things.values()]
        things += [(other.xy, 2 * other.radius) for other in self.others(who)]
        radius = math.hypot(piece.width, piece.depth) / 2
        for share in (1.0, 0.8, 0.6):
            way = Ways(self.plan, blocked, things, share * radius).path(piece.pose[:2], to[:2])
            if way:
                return way
        return []

    def others(self, mover: Mover) -> list[Mover]:
        return [other for other in self.movers.values() if other is not mover]

    def random_place(self, margin: float = 0.3, ways: Ways | None = None) -> Xy:
        """Somewhere in the room where a person can stand."""
        ways = ways or self._ways_of(_BODY_M)
        while True:
            xy = (self.rng.uniform(0, self.plan.width), self.rng.uniform(0, self.plan.depth))
            if self.plan.contains(xy, margin) and ways.is_free(xy):
                return xy

    # inside

    def _come(self, at: float, come: Callable[[float], None]) -> None:
        if at <= self.now:
            come(self.now)
        else:
            self.at(at, come)

    def _add(self, mover: Mover, story: Callable[[Mover], Story], t: float) -> None:
        mover.story = story(mover)
        self.movers[mover.id] = mover
        if mover.size is not None:
            self.sizes[mover.id] = mover.size
        if mover.walker is not None:
            self.room.people[mover.id] = mover.walker
        self.arrivals.append((t, "enter", mover.id))

    def _remove(self, mover: Mover) -> None:
        del self.movers[mover.id]
        self.room.people.pop(mover.id, None)
        self.room.robots.pop(mover.id, None)
        self.arrivals.append((self.now, "leave", mover.id))

    def _move_furniture(self) -> None:
        for motion in self.motions:
            if motion.start <= self.now <= motion.end + 2 * STEP_S:
                piece = self.room.furniture[motion.furniture]
                self.room.furniture[motion.furniture] = piece.at(motion.pose(self.now))
                if self.now >= self._look_again_s or self.now > motion.end:
                    self._ways.clear()
                    self._look_again_s = self.now + 0.4

    def _ways_of(self, radius: float) -> Ways:
        radius = round(radius, 2)
        if radius not in self._ways:
            blocked = [piece for piece in self.room.furniture.values() if not piece.id.startswith("door")]
            wider = 2 * max(0.0, _BODY_M - radius)
            things = [(thing.pose[:2], thing.size + wider) for thing in self.room.things.values()]
            self._ways[radius] = Ways(self.plan, blocked, things, radius)
        return self._ways[radius]
