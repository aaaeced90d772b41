"""``tms floor watch``: views from the running agent, from the lasers where none runs, or out of recordings."""

from __future__ import annotations

import asyncio
import contextlib
import itertools
import time
from collections.abc import AsyncGenerator, Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from tms_agents.clocks import Clocks
from tms_agents.devices.scans import Scan
from tms_agents.devices.transport import DeviceState
from tms_agents.floor.config import FloorConfig, LaserSection
from tms_agents.floor.core import Floor
from tms_agents.floor.live_view import LiveView
from tms_agents.floor.recordings.recorded import Recorded, in_time
from tms_agents.floor.runner import Understanding, listen
from tms_agents.floor.settings import Pose
from tms_agents.live import shows, socket_path, views
from tms_agents.state import peek_state, state_path

_PERIOD_S = 0.2


async def watch(config: FloorConfig, poses: Mapping[str, Pose]) -> AsyncGenerator[dict[str, Any], None]:
    """The agent's views for as long as it runs; views of the lasers where no agent runs, or after it ended."""
    path = socket_path(config.spool.path)
    while True:
        with contextlib.suppress(OSError):
            async with contextlib.aclosing(views(path)) as shown:
                async for view in shown:
                    yield view
            await asyncio.sleep(_PERIOD_S)
            continue
        async with contextlib.aclosing(watch_lasers(config, poses)) as shown:
            async for view in shown:
                yield view
                if await shows(path):
                    break  # an agent started, and needs the lasers


async def watch_lasers(config: FloorConfig, poses: Mapping[str, Pose]) -> AsyncGenerator[dict[str, Any], None]:
    """Read the lasers; nothing is posted, nothing is written. What an agent learnt before is known."""
    saved = peek_state(state_path(config.spool.path), config.agent)
    clocks = Clocks.resumed(saved, time.time, time.monotonic)
    numbers = itertools.count(1)
    floor = Floor(config, poses, clocks, lambda: f"new/{next(numbers)}", saved)
    mind = Understanding(floor, clocks, lambda observations: None)

    async def look(laser: LaserSection) -> None:
        await mind.warm()
        await listen(laser, config.silent_after_s, mind.take, floor.line)

    work = [asyncio.create_task(look(one)) for one in config.lasers]
    work.append(asyncio.create_task(mind.work()))
    try:
        while not any(task.done() for task in work):
            yield mind.view.now("devices")
            await asyncio.sleep(_PERIOD_S)
        for task in work:
            if task.done():
                task.result()
    finally:
        for task in work:
            task.cancel()
        await asyncio.gather(*work, return_exceptions=True)
        mind.close()


def play(
    recordings: Sequence[Recorded], config: FloorConfig, every_s: float = 0.1
) -> Iterator[tuple[float, dict[str, Any]]]:
    """Views of recordings with their times, as they would have been shown; ``config`` names the same lasers."""
    times = [0.0]
    clocks = Clocks(lambda: times[0], lambda: times[0])
    numbers = itertools.count(1)
    floor = Floor(config, {one.name: one.pose for one in recordings}, clocks, lambda: f"new/{next(numbers)}")
    view = LiveView(floor, clocks, lambda: times[0])
    for one in recordings:
        floor.line(one.name, DeviceState("connected", "recording"))
    shown = -np.inf
    for number, n in in_time(recordings):
        one = recordings[number]
        times[0] = float(one.t[n])
        scan = one.scan(n)
        floor.scans(one.name, times[0], [Scan(scan.sweep, scan.ranges, scan.intensities, device_time_s=times[0])])
        view.now()  # somebody looks
        view.refresh()
        if times[0] - shown >= every_s:
            shown = times[0]
            yield times[0], view.now("the recording")


def config_of(recordings: Sequence[Recorded], like: FloorConfig | None = None) -> FloorConfig:
    """A configuration with the lasers of recordings; scene and settings from ``like``."""
    lasers = []
    for one in recordings:
        x, y, theta = one.pose
        lasers.append(
            {
                "name": one.name,
                "source": {"kind": "scip", "device": one.name},
                "pose": {"x": x, "y": y, "theta": float(np.arctan2(np.sin(theta), np.cos(theta)))},
                "range_scale": one.range_scale,
            }
        )
    base: dict[str, Any] = {"agent": "recording", "room": "recording", "spool": {"path": "recording.spool"}}
    if like is not None:
        base |= like.model_dump(include={"scene", "robots", "estimator", "report_m", "report_s"})
    return FloorConfig.model_validate(base | {"lasers": lasers})
