"""What every agent's runner needs: spool and poster, the state of its devices, a heartbeat, an orderly end.

async with running(config, drain_s=2.0) as post:
    async for at, item in open_reader(config.source):
        if isinstance(item, DeviceState):
            await post.device("reader", at, item)
        else:
            await post.observations(*what_changed(item))
"""

from __future__ import annotations

import asyncio
import contextlib
import logging
import signal
import time
from collections.abc import AsyncGenerator, AsyncIterator, Callable, Coroutine, Mapping
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import Annotated, Any, TypeVar

from pydantic import Field

from tms_agents.config import AgentConfig
from tms_agents.devices.transport import DeviceState
from tms_client import AsyncPoster, AsyncTown, Pace, Spool, SpoolFull
from tms_schemas.observation import AgentState, Observation

log = logging.getLogger(__name__)
T = TypeVar("T")

#: Field of a configuration: the state of the devices is posted again this often.
Heartbeat = Annotated[float, Field(gt=0, le=3600)]
_WORST = ("connected", "silent", "faulty")
_MAX_WHY = 500


@dataclass(slots=True)
class Posted:
    """What a run posted. ``lost`` observations found the spool full, ``buried`` ones were refused by the server."""

    observations: int = 0
    lost: int = 0
    buried: int = 0
    waiting: int = 0
    trouble: str = ""

    def in_words(self) -> str:
        return (
            f"{self.observations} observations, {self.buried} refused by the server, {self.lost} lost, "
            f"{self.waiting} waiting in the spool{f' ({self.trouble})' if self.trouble else ''}"
        )


class Devices:
    """The states of an agent's devices in one: the worst of them, and what each says that is not well."""

    def __init__(self) -> None:
        self._states: dict[str, DeviceState] = {}

    def take(self, name: str, state: DeviceState) -> DeviceState | None:
        """A device's new state; the sum where it changed."""
        before = self.sum
        self._states[name] = state
        return self.sum if self.sum != before else None

    @property
    def sum(self) -> DeviceState | None:
        """None until a device said something."""
        if not self._states:
            return None
        worst = max((one.state for one in self._states.values()), key=_WORST.index)
        # Beside a faulty device a silent one is named, too.
        named = [one for one in self._states.values() if one.state == worst]
        named += [one for one in self._states.values() if one.state not in (worst, "connected")]
        return DeviceState(worst, "; ".join(one.why for one in named)[:_MAX_WHY])


class Running:
    """Takes what the agent observes; made by ``running``."""

    def __init__(self, town: AsyncTown, poster: AsyncPoster, posted: Posted, clock: Callable[[], float]) -> None:
        self.town, self.posted, self.devices = town, posted, Devices()
        self._poster, self._clock = poster, clock
        #: Newest time of anything posted.
        self.newest: datetime | None = None
        self._losing, self._lost_before = False, 0

    def now(self) -> datetime:
        """By the clock, and not before anything that was posted: it may have been set back meanwhile."""
        now = datetime.fromtimestamp(self._clock(), UTC)
        return now if self.newest is None else max(now, self.newest)

    def new_label(self) -> str:
        """A label id that the agent never used."""
        return self._poster.spool.new_label()

    @property
    def remembers(self) -> bool:
        """Whether all labels that were given are on the disk (``Spool.remembers``)."""
        return self._poster.spool.remembers

    @property
    def waiting(self) -> int:
        """Observations that the server has not acknowledged."""
        return len(self._poster.spool)

    async def observations(self, *observations: Observation) -> bool:
        """Into the spool, all or none. What a full one, or a full disk, refuses is counted as lost (False).

        It is said when that begins and when it is over.
        """
        if not observations:
            return True
        self.newest = max([one.observed_at for one in observations] + ([self.newest] if self.newest else []))
        try:
            await self._poster.post(*observations)
        except SpoolFull as full:
            if not self._losing:
                self._losing, self._lost_before = True, self.posted.lost
                log.error("%s; what is seen now is lost", full)
            self.posted.lost += len(observations)
            return False
        if self._losing:
            self._losing = False
            lost = self.posted.lost - self._lost_before
            log.warning("the spool of %s takes observations again; %d were lost", self._poster.spool.agent, lost)
        self.posted.observations += len(observations)
        return True

    async def device(self, name: str, at: datetime, state: DeviceState) -> None:
        """A device of the agent is in a new state: post the sum of all where it changed."""
        log.info("%s: %s: %s", name, state.state, state.why)
        if new := self.devices.take(name, state):
            await self.observations(AgentState(seq=0, observed_at=at, state=new.state, why=new.why))

    async def beat(self, every_s: float) -> None:
        """Post the state again and again: a quiet agent is not a dead one. Not counted among the observations."""
        while True:
            await asyncio.sleep(every_s)
            if (state := self.devices.sum) is not None:
                self.newest = self.now()
                with contextlib.suppress(SpoolFull):
                    await self._poster.post(
                        AgentState(seq=0, observed_at=self.newest, state=state.state, why=state.why)
                    )


