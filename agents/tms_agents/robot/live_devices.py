"""Records of a robot's own devices as they come: scans, odometry, rounds of the tag reader, and how the devices are."""

from __future__ import annotations

import contextlib
import time
from collections.abc import AsyncGenerator, Callable
from datetime import datetime

import numpy as np
from numpy.typing import NDArray

from tms_agents.devices.arcos import ArcosSession, BaseStatus, Odometry
from tms_agents.devices.scans import Scan
from tms_agents.devices.tags import RoundEnd
from tms_agents.devices.transport import DeviceState, Link
from tms_agents.floor.recordings.clock import ScanTimes
from tms_agents.readers import open_reader
from tms_agents.robot.config import LiveSource
from tms_agents.robot.records import Moved, Record, Round, Scanned
from tms_agents.running import merged

Item = Record | DeviceState
Array = NDArray[np.float64]


async def device_records(
    source: LiveSource, clock: Callable[[], float] = time.time
) -> AsyncGenerator[tuple[str, Item], None]:
    """Records with Unix times, and states, by the name of the device; for ever, through every failure of a device."""
    sources = {"laser": _laser(source, clock), "base": _base(source, clock), "reader": _reader(source, clock)}
    async with contextlib.aclosing(merged(sources)) as items:
        async for item in items:
            yield item


async def _laser(source: LiveSource, clock: Callable[[], float]) -> AsyncGenerator[Item, None]:
    times = ScanTimes()
    async with contextlib.aclosing(source.laser.link(source.silent_after_s).listen()) as items:
        async for item in items:
            if isinstance(item, DeviceState):
                yield item
                continue
            for t, scan in zip(times.of(clock(), item), item, strict=True):
                yield Scanned(recorded(t, scan, source))


def recorded(t: float, scan: Scan, source: LiveSource) -> tuple[float, tuple[int, float, float, float], Array, None]:
    """As recordings have it: beams counter-clockwise, evenly apart, 0 where nothing came back."""
    sweep = scan.sweep
    angles = -sweep.angles if source.upside_down else sweep.angles
    reach = min(sweep.range_max_m, source.range_max_m or np.inf)
    with np.errstate(invalid="ignore"):
        ranges = np.where((scan.ranges > max(sweep.range_min_m, 0.0)) & (scan.ranges < reach), scan.ranges, 0.0)
    if angles[-1] < angles[0]:
        angles, ranges = angles[::-1], ranges[::-1]
    step = float(angles[-1] - angles[0]) / (len(angles) - 1)
    return t, (len(ranges), float(angles[0]), step, float(reach)), np.ascontiguousarray(ranges), None


async def _base(source: LiveSource, clock: Callable[[], float]) -> AsyncGenerator[Item, None]:
    base, odometry = source.base, Odometry()
    link: Link[BaseStatus] = Link(
        base.opener(9600),
        lambda: ArcosSession(odometry=odometry, unit_mm=base.unit_mm),
        name=f"Pioneer {base.place}",
        silent_after_s=source.silent_after_s,
        tick_s=0.05,
    )
    async with contextlib.aclosing(link.listen()) as items:
        async for item in items:
            if isinstance(item, DeviceState):
                yield item
            else:
                yield Moved(clock(), item[-1].pose)


async def _reader(source: LiveSource, clock: Callable[[], float]) -> AsyncGenerator[Item, None]:
    wanted = {one.number for one in source.antennas}
    tags: dict[int, set[str]] = {}
    arrivals = open_reader(source.reader, silent_after_s=source.silent_after_s, clock=clock)
    async with contextlib.aclosing(arrivals) as items:
        async for at, item in items:
            if isinstance(item, DeviceState):
                tags.clear()
                yield item
                continue
            for one in item:
                if isinstance(one, RoundEnd):
                    found = tags.pop(one.antenna, set())
                    if one.antenna in wanted:
                        yield Round(_unix(at), one.antenna, frozenset(found))
                else:
                    tags.setdefault(one.read.antenna, set()).add(one.read.tag)


def _unix(at: datetime) -> float:
    return at.timestamp()
