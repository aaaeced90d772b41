"""Sensor agents of the simulated room: what changed in the world since the last look, said in observations.

Each agent knows only what its own device could: a cabinet its load cells and tag reader, the floor laser the feet and
things on the floor, the robot its own position, its gripper and what it did with it. Observations of one instant come
in the order vanish, mover, appear, read.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable
from datetime import datetime, timedelta
from typing import TypeVar

import numpy as np

from tms_agents.simulation.world import Cabinet, Gripped, InCabinet, OnFloor, OnTable, World, Xy
from tms_schemas.observation import (
    AgentState,
    Inventory,
    InventoryLabel,
    LabelAppeared,
    LabelMoved,
    LabelVanished,
    MoverEntered,
    Observation,
    PoseReport,
    TagObserved,
    Transfer,
)

Seen = TypeVar("Seen", LabelAppeared, LabelVanished)

#: An agent that has nothing to report says so often enough not to count as silent.
SIGN_OF_LIFE = timedelta(seconds=10)
#: A reader's round over its antennas: how long after the load cells it knows a tag.
READ_S = 2.0
#: A mover's position is reported after this way, and where it came to rest; a turn on the spot from this angle on.
REPORT_M, TURN_RAD = 0.25, 0.1


class SensorAgent(ABC):
    """One agent. ``new_label`` gives label ids never used before; by default it counts from 1."""

    def __init__(
        self,
        agent: str,
        rng: np.random.Generator,
        new_label: Callable[[], str] | None = None,
    ) -> None:
        self.agent = agent
        self._rng = rng
        self._labels = 0
        self._seq = 0
        self._new_label = new_label or self._count

    def start(self, world: World, now: datetime) -> list[Observation]:
        """The inventory of a device that was just switched on."""
        self._heard = now
        return [Inventory(seq=self._next_seq(), observed_at=now, labels=self._inventory(world))]

    def look(self, world: World, now: datetime) -> list[Observation]:
        """What changed since the last look; a sign of life where nothing did for long."""
        found = self._changes(world, now)
        if not found and now - self._heard >= SIGN_OF_LIFE:
            found.append(AgentState(seq=self._next_seq(), observed_at=now, state="connected"))
        if found:
            self._heard = now
        return found

    @abstractmethod
    def _inventory(self, world: World) -> list[InventoryLabel]:
        """All labels there are now."""

    @abstractmethod
    def _changes(self, world: World, now: datetime) -> list[Observation]:
        """What changed since the last time, in order."""

    def _count(self) -> str:
        self._labels += 1
        return f"{self.agent}/{self._labels}"

    def _next_seq(self) -> int:
        self._seq += 1
        return self._seq - 1

    def _measured(self, xy: Xy, sd_m: float) -> Xy:
        x, y = self._rng.normal(xy, sd_m)
        return (round(float(x), 4), round(float(y), 4))


class CabinetAgent(SensorAgent):
    """Load cells tell at once that and where something was put; the tag reader takes ``READ_S`` longer."""

    def __init__(
        self,
        cabinet: Cabinet,
        rng: np.random.Generator,
        new_label: Callable[[], str] | None = None,
        *,
        weigh: bool = False,
    ) -> None:
        super().__init__(cabinet.id, rng, new_label)
        self._cabinet = cabinet
        self._weigh = weigh
        self._known: dict[int, tuple[str, str]] = {}  # slot -> (label, tag of the thing there)
        self._unread: dict[int, float] = {}  # slot -> world time at which its tag will have been read

    def _inventory(self, world: World) -> list[InventoryLabel]:
        labels = []
        for slot, tag in self._contents(world).items():
            self._known[slot] = (self._new_label(), tag)
            labels.append(
                InventoryLabel(
                    label=self._known[slot][0],
                    kind="cabinet",
                    xy=self._measured(self._cabinet.slots[slot], 0.005),
                    z=self._cabinet.z,
                    surface=self._cabinet.surface,
                    tag=tag,
                )
            )
        return labels

    def _changes(self, world: World, now: datetime) -> list[Observation]:
        contents = self._contents(world)
        gone = [slot for slot, (_, tag) in self._known.items() if contents.get(slot) != tag]
        found: list[Observation] = [self._vanish(world, slot, now) for slot in gone]
        new = sorted(contents.keys() - self._known.keys())
        found += [self._appear(world, slot, contents[slot], now) for slot in new]
        for slot in [slot for slot, due in self._unread.items() if due <= world.time_s]:
            del self._unread[slot]
            label, tag = self._known[slot]
            found.append(TagObserved(seq=self._next_seq(), observed_at=now, label=label, tag=tag))
        return found

    def _vanish(self, world: World, slot: int, now: datetime) -> LabelVanished:
        label, tag = self._known.pop(slot)
        self._unread.pop(slot, None)
        seen = LabelVanished(seq=self._next_seq(), observed_at=now, label=label)
        return self._weighed(seen, world, tag)

    def _appear(self, world: World, slot: int, tag: str, now: datetime) -> LabelAppeared:
        self._known[slot] = (self._new_label(), tag)
        self._unread[slot] = world.time_s + READ_S
        seen = LabelAppeared(
            seq=self._next_seq(),
            observed_at=now,
            label=self._known[slot][0],
            kind="cabinet",
            xy=self._measured(self._cabinet.slots[slot], 0.005),
            z=self._cabinet.z,
            surface=self._cabinet.surface,
        )
        return self._weighed(seen, world, tag)

    def _weighed(self, seen: Seen, world: World, tag: str) -> Seen:
        if not self._weigh:
            return seen
        weight_g = max(0.0, round(float(self._rng.normal(world.things[tag].weight_g, 2.0)), 1))
        return seen.model_copy(update={"weight_g": weight_g})

    def _contents(self, world: World) -> dict[int, str]:
        return {
            place.slot: tag
            for tag, place in sorted(world.places.items())
            if isinstance(place, InCabinet) and place.cabinet == self._cabinet.id
        }


class FloorAgent(SensorAgent):
    """A laser just above the floor: people's feet are movers, things are labels without a tag.

    It leaves out the robots, which report themselves. Somebody who steps out of its view keeps the last position.
    """

    def __init__(self, agent: str, rng: np.random.Generator, new_label: Callable[[], str] | None = None) -> None:
        super().__init__(agent, rng, new_label)
        self._people: dict[str, tuple[str, Xy]] = {}  # person -> (label, position reported last)
        self._things: dict[str, tuple[str, Xy]] = {}  # the track of a thing -> (label, position)

    def _inventory(self, world: World) -> list[InventoryLabel]:
        labels = []
        for person, xy in self._visible_people(world).items():
            self._people[person] = (self._new_label(), xy)
            labels.append(InventoryLabel(label=self._people[person][0], kind="mover", xy=self._measured(xy, 0.02)))
        for thing, xy in self._visible_things(world).items():
            self._things[thing] = (self._new_label(), xy)
            labels.append(InventoryLabel(label=self._things[thing][0], kind="floor", xy=self._measured(xy, 0.01)))
        return labels

    def _changes(self, world: World, now: datetime) -> list[Observation]:
        things = self._visible_things(world)
        found: list[Observation] = []
        for thing in [thing for thing, (_, xy) in self._things.items() if things.get(thing) != xy]:
            label, _ = self._things.pop(thing)
            found.append(LabelVanished(seq=self._next_seq(), observed_at=now, label=label))
        found += self._movements(world, now)
        for thing in sorted(things.keys() - self._things.keys()):
            self._things[thing] = (self._new_label(), things[thing])
            found.append(
                LabelAppeared(
                    seq=self._next_seq(),
                    observed_at=now,
                    label=self._things[thing][0],
                    kind="floor",
                    xy=self._measured(things[thing], 0.01),
                )
            )
        return found

    def _movements(self, world: World, now: datetime) -> list[Observation]:
        found: list[Observation] = []
        for person, xy in self._visible_people(world).items():
            if person not in self._people:
                self._people[person] = (self._new_label(), xy)
                label = self._people[person][0]
                found.append(
                    MoverEntered(seq=self._next_seq(), observed_at=now, label=label, xy=self._measured(xy, 0.02))
                )
                continue
            label, last = self._people[person]
            if _worth_telling(last, xy, at_rest=not world.movers[person].path):
                self._people[person] = (label, xy)
                found.append(
                    LabelMoved(seq=self._next_seq(), observed_at=now, label=label, xy=self._measured(xy, 0.02))
                )
        return found

    @staticmethod
    def _visible_people(world: World) -> dict[str, Xy]:
        return {mover.id: mover.xy for mover in world.movers.values() if mover.kind == "person"}

    @staticmethod
    def _visible_things(world: World) -> dict[str, Xy]:
        # The tag is only the name of the laser's track; nothing of it is told.
        return {tag: place.xy for tag, place in sorted(world.places.items()) if isinstance(place, OnFloor)}


class RobotAgent(SensorAgent):
    """A robot reports its body as a mover, what it grips (with the tag read by its hand) and what it puts down."""

    def __init__(
        self, agent: str, robot: str, rng: np.random.Generator, new_label: Callable[[], str] | None = None
    ) -> None:
        super().__init__(agent, rng, new_label)
        self._robot = robot
        self._body = ""
        self._told: Xy = (0.0, 0.0)
        self._told_theta = 0.0
        self._gripped: tuple[str, str] | None = None  # (label, tag)
        self._put: dict[str, str] = {}  # tag -> label of what it has put on furniture

    def _inventory(self, world: World) -> list[InventoryLabel]:
        self._body = self._new_label()
        self._told, self._told_theta = world.movers[self._robot].xy, world.movers[self._robot].theta
        labels = [InventoryLabel(label=self._body, kind="mover", xy=self._told)]
        tag = world.gripped_by(self._robot)
        if tag is not None:
            self._gripped = (self._new_label(), tag)
            labels.append(
                InventoryLabel(label=self._gripped[0], kind="robot", xy=world.movers[self._robot].gripper, tag=tag)
            )
        return labels

    def _changes(self, world: World, now: datetime) -> list[Observation]:
        return [*self._released(world, now), *self._moved(world, now), *self._grasped(world, now)]

    def _released(self, world: World, now: datetime) -> list[Observation]:
        if self._gripped is None:
            return []
        label, tag = self._gripped
        place = world.places[tag]
        if place == Gripped(self._robot):
            return []
        self._gripped = None
        if not isinstance(place, OnTable):
            return [LabelVanished(seq=self._next_seq(), observed_at=now, label=label)]
        self._put[tag] = self._new_label()
        return [
            Transfer(
                seq=self._next_seq(),
                observed_at=now,
                from_=label,
                to=self._put[tag],
                kind="table",
                xy=self._measured(place.xy, 0.01),
                surface=place.surface,
            )
        ]

    def _moved(self, world: World, now: datetime) -> list[Observation]:
        body = world.movers[self._robot]
        turned = not body.path and abs(body.theta - self._told_theta) > TURN_RAD
        if not turned and not _worth_telling(self._told, body.xy, at_rest=not body.path):
            return []
        self._told, self._told_theta = body.xy, body.theta
        x, y = self._measured(body.xy, 0.01)
        found: list[Observation] = [
            PoseReport(seq=self._next_seq(), observed_at=now, label=self._body, pose=(x, y, round(body.theta, 4)))
        ]
        if self._gripped is not None:
            xy = self._measured(body.gripper, 0.01)
            found.append(LabelMoved(seq=self._next_seq(), observed_at=now, label=self._gripped[0], xy=xy))
        return found

    def _grasped(self, world: World, now: datetime) -> list[Observation]:
        tag = world.gripped_by(self._robot)
        if tag is None or self._gripped is not None:
            return []
        self._gripped = (self._new_label(), tag)
        return [
            LabelAppeared(
                seq=self._next_seq(),
                observed_at=now,
                label=self._gripped[0],
                kind="robot",
                xy=self._measured(world.movers[self._robot].gripper, 0.01),
                tag=tag,
            )
        ]


def _worth_telling(last: Xy, xy: Xy, *, at_rest: bool) -> bool:
    gap = math.dist(last, xy)
    return gap >= REPORT_M or (at_rest and gap > 0.01)
