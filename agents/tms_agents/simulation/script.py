"""Scripts: what people and robots do, as generators that act on the world and yield what they wait for."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from tms_agents.simulation.room import route
from tms_agents.simulation.world import World, Xy


@dataclass(frozen=True, kw_only=True, slots=True)
class Told:
    """Until the agents have told the server what is in the room now, however long their devices take.

    ``unread``: tags that no reader reads now. ``connected``: the agents' devices deliver, too. ``or_go_on``: a late
    agent is no failure.
    """

    unread: frozenset[str] = frozenset()
    connected: bool = False
    or_go_on: bool = False


@dataclass(frozen=True, slots=True)
class Firm:
    """Until the robot's fingers stand still."""


#: None: a step of time.
Script = Iterator[Told | Firm | None]


def walk(world: World, mover: str, start: str, *stops: str) -> Script:
    """Walk from one spot of the room to others; ends when the mover stands."""
    world.movers[mover].walk(route(start, *stops))
    while world.movers[mover].path:
        yield None
    yield from wait(world, 0.3)


def reach(world: World, robot: str, hand: Xy) -> Script:
    """Move the robot's gripper so far ahead and so high (metres)."""
    world.movers[robot].hand_goal = hand
    while world.movers[robot].hand != hand:
        yield None


def wait(world: World, seconds: float) -> Script:
    until = world.time_s + seconds
    while world.time_s < until - 1e-9:
        yield None
