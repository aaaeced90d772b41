"""What the agents have told the server, compared with what is in the simulated room: who is late, and with what.

Of the belief nothing is asked: only which position labels there are, and which tags were read at them.
"""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable, Mapping

from tms_agents.simulation.room import FLOOR_AGENT, ROBOT_AGENT
from tms_agents.simulation.script import Told
from tms_agents.simulation.world import Gripped, InCabinet, OnFloor, OnTable, Place, World
from tms_client import Town
from tms_schemas.belief import LabelsAnswer
from tms_schemas.events import Kind

#: A board that delivers has learnt its empty load after this.
_ZERO_S = 1.0
#: And a laser the empty room.
_FLOOR_S = 9.0
_THINGS = {"cabinet": "on its board", "floor": "on the floor", "robot": "in the hand", "table": "put on furniture"}


class Hearing:
    """``late`` asks the server; tags that were found read at their place are not asked for again."""

    def __init__(
        self, town: Town, room: str, monotonic: Callable[[], float] = time.monotonic, *, laser: bool = False
    ) -> None:
        self._town, self._room, self._monotonic, self._laser = town, room, monotonic, laser
        self._connected_at: float | None = None
        self._read: dict[str, Place] = {}

    def late(self, world: World, wish: Told) -> str | None:
        """The first agent that has not told everything, and what is missing."""
        if wish.connected and (why := self._unconnected(world)):
            return why
        labels = self._town.labels(self._room)
        return (
            self._untold(world, labels)
            or self._unread(world, labels, wish.unread)
            or (_unweighed(labels) if wish.unread else None)
            or None
        )

    def _unconnected(self, world: World) -> str:
        for agent in (*world.cabinets, ROBOT_AGENT, *([FLOOR_AGENT] if self._laser else [])):
            view = self._town.agents.get(agent)
            if view.state == "unknown":
                return f"agent {agent} has not said anything"
            if view.state != "connected":
                return f"agent {agent} is {view.state}: {view.why}"
        movers = Counter(one.agent for one in self._town.movers(self._room).movers)
        # On the bed nobody is in the plane of a laser.
        for agent in (ROBOT_AGENT,) if self._laser else (FLOOR_AGENT, ROBOT_AGENT):
            if not movers[agent]:
                return f"agent {agent} has told of nobody in the room"
        if self._connected_at is None:
            self._connected_at = self._monotonic()
        passed = self._monotonic() - self._connected_at
        if self._laser and passed < _FLOOR_S:
            return "the floor sensor learns the empty room"
        return "the boards learn their empty load" if passed < _ZERO_S else ""

    def _untold(self, world: World, answer: LabelsAnswer) -> str:
        told = Counter((one.agent, one.kind) for one in answer.labels if not one.ghost)
        for (agent, kind), there in _there(world).items():
            if told[agent, kind] != there:
                found = f"{told[agent, kind]} things {_THINGS[kind]}, there are {there}"
                return f"agent {agent} is late: it has told of {found}"
        return ""

    def _unread(self, world: World, answer: LabelsAnswer, unread: frozenset[str]) -> str:
        for tag, place in world.places.items():
            if tag in unread or self._read.get(tag) == place or not isinstance(place, InCabinet | Gripped):
                continue
            agent = place.cabinet if isinstance(place, InCabinet) else ROBOT_AGENT
            own = {one.label for one in answer.labels if one.agent == agent and not one.ghost and one.kind != "table"}
            seen = self._town.where(tag).last_direct_evidence
            if seen is None or seen.label not in own:
                return f"agent {agent} is late: it has not told of tag {tag}"
            self._read[tag] = place
        self._read = {tag: place for tag, place in self._read.items() if world.places[tag] == place}
        return ""


def _unweighed(answer: LabelsAnswer) -> str:
    """What has no tag to tell it is known by its weight."""
    late = [one.agent for one in answer.labels if one.kind == "cabinet" and not one.ghost and one.weight_g is None]
    return f"agent {late[0]} is late: it has not told what something weighs" if late else ""


def _there(world: World) -> Mapping[tuple[str | None, Kind], int]:
    """How many labels each agent ought to have, by kind."""
    places = list(world.places.values())

    def count(kind: type) -> int:
        return sum(isinstance(place, kind) for place in places)

    there: dict[tuple[str | None, Kind], int] = {
        (cabinet, "cabinet"): len(world.inside(cabinet)) for cabinet in world.cabinets
    }
    return there | {
        (FLOOR_AGENT, "floor"): count(OnFloor),
        (ROBOT_AGENT, "robot"): count(Gripped),
        (ROBOT_AGENT, "table"): count(OnTable),
    }
