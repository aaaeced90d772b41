"""A room with lasers in which people, things and robots are where they are told: what the lasers say of it.

This is the part that a demonstration uses; who goes where is decided elsewhere (`life` for the scripted scenarios).
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from tms_agents.simulation.floor_world.gait import FeetKind, Walker
from tms_agents.simulation.floor_world.lasers import Mount
from tms_agents.simulation.floor_world.noise import LaserErrors, Measured
from tms_agents.simulation.floor_world.raycaster import Cast, cast
from tms_agents.simulation.floor_world.shapes import NOBODY, PLAIN, Drawing, Floats, Material, Pose, Shapes, Xy, to_box


@dataclass(frozen=True, kw_only=True, slots=True)
class Furniture:
    """A piece that stands in the plane: a "box", or four "legs"; ``width`` is along the x axis of its pose."""

    id: str
    kind: Literal["box", "legs"]
    width: float
    depth: float
    pose: Pose
    leg_radius: float = 0.02
    material: Material = PLAIN

    def draw(self, drawing: Drawing) -> None:
        if self.kind == "box":
            drawing.box(self.pose, self.width, self.depth, NOBODY, self.material)
        else:
            drawing.legs(self.pose, self.width, self.depth, self.leg_radius, self.material)

    def at(self, pose: Pose) -> Furniture:
        return replace(self, pose=pose)

    def distance(self, xy: Xy) -> float:
        """From its outline, 0 inside."""
        return float(to_box(np.array(xy), self.pose, self.width, self.depth))


@dataclass(frozen=True, kw_only=True, slots=True)
class Thing:
    """A thing on the floor: a disc of diameter ``size``, or a box of ``size`` by 0.6 ``size``."""

    id: str
    size: float
    shape: Literal["disc", "box"]
    pose: Pose
    material: Material = PLAIN

    def draw(self, drawing: Drawing, owner: int) -> None:
        if self.shape == "disc":
            drawing.circle(self.pose[:2], self.size / 2, owner, self.material)
        else:
            drawing.box(self.pose, self.size, 0.6 * self.size, owner, self.material)


@dataclass(frozen=True, kw_only=True, slots=True)
class Robot:
    """A rectangle of ``length`` by ``width`` that drives with ``velocity``."""

    id: str
    length: float
    width: float
    pose: Pose
    velocity: Xy = (0.0, 0.0)

    def draw(self, drawing: Drawing, owner: int) -> None:
        drawing.box(self.pose, self.length, self.width, owner, Material(0.5), self.velocity)


@dataclass(frozen=True, slots=True)
class Wall:
    a: Xy
    b: Xy
    material: Material = PLAIN


class LiveRoom:
    """Everything in the plane now. ``move_people`` lets feet follow bodies; things and robots are set as they are."""

    def __init__(
        self,
        walls: Iterable[Wall],
        furniture: Iterable[Furniture],
        mounts: Iterable[Mount],
        rng: np.random.Generator,
        feet: FeetKind = "prints",
    ) -> None:
        self.feet = feet
        self.walls = list(walls)
        self.furniture = {piece.id: piece for piece in furniture}
        self.mounts = {mount.name: mount for mount in mounts}
        self.people: dict[str, Walker] = {}
        self.things: dict[str, Thing] = {}
        self.robots: dict[str, Robot] = {}
        self._rng = rng
        self.errors = {name: LaserErrors(mount.laser, rng.spawn(1)[0]) for name, mount in self.mounts.items()}
        self._owners: dict[str, int] = {}

    def move_people(self, t: float, bodies: Mapping[str, Xy]) -> None:
        """These people are in the room now, and nobody else; somebody new stands where he appears."""
        for gone in self.people.keys() - bodies.keys():
            del self.people[gone]
        for name, xy in bodies.items():
            if name not in self.people:
                self.people[name] = Walker(xy, self._rng.uniform(-np.pi, np.pi), t, self._rng.spawn(1)[0])
            self.people[name].step(t, xy)

    def owner(self, name: str) -> int:
        """The number that beams which meet this one carry."""
        return self._owners.setdefault(name, len(self._owners))

    def shapes(self, t: float) -> Shapes:
        """Everything that beams can meet at ``t``."""
        drawing = Drawing()
        for wall in self.walls:
            drawing.segment(wall.a, wall.b, NOBODY, wall.material)
        for piece in self.furniture.values():
            piece.draw(drawing)
        for thing in self.things.values():
            thing.draw(drawing, self.owner(thing.id))
        for robot in self.robots.values():
            robot.draw(drawing, self.owner(robot.id))
        for name, walker in self.people.items():
            walker.draw(drawing, self.owner(name), t, self.feet)
        return drawing.shapes()

    def in_view(self, laser: str, xy: Xy, short_of: float) -> bool:
        """Whether walls and furniture leave free the straight line from the laser to that close to a place."""
        drawing, pose = Drawing(), self.mounts[laser].pose
        for wall in self.walls:
            drawing.segment(wall.a, wall.b)
        for piece in self.furniture.values():
            piece.draw(drawing)
        dx, dy = xy[0] - pose[0], xy[1] - pose[1]
        off = math.remainder(math.atan2(dy, dx) - pose[2], 2 * math.pi)
        if abs(off) > self.mounts[laser].laser.field_of_view / 2:
            return False
        ray = cast(drawing.shapes(), (pose[0], pose[1], math.atan2(dy, dx)), -0.003, 0.003, 3, 0.0)
        return bool((ray.ranges > math.hypot(dx, dy) - short_of).all())

    def look(self, laser: str, t: float) -> tuple[Measured, Cast]:
        """One sweep that begins at ``t``: what the device says, and what a perfect one would see."""
        mount, errors = self.mounts[laser], self.errors[laser]
        model = mount.laser
        seen = cast(self.shapes(t), mount.pose, errors.first_angle(), model.step, model.beams, model.increment_s)
        return errors.measure(seen, t), seen

    def scan(self, laser: str, t: float) -> tuple[Floats, Floats]:
        """(ranges, intensities) of a sweep now: what an emulated device is made with."""
        measured, _ = self.look(laser, t)
        return measured.ranges, measured.intensities
