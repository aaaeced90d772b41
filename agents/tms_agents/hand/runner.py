"""The hand agent at work: reports in, observations into the spool, the spool to the server."""

from __future__ import annotations

import asyncio
import contextlib
import logging
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

from pydantic import ValidationError

from tms_agents.devices.tags import RoundEnd
from tms_agents.devices.transport import DeviceState
from tms_agents.hand.config import HandConfig
from tms_agents.hand.visits import Visits
from tms_agents.readers import CaptureSource, Seen, open_reader
from tms_agents.running import Posted, running
from tms_schemas.observation import RawRead

log = logging.getLogger(__name__)


@dataclass(slots=True)
class Tally(Posted):
    """What a run did. ``unusable`` tags have ids that the wire cannot carry (longer than 64 hex digits)."""

    reports: int = 0
    tags: set[str] = field(default_factory=set)
    unusable: set[str] = field(default_factory=set)

    def in_words(self) -> str:
        return f"{self.reports} reports of {len(self.tags)} tags, {Posted.in_words(self)}"


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
    tally, visits = Tally(), Visits(config.visits.gap_s)
    heartbeat_s = None if isinstance(config.source, CaptureSource) else config.heartbeat_s
    arrivals = open_reader(config.source, silent_after_s=config.silent_after_s, clock=clock)
    async with running(config, drain_s=drain_s, heartbeat_s=heartbeat_s, posted=tally, clock=clock) as agent:
        async with contextlib.aclosing(arrivals):
            async for at, item in arrivals:
                if isinstance(item, DeviceState):
                    await agent.device("reader", at, item)
                else:
                    await agent.observations(*raw_reads(config, visits, tally, item))
                progress(tally)
        if not once:
            await asyncio.Event().wait()
    return tally


def raw_reads(config: HandConfig, visits: Visits, tally: Tally, items: Sequence[Seen | RoundEnd]) -> list[RawRead]:
    """What is posted of a group of reports: each, or each that begins a visit."""
    observations: list[RawRead] = []
    for seen in items:
        if isinstance(seen, RoundEnd):
            continue
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
