"""The hand agent of a robot that tells what its grippers do: readers and robot in, observations out."""

from __future__ import annotations

import asyncio
import contextlib
import logging
import time
from collections.abc import AsyncGenerator, Callable, Sequence
from datetime import UTC, datetime

from tms_agents.devices.tags import RoundEnd
from tms_agents.devices.transport import DeviceState
from tms_agents.hand.config import HandConfig, HandSection
from tms_agents.hand.memory import Memory
from tms_agents.hand.robot import Robot
from tms_agents.hand.setup import make_robot, make_surfaces
from tms_agents.hand.sightings import Sightings, Tally
from tms_agents.hand.state_sources import open_states
from tms_agents.hand.states import StateMessage
from tms_agents.readers import ReaderSource, Seen, open_reader
from tms_agents.running import Running, merged, running
from tms_client import TownError
from tms_schemas.observation import Observation

log = logging.getLogger(__name__)

#: The room is asked for again this often: tables move. Sooner while it is not known.
_ROOM_S, _ROOM_RETRY_S = 60.0, 10.0
ROBOT = "robot"


async def run_robot(
    config: HandConfig,
    *,
    drain_s: float,
    progress: Callable[[Tally], None] = lambda tally: None,
    clock: Callable[[], float] = time.time,
) -> Tally:
    """Work until the task is cancelled, then post what waits for at most ``drain_s`` seconds.

    Raises:
        SpoolError: the spool cannot be opened.
        CommandError: the description of an arm cannot be used.
    """
    tally = Tally()
    labels: list[Callable[[], str]] = []
    robot = make_robot(config, lambda: labels[0]())  # before the spool is opened: it may be refused
    async with running(config, drain_s=drain_s, heartbeat_s=config.heartbeat_s, posted=tally, clock=clock) as agent:
        labels.append(agent.new_label)
        work = _Work(config, robot, agent, tally)
        inputs = {name: _reads(source, config, clock) for name, source in work.sources.items()}
        async with (
            contextlib.aclosing(merged(inputs | {ROBOT: _states(config, clock)})) as items,
            work.knowing_the_room(),
        ):
            async for name, (at, item) in items:
                await work.take(name, at, item)
                progress(tally)
    return tally


Item = Sequence[Seen | RoundEnd] | Sequence[StateMessage] | DeviceState


async def _reads(
    source: ReaderSource, config: HandConfig, clock: Callable[[], float]
) -> AsyncGenerator[tuple[datetime, Item], None]:
    async with contextlib.aclosing(open_reader(source, silent_after_s=config.silent_after_s, clock=clock)) as arrivals:
        async for at, item in arrivals:
            yield at, item


async def _states(config: HandConfig, clock: Callable[[], float]) -> AsyncGenerator[tuple[datetime, Item], None]:
    assert config.robot is not None
    async with contextlib.aclosing(open_states(config.robot.states, silent_after_s=config.silent_after_s)) as found:
        async for item in found:
            yield datetime.fromtimestamp(clock(), UTC), item


class _Work:
    def __init__(self, config: HandConfig, robot: Robot, agent: Running, tally: Tally) -> None:
        self._config, self._robot, self._agent = config, robot, agent
        self._sightings = Sightings(config.visits.gap_s, tally, each=not config.counts_visits)
        self._memory = Memory(config.spool.path)
        room = self._memory.load(robot)
        robot.surfaces = make_surfaces(config, room)
        self._inventory_due = True
        #: Readers by name: that of each hand, and the one they share.
        self.sources: dict[str, ReaderSource] = {
            f"{hand.name} reader": hand.source for hand in config.hands if hand.source is not None
        }
        if config.source is not None:
            self.sources["reader"] = config.source

    async def take(self, name: str, at: datetime, item: Item) -> None:
        if isinstance(item, DeviceState):
            await self._device(name, at, item)
            return
        found: list[Observation] = []
        for one in item:
            if isinstance(one, StateMessage):
                found += self._message(at, one)
            else:
                found += self._read(name, at, one)
        if found:
            await self._agent.observations(*found)
            self._memory.keep_robot(self._robot)

    @contextlib.asynccontextmanager
    async def knowing_the_room(self) -> AsyncGenerator[None, None]:
        """Ask the server for the furniture, again and again."""
        task = asyncio.create_task(self._ask_for_the_room())
        try:
            yield
        finally:
            task.cancel()
            await asyncio.gather(task, return_exceptions=True)

    async def _ask_for_the_room(self) -> None:
        while True:
            try:
                room = await self._agent.town.rooms.get(self._config.room)
            except TownError as error:
                log.info("the room's furniture is as last known: %s", error)
                await asyncio.sleep(_ROOM_RETRY_S)
            else:
                self._robot.surfaces = make_surfaces(self._config, room)
                self._memory.keep_room(room)
                await asyncio.sleep(_ROOM_S)

    async def _device(self, name: str, at: datetime, state: DeviceState) -> None:
        await self._agent.device(name, at, state)
        if name != ROBOT:
            for hand in self._hands_of(name):
                self._robot.reader(hand.name, at, state.state == "connected")
        elif state.state != "connected":
            self._robot.interrupted()
            self._inventory_due = True

    def _message(self, at: datetime, message: StateMessage) -> list[Observation]:
        assert self._config.robot is not None
        if self._config.robot.robot_clock and message.t is not None:
            at = datetime.fromtimestamp(message.t, UTC)
        found = self._robot.message(at, message)
        if self._inventory_due:
            self._inventory_due = False
            found.append(self._robot.inventory(at))
        return found

    def _read(self, name: str, at: datetime, item: Seen | RoundEnd) -> list[Observation]:
        antenna = item.antenna if isinstance(item, RoundEnd) else item.read.antenna
        found: list[Observation] = []
        hands = [one for one in self._hands_of(name) if one.antennas is None or antenna in one.antennas]
        for hand in hands:
            if isinstance(item, RoundEnd):
                found += self._robot.round_end(hand.name, at)
            else:
                found += self._robot.read(hand.name, item.last, item.read.tag)
        if isinstance(item, Seen):
            zone = next((hand.zone for hand in hands if hand.zone), None) or self._config.zone_of(antenna)
            told = self._sightings.see(item, zone)
            if self._config.raw_reads and not self._robot.holds(item.read.tag):
                found += told
        return found

    def _hands_of(self, reader: str) -> list[HandSection]:
        """Hands at which a reader reads."""
        own = [hand for hand in self._config.hands if f"{hand.name} reader" == reader]
        return own or [hand for hand in self._config.hands if hand.source is None]
