"""The hand agent at work: reports in, observations into the spool, the spool to the server."""

from __future__ import annotations

import asyncio
import contextlib
import logging
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime

from pydantic import ValidationError

from tms_agents.devices.transport import DeviceState
from tms_agents.hand.config import CaptureSource, HandConfig
from tms_agents.hand.sources import Seen, arrivals
from tms_agents.hand.visits import Visits
from tms_client import AsyncPoster, AsyncTown, Pace, Spool, SpoolFull
from tms_schemas.observation import AgentState, Observation, RawRead

log = logging.getLogger(__name__)


@dataclass(slots=True)
class Tally:
    """What a run did.

    ``lost`` observations found the spool full; ``unusable`` tags have ids that the wire cannot carry (longer than 64
    hex digits).
    """

    reports: int = 0
    tags: set[str] = field(default_factory=set)
    observations: int = 0
    lost: int = 0
    unusable: set[str] = field(default_factory=set)
    buried: int = 0
    waiting: int = 0
    trouble: str = ""


async def run(
    config: HandConfig,
    *,
    once: bool,
    drain_s: float,
    progress: Callable[[Tally], None] = lambda tally: None,
    clock: Callable[[], float] = time.time,
) -> Tally:
    """Work until the task is cancelled (or, with ``once``, a capture is at its end), then post what waits.

    At most ``drain_s`` seconds are spent on that; what is left stays in the spool.

    Raises:
        SpoolError: the spool cannot be opened.
        CommandError: a capture cannot be read.
    """
    tally = Tally()
    visits = Visits(config.visits.gap_s)
    pace = Pace(batch=config.server.batch, linger_s=config.server.linger_s)
    with Spool(
        config.spool.path, config.agent, max_items=config.spool.max_items, max_bytes=config.spool.max_bytes
    ) as spool:
        buried_before = spool.buried
        async with (
            AsyncTown(config.server.url, config.server.key) as town,
            town.poster(spool, config.room, pace=pace) as poster,
        ):
            at, heart = None, _Heart(config, poster, clock)
            with contextlib.suppress(asyncio.CancelledError):
                async with contextlib.aclosing(arrivals(config, clock)) as items, heart:
                    async for at, item in items:
                        heart.device = item if isinstance(item, DeviceState) else heart.device
                        observations = _observations(config, visits, tally, at, item)
                        try:
                            if observations:
                                await poster.post(*observations)
                        except SpoolFull as full:
                            if not tally.lost:
                                log.error("%s; what is seen now is lost", full)
                            tally.lost += len(observations)
                        else:
                            tally.observations += len(observations)
                        progress(tally)
                if not once:
                    await asyncio.Event().wait()
            with contextlib.suppress(SpoolFull):
                recorded = at if isinstance(config.source, CaptureSource) else None
                ended = recorded or datetime.fromtimestamp(clock(), UTC)
                await poster.post(AgentState(seq=0, observed_at=ended, state="silent", why="the agent ended"))
            with contextlib.suppress(asyncio.CancelledError):
                await poster.drain(drain_s)
            tally.trouble = str(poster.trouble or "")
        tally.buried, tally.waiting = spool.buried - buried_before, len(spool)
    return tally


class _Heart:
    """Posts the device's state again and again while it is entered; a recording has none."""

    def __init__(self, config: HandConfig, poster: AsyncPoster, clock: Callable[[], float]) -> None:
        self.device: DeviceState | None = None
        self._config, self._poster, self._clock = config, poster, clock

    async def __aenter__(self) -> None:
        self._beating = asyncio.create_task(self._beat())

    async def __aexit__(self, *_: object) -> None:
        self._beating.cancel()
        await asyncio.gather(self._beating, return_exceptions=True)

    async def _beat(self) -> None:
        while not isinstance(self._config.source, CaptureSource):
            await asyncio.sleep(self._config.heartbeat_s)
            if self.device is not None:
                now, device = datetime.fromtimestamp(self._clock(), UTC), self.device
                with contextlib.suppress(SpoolFull):
                    await self._poster.post(AgentState(seq=0, observed_at=now, state=device.state, why=device.why))


def _observations(
    config: HandConfig, visits: Visits, tally: Tally, at: datetime, item: Sequence[Seen] | DeviceState
) -> list[Observation]:
    if isinstance(item, DeviceState):
        log.info("%s: %s", item.state, item.why)
        return [AgentState(seq=0, observed_at=at, state=item.state, why=item.why)]
    observations: list[Observation] = []
    for seen in item:
        tag, zone = seen.read.tag, config.zone_of(seen.read.antenna)
        tally.reports += 1
        begins = visits.see(zone, tag, seen.first, seen.last)
        if config.counts_visits and not begins:
            continue
        try:
            observations.append(RawRead(seq=0, observed_at=seen.first, zone=zone, tag=tag))
            tally.tags.add(tag)
        except ValidationError:
            if tag not in tally.unusable:
                log.warning("tag %s cannot be posted: its id has more than 64 digits", tag)
            tally.unusable.add(tag)
    return observations
