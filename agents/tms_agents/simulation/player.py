"""Plays scripts in the simulated room: the world moves, the sensor agents look, their posters deliver."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from datetime import datetime, timedelta
from pathlib import Path
from typing import NamedTuple

import numpy as np

from tms_agents.simulation.room import CABINETS, FLOOR_AGENT, ROBOT, ROBOT_AGENT
from tms_agents.simulation.sensors import CabinetAgent, FloorAgent, RobotAgent, SensorAgent
from tms_agents.simulation.story import Script
from tms_agents.simulation.world import World
from tms_client import Pace, Poster, Spool, Town
from tms_schemas.observation import Observation

STEP_S = 0.1
#: Takes the observations of one agent.
Sink = Callable[[list[Observation]], None]


class Watched(NamedTuple):
    agent: SensorAgent
    sink: Sink


class Player:
    """One world and the agents that watch it; ``speed`` room seconds pass in one second of the clock."""

    def __init__(
        self,
        world: World,
        watched: list[Watched],
        *,
        speed: float,
        clock: Callable[[], datetime],
        sleep: Callable[[float], object] = time.sleep,
        monotonic: Callable[[], float] = time.monotonic,
    ) -> None:
        self.world = world
        self._watched = watched
        self._speed = speed
        self._clock, self._sleep, self._monotonic = clock, sleep, monotonic
        self._anchor = (clock(), world.time_s)

    @property
    def now(self) -> datetime:
        """The time of the sensors' clocks."""
        since, at_s = self._anchor
        return since + timedelta(seconds=(self.world.time_s - at_s) / self._speed)

    def switch_on(self) -> None:
        """Every agent sends its inventory."""
        self._set_clocks()
        for agent, sink in self._watched:
            sink(agent.start(self.world, self.now))

    def play(self, script: Script) -> None:
        """Run a script to its end; the agents look after every step of time."""
        self._set_clocks()
        due = self._monotonic()
        for _ in script:
            self.world.step(STEP_S)
            for agent, sink in self._watched:
                if observations := agent.look(self.world, self.now):
                    sink(observations)
            due += STEP_S / self._speed
            self._sleep(max(0.0, due - self._monotonic()))

    def _set_clocks(self) -> None:
        """The room stands still between two scripts, clocks do not; they never go back."""
        self._anchor = (max(self.now, self._clock()), self.world.time_s)


def agents(
    seed: int, *, weigh: bool, new_label: Callable[[str], Callable[[], str] | None] = lambda _: None
) -> list[SensorAgent]:
    """All sensor agents of the room; ``new_label`` gives each, by its name, the source of its label ids."""
    names = [*(cabinet.id for cabinet in CABINETS), FLOOR_AGENT, ROBOT_AGENT]
    streams = dict(zip(names, np.random.default_rng(seed).spawn(len(names)), strict=True))
    return [
        *(CabinetAgent(one, streams[one.id], new_label(one.id), weigh=weigh) for one in CABINETS),
        FloorAgent(FLOOR_AGENT, streams[FLOOR_AGENT], new_label(FLOOR_AGENT)),
        RobotAgent(ROBOT_AGENT, ROBOT, streams[ROBOT_AGENT], new_label(ROBOT_AGENT)),
    ]


@contextmanager
def posted(
    town: Town, room: str, spools: Path, seed: int, *, weigh: bool
) -> Iterator[tuple[list[Watched], list[Poster]]]:
    """The agents, each with a durable spool and a poster of its own to the server."""
    with ExitStack() as stack:
        posters: dict[str, Poster] = {}
        for agent in (*(cabinet.id for cabinet in CABINETS), FLOOR_AGENT, ROBOT_AGENT):
            spool = stack.enter_context(Spool(spools / f"{agent}.sqlite", agent))
            poster = posters[agent] = town.poster(spool, room, pace=Pace(linger_s=0.02))
            poster.drain()  # agrees with the server on the numbers to go on with
            stack.enter_context(poster)
        watched = [
            Watched(agent, lambda found, poster=posters[agent.agent]: poster.post(*found))  # type: ignore[misc]
            for agent in agents(seed, weigh=weigh, new_label=lambda name: posters[name].spool.new_label)
        ]
        yield watched, list(posters.values())
