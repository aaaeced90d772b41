"""Physics of the simulated room: movers walk, and every thing is in exactly one place.

Nothing in here knows of labels, tags being read or beliefs: sensor agents look at the world and draw their conclusions.
Positions are metres in the room frame, times seconds, angles radians counter-clockwise.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Literal

Xy = tuple[float, float]
REACH_M = 1.0
#: Of a robot's gripper, m/s.
HAND_SPEED = 0.5


@dataclass(frozen=True, kw_only=True, slots=True)
class Thing:
    """A tagged object; ``weight_g`` is what it really weighs, whether or not anybody has registered it."""

    number: int
    tag: str
    weight_g: float


@dataclass(frozen=True, slots=True)
class InCabinet:
    cabinet: str
    slot: int


@dataclass(frozen=True, slots=True)
class Held:
    """In a person's hands or pockets, or on a robot's tray: any number of things."""

    by: str


@dataclass(frozen=True, slots=True)
class Gripped:
    """In a robot's gripper: one thing."""

    by: str


@dataclass(frozen=True, slots=True)
class OnFloor:
    xy: Xy


@dataclass(frozen=True, slots=True)
class OnTable:
    """On furniture without sensors."""

    surface: str
    xy: Xy


@dataclass(frozen=True, slots=True)
class Outside:
    """Not in the room yet: any number of things."""


Place = InCabinet | Held | Gripped | OnFloor | OnTable | Outside


@dataclass(frozen=True, kw_only=True, slots=True)
class Cabinet:
    """A cabinet with one shelf board, on which things stand at ``spots`` (board frame: metres from its corner).

    ``corner`` and ``theta`` are the board's pose in the room; it is ``width`` along its x axis and ``depth`` along y.
    """

    id: str
    name: str
    corner: Xy
    theta: float
    width: float
    depth: float
    spots: tuple[Xy, ...]
    z: float = 0.9

    @property
    def surface(self) -> str:
        return f"{self.id}/shelf"

    @property
    def slots(self) -> tuple[Xy, ...]:
        """The spots in the room."""
        return tuple(self.in_room(spot) for spot in self.spots)

    @property
    def outline(self) -> list[Xy]:
        """Of the board in the room."""
        w, d = self.width, self.depth
        return [self.in_room(corner) for corner in ((0.0, 0.0), (w, 0.0), (w, d), (0.0, d))]

    def in_room(self, xy: Xy) -> Xy:
        cos, sin = math.cos(self.theta), math.sin(self.theta)
        (x, y), (left, low) = xy, self.corner
        return (round(left + cos * x - sin * y, 6), round(low + sin * x + cos * y, 6))


@dataclass(kw_only=True, slots=True)
class Mover:
    """A person or a robot, walking along ``path``; a robot also moves its arm towards ``hand_goal``.

    ``hand``: how far ahead of the robot's middle its gripper is, and how high above the floor.
    """

    id: str
    kind: Literal["person", "robot"]
    xy: Xy
    theta: float = 0.0
    speed: float = 1.0
    path: deque[Xy] = field(default_factory=deque)
    hand: Xy = (0.4, 1.1)
    hand_goal: Xy = (0.4, 1.1)

    @property
    def gripper(self) -> Xy:
        """Where a robot's hand is, seen from above."""
        ahead = self.hand[0]
        return (self.xy[0] + ahead * math.cos(self.theta), self.xy[1] + ahead * math.sin(self.theta))

    def walk(self, waypoints: Iterable[Xy]) -> None:
        self.path = deque(waypoints)

    def step(self, seconds: float) -> None:
        self._step_hand(HAND_SPEED * seconds)
        left = self.speed * seconds
        while self.path and left > 0:
            target = self.path[0]
            gap = math.dist(self.xy, target)
            if gap > 1e-9:
                self.face(target)
            if gap <= left:
                self.xy = self.path.popleft()
                left -= gap
            else:
                share = left / gap
                self.xy = (
                    self.xy[0] + share * (target[0] - self.xy[0]),
                    self.xy[1] + share * (target[1] - self.xy[1]),
                )
                left = 0.0

    def _step_hand(self, left: float) -> None:
        gap = math.dist(self.hand, self.hand_goal)
        if gap <= left:
            self.hand = self.hand_goal
            return
        share = left / gap
        (ahead, up), (ahead_goal, up_goal) = self.hand, self.hand_goal
        self.hand = (ahead + share * (ahead_goal - ahead), up + share * (up_goal - up))

    def face(self, target: Xy) -> None:
        self.theta = math.atan2(target[1] - self.xy[1], target[0] - self.xy[0])


class Impossible(ValueError):
    """An action against the laws of the room: out of reach, place taken, hands empty."""


