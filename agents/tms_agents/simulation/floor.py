"""The floor sensor of the simulated room: what a laser just above the floor would say of people and of things there.

Its device is not emulated yet: it looks at the room and draws its conclusions. Observations of one instant come in the
order vanish, mover, appear.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from datetime import datetime, timedelta

import numpy as np

from tms_agents.simulation.world import OnFloor, World, Xy
from tms_schemas.observation import (
    AgentState,
    Inventory,
    InventoryLabel,
    LabelAppeared,
    LabelMoved,
    LabelVanished,
    MoverEntered,
    Observation,
)

#: An agent that has nothing to report says so often enough not to count as silent.
SIGN_OF_LIFE = timedelta(seconds=10)
#: A mover's position is reported after this way, and where it came to rest.
REPORT_M = 0.25


class FloorAgent:
    """People's feet are movers, things are labels without a tag. ``new_label`` gives ids never used before.

    It leaves out the robots, which report themselves. Somebody who steps out of its view keeps the last position.
    """

    def __init__(self, agent: str, rng: np.random.Generator, new_label: Callable[[], str]) -> None:
        self.agent = agent
        self._rng, self._new_label = rng, new_label
        self._seq = 0
        self._people: dict[str, tuple[str, Xy]] = {}  # person -> (label, position reported last)
        self._things: dict[str, tuple[str, Xy]] = {}  # the track of a thing -> (label, position)

    def start(self, world: World, now: datetime) -> list[Observation]:
        """The inventory of a sensor that was just switched on."""
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

    def _next_seq(self) -> int:
        self._seq += 1
        return self._seq - 1

    def _measured(self, xy: Xy, sd_m: float) -> Xy:
        x, y = self._rng.normal(xy, sd_m)
        return (round(float(x), 4), round(float(y), 4))

    @staticmethod
    def _visible_people(world: World) -> dict[str, Xy]:
        return {mover.id: mover.xy for mover in world.movers.values() if mover.kind == "person"}

    @staticmethod
    def _visible_things(world: World) -> dict[str, Xy]:
        # The tag is only the name of the laser's track; nothing of it is told.
        return {tag: place.xy for tag, place in sorted(world.places.items()) if isinstance(place, OnFloor)}


def _worth_telling(last: Xy, xy: Xy, *, at_rest: bool) -> bool:
    gap = math.dist(last, xy)
    return gap >= REPORT_M or (at_rest and gap > 0.01)
