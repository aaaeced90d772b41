"""A recording as its devices told it: records in their order, as fast as they came or faster."""

from __future__ import annotations

import asyncio
import json
import math
import time
from collections.abc import AsyncGenerator, Callable
from typing import Any

from tms_agents.devices.transport import DeviceState
from tms_agents.robot.config import LogSource
from tms_agents.robot.records import Moved, Record, Round, Scanned
from tms_agents.slam.logs import lines_of_file
from tms_agents.slam.logs_recording import scan_of

#: Nobody waits longer for a robot that is parked (s).
_LONGEST_PAUSE_S = 2.0


async def replayed(
    source: LogSource, even: Callable[[], float] = time.monotonic
) -> AsyncGenerator[tuple[str, Record | DeviceState], None]:
    """Records of ``source``; lines that cannot be read are left out. Pauses are cut short.

    Raises:
        OSError: the file cannot be read.
    """
    yield "log", DeviceState("connected", source.path.name)
    ahead, before = 0.0, None
    began = even()
    for number, line in enumerate(lines_of_file(source.path)):
        record = record_of(line)
        if record is None:
            continue
        t = time_of(record)
        if before is not None:
            ahead += min(max(t - before, 0.0), _LONGEST_PAUSE_S)
        before = t if before is None else max(t, before)
        wait_s = began + ahead / source.speed - even() if source.speed > 0 else 0.0
        if wait_s > 0.002 or number % 100 == 0:
            await asyncio.sleep(max(wait_s, 0.0))
        yield "log", record


def record_of(line: str) -> Record | None:
    """None for a line that is no record of a robot."""
    try:
        fields = json.loads(line)
        kind = fields["type"]
        if kind == "odom":
            return Moved(_number(fields["t"]), (_number(fields["x"]), _number(fields["y"]), _number(fields["theta"])))
        if kind == "scan":
            return Scanned(scan_of(fields))
        if kind == "rfid":
            tags = frozenset(str(one["id"]).upper() for one in fields["tags"])
            return Round(_number(fields["t"]), int(fields["antenna"]), tags)
    except (ValueError, KeyError, TypeError, RecursionError, OverflowError):
        pass
    return None


def time_of(record: Record) -> float:
    """Seconds."""
    return record.scan[0] if isinstance(record, Scanned) else record.t


def _number(value: Any) -> float:
    number = float(value)
    if not math.isfinite(number):
        raise ValueError("not finite")
    return number
