"""People and robots that do their tasks: they walk planned ways, give way to one another, stand, turn, sit, push."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np

from tms_agents.simulation.floor_world.gait import Walker
from tms_agents.simulation.floor_world.plan import Plan, Ways
from tms_agents.simulation.floor_world.shapes import Xy
from tms_agents.simulation.floor_world.tasks import Do, Drag, Face, Go, Sit, Story, Task, Wait

#: People never come nearer to each other's middle than ``closest_m``, and keep off by a little more.
_PERSONAL = 1.2
#: What feet can do to speed up, slow down and turn, m/s2.
_PUSH = 2.0
_SWAY_M = 0.02
#: Who gets no further for so long thinks of something else; a robot so near (m) is given way by so much (m) before.
_STUCK_S = 4.0
_NARROW_M, _ASIDE_M = 1.0, 0.8


class LifeAround(Protocol):
    """What a mover sees of the life around it, and what it may do there."""

    plan: Plan
    #: Between the middles of two people.
    closest_m: float

    def others(self, mover: Mover) -> list[Mover]:
        """Everybody but this one."""

    def ways(self, mover: Mover) -> Ways:
        """For a body like this one."""

    def tight_ways(self) -> Ways:
        """Where a person can squeeze through."""

    def drag(self, task: Drag, t: float) -> None:
        """Begin to move a piece of furniture."""

    def dragged(self, task: Drag, t: float, dt: float) -> Xy:
        """How far it went in the last ``dt`` seconds."""


@dataclass(slots=True)
class Mover:
    """A body on its way. ``size``: (length, width) of a robot, None of a person."""

    id: str
    story: Story
    xy: Xy
    yaw: float
    speed: float
    rng: np.random.Generator
    size: tuple[float, float] | None = None
    walker: Walker | None = None
    velocity: Xy = (0.0, 0.0)
    task: Task | None = None
    gone: bool = False
    _path: list[Xy] = field(default_factory=list)
    _until: float = 0.0
    _began: float = 0.0
    _face: float | None = None
    _aside: bool = False
    _from: Xy = (0.0, 0.0)
    _sway: Xy = (0.0, 0.0)
    _rest: Xy = (0.0, 0.0)

    @property
    def radius(self) -> float:
        return 0.2 if self.size is None else math.hypot(*self.size) / 2

    def step(self, life: LifeAround, t: float, dt: float) -> None:
        """Do the task on hand for ``dt`` seconds; a new one when it is done. Sets ``gone`` when the story is over."""
        if self.task is None:
            self.task = next(self.story, None)
            if self.task is None:
                self.gone = True
                return
            self._begin(life, t)
        if self._carry_on(life, t, dt):
            self.task = None

    def _begin(self, life: LifeAround, t: float) -> None:
        task = self.task
        self._began, self._from, self._rest, self._sway = t, self.xy, self.xy, (0.0, 0.0)
        if isinstance(task, Go):
            self._face, self._aside = None, False
            self._path = life.ways(self).path(self.xy, task.to) or []
            self._until = t + _STUCK_S
        elif isinstance(task, Wait):
            self._until = t + task.seconds
        elif isinstance(task, Face):
            self._face = math.atan2(task.at[1] - self.xy[1], task.at[0] - self.xy[0])
            self._until = t + 0.7
        elif isinstance(task, Drag):
            life.drag(task, t)
            self._until = t + task.seconds
        elif isinstance(task, Sit):
            self._until = t + 1.0 + task.seconds + 1.0

    def _carry_on(self, life: LifeAround, t: float, dt: float) -> bool:
        """Whether the task is done."""
        task = self.task
        if isinstance(task, Do):
            task.what(t)
            return True
        if isinstance(task, Go):
            self._walk(life, dt)
            if math.hypot(*self.velocity) > 0.1 or self.size is not None:
                self._until = t + _STUCK_S
            late = t > min(self._until, self._began + task.patience_s)
            return not self._path or (late and not self._step_aside(life, t))
        if isinstance(task, Drag):
            dx, dy = life.dragged(task, t, dt)
            there = (self.xy[0] + dx, self.xy[1] + dy)
            self._shift(there if life.plan.contains(there, 0.1) else self.xy, dt)
        elif isinstance(task, Sit):
            self._sit(task, t)
        else:
            self._stand(dt)
        return t >= self._until

    def _step_aside(self, life: LifeAround, t: float) -> bool:
        """Whether somebody in a robot's way, and it in his, now goes back a little; a robot itself never does."""
        robots = [other for other in life.others(self) if other.size is not None]
        robot = min(robots, key=lambda other: math.dist(self.xy, other.xy), default=None)
        if self.size is not None or self._aside or robot is None or math.dist(self.xy, robot.xy) > _NARROW_M:
            return False
        ways = life.tight_ways()
        turns = np.linspace(0.0, 2 * math.pi, 16, endpoint=False)
        around = [(self.xy[0] + _ASIDE_M * math.cos(a), self.xy[1] + _ASIDE_M * math.sin(a)) for a in turns]
        spots = [xy for xy in around if ways.is_free(xy)]
        if not spots:
            return False
        self._path = [max(spots, key=lambda xy: math.dist(xy, robot.xy))]
        self._aside, self._began, self._until = True, t, t + _STUCK_S
        return True

    def _walk(self, life: LifeAround, dt: float) -> None:
        while self._path and math.dist(self.xy, self._path[0]) < (0.06 if len(self._path) == 1 else 0.25):
            self._path.pop(0)
        if not self._path:
            self.velocity = (0.0, 0.0)
            return
        gap = math.dist(self.xy, self._path[0])
        left = gap + sum(math.dist(a, b) for a, b in zip(self._path, self._path[1:], strict=False))
        pace = self.speed * min(1.0, max(0.25, left / 0.5))
        wish = (
            pace * (self._path[0][0] - self.xy[0]) / gap,
            pace * (self._path[0][1] - self.xy[1]) / gap,
        )
        if self.size is None:
            self._push_on(self._give_way(life, wish), life, dt)
        else:
            self._drive(wish, life, dt)

    def _give_way(self, life: LifeAround, wish: Xy) -> Xy:
        """Away from who is near, and past him on the right."""
        x, y = wish
        for other in life.others(self):
            dx, dy = self.xy[0] - other.xy[0], self.xy[1] - other.xy[1]
            apart = math.hypot(dx, dy) or 1e-6
            reach = _PERSONAL * life.closest_m if other.size is None else other.radius + 0.25
            if apart > reach + 0.6 or (other.walker is not None and other.walker.lifted):
                continue
            push = 1.2 * math.exp(-(apart - reach) / 0.12)
            x += min(push, 2.0) * dx / apart
            y += min(push, 2.0) * dy / apart
            if wish[0] * dx + wish[1] * dy < 0:  # he is ahead
                x += min(push, 0.8) * -dy / apart
                y += min(push, 0.8) * dx / apart
        return (x, y)

    def _push_on(self, wish: Xy, life: LifeAround, dt: float) -> None:
        change = (wish[0] - self.velocity[0], wish[1] - self.velocity[1])
        most = _PUSH * dt / max(math.hypot(*change), _PUSH * dt)
        vx, vy = self.velocity[0] + most * change[0], self.velocity[1] + most * change[1]
        fast = max(1.0, math.hypot(vx, vy) / (1.3 * self.speed))
        vx, vy = vx / fast, vy / fast
        ways = life.tight_ways()
        for step in ((vx, vy), (vx, 0.0), (0.0, vy), (0.0, 0.0)):
            there = (self.xy[0] + step[0] * dt, self.xy[1] + step[1] * dt)
            possible = ways.is_free(there) or ways.room_at(there) >= max(0.01, ways.room_at(self.xy))
            if possible and self._has_room(there, life):
                self._shift(there, dt)
                return

    def _has_room(self, there: Xy, life: LifeAround) -> bool:
        """Not nearer to anybody than one can be, or at least not nearer than now."""
        for other in life.others(self):
            robots = (self.size is not None) + (other.size is not None)
            least = life.closest_m if not robots else self.radius + other.radius - (0.1 if robots == 1 else 0.0)
            apart = math.dist(there, other.xy)
            if apart < least and apart < math.dist(self.xy, other.xy) and not (other.walker and other.walker.lifted):
                return False
        return True

    def _drive(self, wish: Xy, life: LifeAround, dt: float) -> None:
        """A robot turns first, then goes; it waits for who is in its way."""
        heading = math.atan2(wish[1], wish[0])
        off = math.remainder(heading - self.yaw, 2 * math.pi)
        self.yaw += max(-0.9 * dt, min(0.9 * dt, off))
        pace = math.hypot(*wish) if abs(off) < 0.3 else 0.0
        for other in life.others(self):
            ahead = (other.xy[0] - self.xy[0]) * wish[0] + (other.xy[1] - self.xy[1]) * wish[1]
            if ahead > 0 and math.dist(self.xy, other.xy) < self.radius + other.radius + 0.25:
                pace = 0.0
        there = (self.xy[0] + pace * math.cos(self.yaw) * dt, self.xy[1] + pace * math.sin(self.yaw) * dt)
        self._shift(there if self._has_room(there, life) else self.xy, dt)

    def _stand(self, dt: float) -> None:
        """Nobody stands still like a statue: the body sways round where it stopped."""
        if self.size is not None:
            self.velocity = (0.0, 0.0)
            return
        keep = math.exp(-dt / 2.0)
        spread = _SWAY_M * math.sqrt(1 - keep * keep)
        self._sway = (
            keep * self._sway[0] + spread * self.rng.normal(),
            keep * self._sway[1] + spread * self.rng.normal(),
        )
        there = (self._rest[0] + self._sway[0], self._rest[1] + self._sway[1])
        most = 0.1 * dt / max(math.dist(there, self.xy), 0.1 * dt)
        self._shift((self.xy[0] + most * (there[0] - self.xy[0]), self.xy[1] + most * (there[1] - self.xy[1])), dt)

    def _sit(self, task: Sit, t: float) -> None:
        """A second to sit down, a second to get up again."""
        assert self.walker is not None
        u = min(1.0, t - self._began, self._until - t)
        self.xy = (
            self._from[0] + u * (task.seat[0] - self._from[0]),
            self._from[1] + u * (task.seat[1] - self._from[1]),
        )
        self.velocity = (0.0, 0.0)
        self.walker.sit(u > 0.4, t)

    def _shift(self, there: Xy, dt: float) -> None:
        self.velocity = ((there[0] - self.xy[0]) / dt, (there[1] - self.xy[1]) / dt)
        self.xy = there

    def follow(self, t: float) -> None:
        """Let the feet follow."""
        if self.walker is not None:
            self.walker.step(t, self.xy, self._face)
            self.yaw = self.walker.yaw
