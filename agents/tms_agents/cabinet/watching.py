"""``tms cabinet watch``: views from the running agent, or, where none runs, from the devices themselves."""

from __future__ import annotations

import asyncio
import contextlib
import itertools
import time
from collections.abc import AsyncGenerator, Mapping
from typing import Any

from tms_agents.cabinet.calibration_file import BoardCalibration
from tms_agents.cabinet.config import CabinetConfig
from tms_agents.cabinet.core import Cabinet
from tms_agents.cabinet.listening import listen_to_board, listen_to_reader, tick
from tms_agents.cabinet.view import view_of
from tms_agents.clocks import Clocks
from tms_agents.live import shows, socket_path, views
from tms_agents.state import peek_state, state_path

_PERIOD_S = 0.2


async def watch(
    config: CabinetConfig, calibrations: Mapping[str, BoardCalibration]
) -> AsyncGenerator[dict[str, Any], None]:
    """The agent's views for as long as it runs; views of the devices where no agent runs, or after it ended."""
    while True:
        with contextlib.suppress(OSError):
            async with contextlib.aclosing(views(socket_path(config.spool.path))) as shown:
                async for view in shown:
                    yield view
            await asyncio.sleep(_PERIOD_S)
            continue
        async with contextlib.aclosing(watch_devices(config, calibrations)) as shown:
            async for view in shown:
                yield view
                if await shows(socket_path(config.spool.path)):
                    break  # an agent started, and needs the devices


async def watch_devices(
    config: CabinetConfig, calibrations: Mapping[str, BoardCalibration]
) -> AsyncGenerator[dict[str, Any], None]:
    """Read the devices; nothing is posted, nothing is written. What stood on the boards when an agent ran is known."""
    saved = peek_state(state_path(config.spool.path), config.agent)
    clocks = Clocks.resumed(saved, time.time, time.monotonic)
    numbers = itertools.count(1)
    cabinet = Cabinet(config, calibrations, clocks, lambda: f"new/{next(numbers)}", saved)
    work = [asyncio.create_task(listen_to_board(cabinet, one)) for one in config.boards]
    work += [asyncio.create_task(listen_to_reader(cabinet, one)) for one in config.readers]
    if cabinet.ticks:
        work.append(asyncio.create_task(tick(cabinet)))
    try:
        while not any(task.done() for task in work):
            yield view_of(cabinet, clocks, "devices")
            await asyncio.sleep(_PERIOD_S)
        for task in work:
            if task.done():
                task.result()
    finally:
        for task in work:
            task.cancel()
        await asyncio.gather(*work, return_exceptions=True)