class World:
    """The room at one moment. Actions happen at once; walking takes ``step`` calls."""

    def __init__(
        self,
        things: Iterable[Thing],
        cabinets: Iterable[Cabinet],
        movers: Iterable[Mover],
        places: Mapping[str, Place],
    ) -> None:
        """``places`` says where each thing is at the start, by tag."""
        self.time_s = 0.0
        self.things = {thing.tag: thing for thing in things}
        self.cabinets = {cabinet.id: cabinet for cabinet in cabinets}
        self.movers = {mover.id: mover for mover in movers}
        self.places: dict[str, Place] = {}
        #: Tags in cabinets that somebody's hand still covers: no reader reads them.
        self.covered: set[str] = set()
        if places.keys() != self.things.keys():
            raise Impossible("every thing must be in exactly one place")
        for tag, place in places.items():
            self._require_free(place)
            self.places[tag] = place

    def step(self, seconds: float) -> None:
        """Let time pass."""
        self.time_s += seconds
        for mover in self.movers.values():
            mover.step(seconds)

    def tag_of(self, number: int) -> str:
        """Tag of the thing with this number."""
        return next(thing.tag for thing in self.things.values() if thing.number == number)

    def position(self, tag: str) -> Xy:
        place = self.places[tag]
        match place:
            case InCabinet(cabinet, slot):
                return self.cabinets[cabinet].slots[slot]
            case Held(by):
                return self.movers[by].xy
            case Gripped(by):
                return self.movers[by].gripper
            case OnFloor(xy) | OnTable(_, xy):
                return xy
            case Outside():
                raise Impossible(f"{tag} is not in the room")

    def held_by(self, mover: str) -> list[str]:
        return [tag for tag, place in self.places.items() if place == Held(mover)]

    def gripped_by(self, robot: str) -> str | None:
        return next((tag for tag, place in self.places.items() if place == Gripped(robot)), None)

    def free_slots(self, cabinet: str) -> list[int]:
        taken = set(self.inside(cabinet).values())
        return [slot for slot in range(len(self.cabinets[cabinet].slots)) if slot not in taken]

    def inside(self, cabinet: str) -> dict[str, int]:
        """Slots of the things in a cabinet, by tag."""
        return {
            tag: place.slot
            for tag, place in self.places.items()
            if isinstance(place, InCabinet) and place.cabinet == cabinet
        }

    # what people and robots do

    def bring(self, tag: str, cabinet: str, slot: int) -> None:
        """Somebody who furnishes the room puts a new thing into a cabinet."""
        if not isinstance(self.places[tag], Outside):
            raise Impossible(f"{tag} is in the room already")
        self._move(tag, InCabinet(cabinet, slot))

    def take(self, person: str, tag: str) -> None:
        """A person takes a thing from wherever it lies."""
        if isinstance(self.places[tag], Held | Gripped):
            raise Impossible(f"{tag} is in somebody's hands")
        self._require_reach(person, self.position(tag))
        self._move(tag, Held(person))

    def put(self, person: str, tag: str, cabinet: str, slot: int, *, cover: bool = False) -> None:
        """A person puts a thing into a cabinet; with ``cover`` the hand stays over its tag until ``uncover``."""
        self._require_held(person, tag)
        self._require_reach(person, self.cabinets[cabinet].slots[slot])
        self._move(tag, InCabinet(cabinet, slot))
        if cover:
            self.covered.add(tag)

    def uncover(self, tag: str) -> None:
        self.covered.discard(tag)

    def drop(self, person: str, tag: str, xy: Xy) -> None:
        """A person lets a thing fall to the floor."""
        self._require_held(person, tag)
        self._require_reach(person, xy)
        self._move(tag, OnFloor(xy))

    def give(self, person: str, tag: str, robot: str) -> None:
        """A person puts a thing into a robot's gripper."""
        self._require_held(person, tag)
        self._require_reach(person, self.movers[robot].gripper)
        self._move(tag, Gripped(robot))

    def set_down(self, robot: str, surface: str, xy: Xy) -> None:
        """A robot puts down what it grips."""
        tag = self.gripped_by(robot)
        if tag is None:
            raise Impossible(f"{robot} grips nothing")
        self._require_reach(robot, xy)
        self._move(tag, OnTable(surface, xy))

    def _move(self, tag: str, place: Place) -> None:
        self._require_free(place)
        self.places[tag] = place
        self.covered.discard(tag)

    def _require_free(self, place: Place) -> None:
        if not isinstance(place, Held | Outside) and place in self.places.values():
            raise Impossible(f"{place} is taken")

    def _require_held(self, person: str, tag: str) -> None:
        if self.places[tag] != Held(person):
            raise Impossible(f"{person} does not hold {tag}")

    def _require_reach(self, mover: str, xy: Xy) -> None:
        if math.dist(self.movers[mover].xy, xy) > REACH_M:
            raise Impossible(f"{mover} cannot reach {xy}")
