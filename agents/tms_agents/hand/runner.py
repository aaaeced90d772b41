"""The hand agent at work: reports in, observations into the spool, the spool to the server."""

from __future__ import annotations

import asyncio
import contextlib
import time
from collections.abc import Callable

from tms_agents.devices.transport import DeviceState
from tms_agents.hand.config import HandConfig
from tms_agents.hand.sightings import Sightings, Tally
from tms_agents.readers import CaptureSource, Seen, open_reader
from tms_agents.running import running

__all__ = ["Tally", "run"]


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
        CommandError: a capture cannot be read, the description of an arm cannot be used.
    """
    if config.hands:
        from tms_agents.hand.robot_runner import run_robot  # needs numpy, which reading tags alone does not

        return await run_robot(config, drain_s=drain_s, progress=progress, clock=clock)
    assert config.source is not None
    tally = Tally()
    sightings = Sightings(config.visits.gap_s, tally, each=not config.counts_visits)
    heartbeat_s = None if isinstance(config.source, CaptureSource) else config.heartbeat_s
    arrivals = open_reader(config.source, silent_after_s=config.silent_after_s, clock=clock)
    async with running(config, drain_s=drain_s, heartbeat_s=heartbeat_s, posted=tally, clock=clock) as agent:
        async with contextlib.aclosing(arrivals):
            async for at, item in arrivals:
                if isinstance(item, DeviceState):
                    await agent.device("reader", at, item)
                else:
                    seen = [one for one in item if isinstance(one, Seen)]
                    told = [read for one in seen for read in sightings.see(one, config.zone_of(one.read.antenna))]
                    await agent.observations(*told)
                progress(tally)
        if not once:
            await asyncio.Event().wait()
    return tally
