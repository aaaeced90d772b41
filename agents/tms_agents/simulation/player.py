"""Plays scripts in the simulated room: the world moves, devices follow, the floor sensor looks."""

from __future__ import annotations

import time
from collections.abc import Callable
from datetime import datetime, timedelta
from typing import Protocol

from tms_agents.simulation.script import Firm, Script, Told
from tms_agents.simulation.world import World
from tms_client.cli import CommandError
from tms_schemas.observation import Observation

STEP_S = 0.1
#: Real seconds between two looks at what the agents told, and after which an agent is late.
LOOK_S, LATE_S = 0.05, 60.0
#: The agents take minutes to start where something is compiled first, on a slow machine.
START_S = 600.0


class FloorSensor(Protocol):
    """What sees people and things on the floor without devices; see ``floor.FloorAgent``."""

    def start(self, world: World, now: datetime) -> list[Observation]:
        """Switched on."""

    def look(self, world: World, now: datetime) -> list[Observation]:
        """What changed."""


class Elsewhere:
    """The floor sensor is a device with an agent of its own."""

    def start(self, world: World, now: datetime) -> list[Observation]:
        return []

    def look(self, world: World, now: datetime) -> list[Observation]:
        return []


class Senses(Protocol):
    """Devices, their agents, and what the server heard of them."""

    def follow(self, world: World) -> None:
        """What just happened in the room happens at the devices."""

    def floor(self, observations: list[Observation]) -> None:
        """The floor sensor observed."""

    def late(self, world: World, wish: Told | Firm) -> str | None:
        """Who has not yet done what ``wish`` waits for, and what, in words."""


class Player:
    """One world and its sensors; ``speed`` room seconds pass in one second of the clock.

    While a script waits for the agents the room stands still: devices take their own time. So it does while the
    machine has no time for it.
    """

    def __init__(
        self,
        world: World,
        floor: FloorSensor,
        senses: Senses,
        *,
        speed: float,
        clock: Callable[[], datetime],
        sleep: Callable[[float], object] = time.sleep,
        monotonic: Callable[[], float] = time.monotonic,
    ) -> None:
        self.world = world
        self._floor, self._senses, self._speed = floor, senses, speed
        self._clock, self._sleep, self._monotonic = clock, sleep, monotonic
        self._anchor = (clock(), world.time_s)

    @property
    def now(self) -> datetime:
        """The time of the floor sensor's clock."""
        since, at_s = self._anchor
        return since + timedelta(seconds=(self.world.time_s - at_s) / self._speed)

    def switch_on(self) -> None:
        """The floor sensor sends its inventory; the other agents do so by themselves."""
        self._set_clocks()
        self._senses.follow(self.world)
        self._senses.floor(self._floor.start(self.world, self.now))

    def play(self, script: Script) -> None:
        """Run a script to its end.

        Raises:
            CommandError: an agent is late; the message names it.
        """
        self._set_clocks()
        for wish in script:
            if wish is None:
                self._step()
            else:
                self._wait(wish)

    def _step(self) -> None:
        # Counted from now, not from when it was due: after a stall nobody makes up for it in leaps, which a laser
        # would take for somebody who vanished and somebody else who came.
        until = self._monotonic() + STEP_S / self._speed
        self._set_clocks()
        self.world.step(STEP_S)
        self._look()
        self._sleep(max(0.0, until - self._monotonic()))

    def _wait(self, wish: Told | Firm) -> None:
        starting = isinstance(wish, Told) and wish.connected
        patience = self._monotonic() + (START_S if starting else LATE_S)
        self._look()
        while (late := self._senses.late(self.world, wish)) is not None:
            if self._monotonic() > patience:
                if isinstance(wish, Told) and wish.or_go_on:
                    break
                raise CommandError(f"{late}, for {START_S if starting else LATE_S:.0f} s")
            self._sleep(LOOK_S)
            self._set_clocks()
            self._look()
        self._set_clocks()

    def _look(self) -> None:
        self._senses.follow(self.world)
        if found := self._floor.look(self.world, self.now):
            self._senses.floor(found)

    def _set_clocks(self) -> None:
        """The room stands still now and then, clocks do not; they never go back."""
        self._anchor = (max(self.now, self._clock()), self.world.time_s)
