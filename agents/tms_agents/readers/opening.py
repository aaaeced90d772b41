"""Open any tag reader: what it reads and how it is, with the time of each."""

from __future__ import annotations

import contextlib
import time
from collections.abc import AsyncGenerator, Callable, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime

from tms_agents.devices.llrp.session import LlrpSession
from tms_agents.devices.tags import Field, RoundEnd, TagItem, TagRead
from tms_agents.devices.text_reader import TextReaderSession
from tms_agents.devices.thingmagic.session import ThingMagicSession
from tms_agents.devices.tr3.session import Tr3Session
from tms_agents.devices.transport import DeviceState, Link, serial, tcp
from tms_agents.readers.capture import groups
from tms_agents.readers.config import (
    CaptureSource,
    LlrpSource,
    ReaderSource,
    TextSerialSource,
    TextTcpSource,
    ThingMagicSource,
    Tr3SerialSource,
    Tr3TcpSource,
)


@dataclass(frozen=True, slots=True)
class Seen:
    """A report with the times to use for it (UTC)."""

    read: TagRead
    first: datetime
    last: datetime


#: Time of arrival (UTC), and what arrived: reads and ends of rounds in their order, or a new state of the device.
Arrival = tuple[datetime, Sequence[Seen | RoundEnd] | DeviceState]


async def open_reader(
    source: ReaderSource,
    *,
    silent_after_s: float = 10.0,
    field: Field | None = None,
    clock: Callable[[], float] = time.time,
) -> AsyncGenerator[Arrival, None]:
    """Listen to a reader for ever, through every failure of it; a capture ends, and has the times of its recording.

    ``field`` pauses the antennas of a reader that can (see ``can_pause``). ``clock`` gives Unix time.

    Raises:
        CommandError: a capture cannot be read.
    """
    if isinstance(source, CaptureSource):
        for at, found in groups(source):
            yield at, found if isinstance(found, DeviceState) else [_seen(read, at, own_clock=True) for read in found]
        return
    own_clock = isinstance(source, LlrpSource) and source.reader_clock
    async with contextlib.aclosing(_link(source, silent_after_s, field).listen()) as items:
        async for item in items:
            at = datetime.fromtimestamp(clock(), UTC)
            if isinstance(item, DeviceState):
                yield at, item
            else:
                yield at, [one if isinstance(one, RoundEnd) else _seen(one, at, own_clock) for one in item]


def can_pause(source: ReaderSource) -> bool:
    """Whether the reader switches its field off when asked."""
    polled = isinstance(source, Tr3SerialSource | Tr3TcpSource) and source.mode == "inventory"
    return polled or isinstance(source, ThingMagicSource)


def tells_rounds(source: ReaderSource) -> bool:
    """Whether the reader tells the end of each round. One that withholds it then says that a round was no whole one."""
    if isinstance(source, LlrpSource):
        return source.round_s is not None
    if isinstance(source, ThingMagicSource):
        return source.mode == "multiple"
    return isinstance(source, Tr3SerialSource | Tr3TcpSource) and source.mode == "inventory"


_Device = LlrpSource | Tr3SerialSource | Tr3TcpSource | ThingMagicSource | TextSerialSource | TextTcpSource


def _link(source: _Device, silent_after_s: float, field: Field | None) -> Link[TagItem]:
    if isinstance(source, LlrpSource):
        return Link(
            tcp(source.host, source.port),
            lambda: LlrpSession(antennas=source.antennas, keepalive_s=source.keepalive_s, round_s=source.round_s),
            name=f"LLRP reader {source.host}:{source.port}",
            silent_after_s=max(silent_after_s, 2.5 * source.keepalive_s),
        )
    if isinstance(source, ThingMagicSource):
        return Link(
            serial(source.device, source.baud),
            lambda: ThingMagicSession(
                **source.model_dump(include={"antennas", "region", "power_dbm", "mode", "read_ms", "poll_s"}),
                field=field,
            ),
            name=f"ThingMagic {source.device}",
            silent_after_s=silent_after_s,
        )
    kind = "text reader" if isinstance(source, TextSerialSource | TextTcpSource) else "TR3"
    if isinstance(source, Tr3SerialSource | TextSerialSource):
        opener, name = serial(source.device, source.baud), f"{kind} {source.device}"
    else:
        opener, name = tcp(source.host, source.port), f"{kind} {source.host}:{source.port}"
    if isinstance(source, TextSerialSource | TextTcpSource):
        return Link(opener, lambda: TextReaderSession(form=source.form, order=source.order), name=name)
    return Link(
        opener,
        lambda: Tr3Session(
            antennas=source.antennas,
            mode=source.mode,
            poll_s=source.poll_s,
            rf_off_between_rounds=source.rf_off_between_rounds,
            rest_antenna=source.rest_antenna,
            field=field,
        ),
        name=name,
        silent_after_s=silent_after_s,
    )


def _seen(read: TagRead, at: datetime, own_clock: bool) -> Seen:
    first = read.first_seen or read.last_seen
    if own_clock and first is not None:
        return Seen(read, first, max(read.last_seen or first, first))
    return Seen(read, at, at)
