"""The room on its stage: emulated devices, the agents that run them as processes, and the server that hears them."""

from __future__ import annotations

import functools
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from datetime import UTC, datetime
from pathlib import Path

import numpy as np

from tms_agents.simulation.floor import FloorAgent
from tms_agents.simulation.hardware import Hardware, plugged_in
from tms_agents.simulation.hearing import Hearing
from tms_agents.simulation.installation import install
from tms_agents.simulation.player import Elsewhere, Player
from tms_agents.simulation.processes import Agents, running_agents
from tms_agents.simulation.room import FLOOR_AGENT, new_world
from tms_agents.simulation.script import Firm, Told
from tms_agents.simulation.world import World
from tms_client import Pace, Poster, Spool, Town
from tms_schemas.observation import Observation

UTC_NOW: Callable[[], datetime] = functools.partial(datetime.now, UTC)


class Stage:
    """The senses of a ``Player`` (see there); ``configs`` are the agents' files. Made by ``staged``."""

    def __init__(
        self,
        town: Town,
        room: str,
        hardware: Hardware,
        agents: Agents,
        poster: Poster | None,
        configs: Mapping[str, Path],
    ) -> None:
        self.hardware, self.agents, self.configs = hardware, agents, configs
        self._hearing = Hearing(town, room, laser=hardware.floor is not None)
        self._poster = poster

    def follow(self, world: World) -> None:
        self.hardware.follow(world)

    def floor(self, observations: list[Observation]) -> None:
        if self._poster is not None and observations:
            self._poster.post(*observations)

    def late(self, world: World, wish: Told | Firm) -> str | None:
        self.agents.require_alive()
        if isinstance(wish, Firm):
            return None if self.hardware.robot.is_firm else "the robot's fingers do not come to rest"
        if self._poster is not None and len(self._poster.spool):
            return f"agent {FLOOR_AGENT} cannot deliver: {self._poster.trouble or 'no answer'}"
        return self._hearing.late(world, wish)


@contextmanager
def staged(
    town: Town,
    url: str,
    key: str | None,
    room: str,
    folder: Path,
    *,
    seed: int,
    speed: float,
    laser: bool = False,
    clock: Callable[[], datetime] = UTC_NOW,
    sleep: Callable[[float], object] = time.sleep,
) -> Iterator[tuple[Stage, Player]]:
    """Devices plugged in, agents started, the room still empty. ``room`` must be registered; files go to ``folder``.

    ``laser``: the floor is seen by an emulated laser and its agent, which can follow at the speeds of
    ``floor_choice``; otherwise by a sensor without device.
    """
    with ExitStack() as stack:
        hardware = stack.enter_context(plugged_in(seed, laser=laser))
        configs = install(folder, hardware, url, room)
        agents = stack.enter_context(running_agents(configs, url, key))
        if laser:
            stage = Stage(town, room, hardware, agents, None, configs)
            player = Player(new_world(), Elsewhere(), stage, speed=speed, clock=clock, sleep=sleep)
            player.switch_on()
            yield stage, player
            return
        spool = stack.enter_context(Spool(folder / f"{FLOOR_AGENT}.spool", FLOOR_AGENT))
        poster = town.poster(spool, room, pace=Pace(linger_s=0.02))
        poster.drain()  # agrees with the server on the numbers to go on with
        stack.enter_context(poster)
        stage = Stage(town, room, hardware, agents, poster, configs)
        floor = FloorAgent(FLOOR_AGENT, np.random.default_rng([seed, 1]), spool.new_label)
        player = Player(new_world(), floor, stage, speed=speed, clock=clock, sleep=sleep)
        player.switch_on()
        yield stage, player