@contextlib.asynccontextmanager
async def running(
    config: AgentConfig,
    *,
    drain_s: float,
    heartbeat_s: float | None = 10.0,
    posted: Posted | None = None,
    clock: Callable[[], float] = time.time,
) -> AsyncIterator[Running]:
    """Spool and poster of an agent while it works. Cancelling the work ends it in order, without an error.

    At the end the agent posts that it is silent and sends what waits for at most ``drain_s`` seconds; the rest stays
    in the spool. Cancelled again meanwhile, it sends no more. ``heartbeat_s`` None is for recordings: no heartbeat, and
    the end has the time of the last entry.
    ``clock`` gives Unix time.

    Raises:
        SpoolError: the spool cannot be opened.
    """
    posted = Posted() if posted is None else posted
    pace = Pace(batch=config.server.batch, linger_s=config.server.linger_s)
    with Spool(
        config.spool.path, config.agent, max_items=config.spool.max_items, max_bytes=config.spool.max_bytes
    ) as spool:
        buried_before = spool.buried
        async with (
            AsyncTown(config.server.url, config.server.key) as town,
            town.poster(spool, config.room, pace=pace) as poster,
        ):
            run = Running(town, poster, posted, clock)
            with contextlib.suppress(asyncio.CancelledError):
                if heartbeat_s is None:
                    yield run
                else:
                    async with _in_background(run.beat(heartbeat_s)):
                        yield run
            ended = run.newest if heartbeat_s is None and run.newest else run.now()
            with contextlib.suppress(SpoolFull):
                last = AgentState(seq=0, observed_at=ended, state="silent", why="the agent ended")
                await _whole(poster.post(last))
            with contextlib.suppress(asyncio.CancelledError):
                await poster.drain(drain_s)
            posted.trouble = str(poster.trouble or "")
        posted.buried, posted.waiting = spool.buried - buried_before, len(spool)


async def merged(
    sources: Mapping[str, AsyncGenerator[T, None]], *, most_waiting: int = 1000
) -> AsyncGenerator[tuple[str, T], None]:
    """What several sources deliver, with their names, as it comes; ends when all have ended.

    A source whose items are not taken waits. What one raises is raised here; close this to close them all.
    """
    waiting: asyncio.Queue[tuple[str, T] | Exception | None] = asyncio.Queue(most_waiting)

    async def pump(name: str, source: AsyncGenerator[T, None]) -> None:
        try:
            async with contextlib.aclosing(source):
                async for item in source:
                    await waiting.put((name, item))
        except Exception as error:
            await waiting.put(error)
        else:
            await waiting.put(None)

    tasks = [asyncio.create_task(pump(name, source)) for name, source in sources.items()]
    try:
        open_ = len(tasks)
        while open_:
            item = await waiting.get()
            if isinstance(item, Exception):
                raise item
            if item is None:
                open_ -= 1
            else:
                yield item
    finally:
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)


async def until_signalled(work: Coroutine[Any, Any, T]) -> T:
    """Run; SIGINT and SIGTERM cancel the work, which ends in order (see ``running``)."""
    task = asyncio.ensure_future(work)
    loop = asyncio.get_running_loop()
    for number in (signal.SIGINT, signal.SIGTERM):
        loop.add_signal_handler(number, task.cancel)
    try:
        return await task
    finally:
        for number in (signal.SIGINT, signal.SIGTERM):
            loop.remove_signal_handler(number)


async def _whole(work: Coroutine[Any, Any, T]) -> T:
    """Run to the end, also where that is cancelled."""
    task = asyncio.ensure_future(work)
    while not task.done():
        with contextlib.suppress(asyncio.CancelledError):
            await asyncio.shield(task)
    return task.result()


@contextlib.asynccontextmanager
async def _in_background(work: Coroutine[Any, Any, None]) -> AsyncIterator[None]:
    task = asyncio.create_task(work)
    try:
        yield
    finally:
        task.cancel()
        await asyncio.gather(task, return_exceptions=True)
