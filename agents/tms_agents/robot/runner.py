"""The robot agent at work: scans in, its pose into the spool, changed tiles of its map to the server.

Scans are mapped and tiles sent in a thread of their own: neither keeps the spool waiting.
"""

from __future__ import annotations

import asyncio
import contextlib
import logging
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from datetime import UTC, datetime
from typing import TypeVar

from tms_agents.devices.transport import DeviceState
from tms_agents.robot.config import RobotConfig
from tms_agents.robot.map_uploader import MapUploader
from tms_agents.robot.mapper import Mapper
from tms_agents.running import Posted, Running, running
from tms_agents.slam.logs import Log
from tms_agents.slam.settings import Settings
from tms_client import Town, TownError
from tms_client.flows import NO_RETRY
from tms_schemas.maps import MapIn
from tms_schemas.observation import Inventory

log = logging.getLogger(__name__)
T = TypeVar("T")


async def run(
    config: RobotConfig,
    recorded: Log,
    *,
    drain_s: float,
    clock: Callable[[], float] = time.time,
    even: Callable[[], float] = time.monotonic,
) -> Posted:
    """Map until the drive ends or the task is cancelled; then what waits is posted for at most ``drain_s`` seconds.

    ``clock`` gives Unix time, ``even`` seconds that never jump.

    Raises:
        SpoolError: the spool cannot be opened.
    """
    posted = Posted()
    settings = Settings(particles=config.map.particles, resolution=config.resolution, seed=config.map.seed)
    mapper = Mapper(recorded, settings, config.map.start)
    with (
        Town(config.server.url, config.server.key, retry=NO_RETRY) as town,
        ThreadPoolExecutor(1, "mapper") as thread,
    ):
        charts = _Charts(config, town, mapper)
        async with running(
            config, drain_s=drain_s, heartbeat_s=config.heartbeat_s, posted=posted, clock=clock
        ) as agent:
            try:
                await _drive(config, mapper, charts, agent, thread, clock, even)
            finally:
                await asyncio.get_running_loop().run_in_executor(thread, charts.finish, drain_s)
    return posted


async def _drive(
    config: RobotConfig,
    mapper: Mapper,
    charts: _Charts,
    agent: Running,
    thread: ThreadPoolExecutor,
    clock: Callable[[], float],
    even: Callable[[], float],
) -> None:
    def now() -> datetime:
        return datetime.fromtimestamp(clock(), UTC)

    async def call(work: Callable[[], T]) -> T:
        return await asyncio.get_running_loop().run_in_executor(thread, work)

    assert config.source is not None
    label = agent.new_label()
    await agent.device("log", now(), DeviceState("connected", config.source.path.name))
    # Whatever an earlier run told of the body is no more.
    await agent.observations(Inventory(seq=0, observed_at=now(), labels=[]))
    began = even()
    for key in mapper.keys:
        if config.source.speed > 0:
            await asyncio.sleep(max(0.0, began + mapper.due_s(key) / config.source.speed - even()))
        await call(lambda key=key: mapper.scan(key))  # type: ignore[misc]
        await agent.observations(*mapper.body(now(), label))
        await call(charts.offer)


class _Charts:
    """The map of the mapper on the server, made there as soon as it answers."""

    def __init__(self, config: RobotConfig, town: Town, mapper: Mapper) -> None:
        self._config, self._town, self._mapper = config, town, mapper
        self._uploader = MapUploader(town, config.map.id, config.agent, config.map.every_s, log.warning)
        self._there = False
        self._trouble = ""

    def offer(self) -> None:
        with self._said():
            self._require()
            self._uploader.offer(self._mapper.grid)

    def finish(self, patience_s: float) -> None:
        with self._said():
            self._require()
            made = self._uploader.finish(self._mapper.grid(), patience_s)
            log.info("map %s is at version %d", self._config.map.id, made.version)

    def _require(self) -> None:
        if not self._there:
            about = self._config.map
            self._town.maps.put(
                about.id, MapIn(room=self._config.room, resolution=self._config.resolution, map_to_room=about.start)
            )
            self._there = True

    @contextlib.contextmanager
    def _said(self) -> Iterator[None]:
        """A refusal is said once; the robot drives on."""
        try:
            yield
        except TownError as error:
            if str(error) != self._trouble:
                self._trouble = str(error)
                log.error("map %s: %s", self._config.map.id, error)
