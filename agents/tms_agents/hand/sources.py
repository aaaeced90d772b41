"""Where the reader's bytes come from: a device, or a file with a recording."""

from __future__ import annotations

from collections.abc import AsyncGenerator, Callable, Iterator, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from pathlib import Path

from tms_agents.devices.llrp import messages
from tms_agents.devices.llrp.codec import FrameParser as LlrpParser
from tms_agents.devices.llrp.codec import Message
from tms_agents.devices.llrp.session import LlrpSession
from tms_agents.devices.tags import TagRead
from tms_agents.devices.tr3.codec import FrameParser as Tr3Parser
from tms_agents.devices.tr3.session import Tr3Session
from tms_agents.devices.transport import DeviceState, Link, serial, tcp
from tms_agents.hand.config import CaptureSource, HandConfig, LlrpSource, Tr3SerialSource
from tms_client.cli import CommandError

_PIECE = 1 << 16


@dataclass(frozen=True, slots=True)
class Seen:
    """A report with the times to use for it (UTC)."""

    read: TagRead
    first: datetime
    last: datetime


Arrival = tuple[datetime, Sequence[Seen] | DeviceState]


async def arrivals(config: HandConfig, clock: Callable[[], float]) -> AsyncGenerator[Arrival, None]:
    """Reports in groups, and states of the device, with the time of arrival. Ends only where a capture does.

    ``clock`` gives Unix time.
    """
    source = config.source
    if isinstance(source, CaptureSource):
        for arrival in _capture(source):
            yield arrival
        return
    own_clock = isinstance(source, LlrpSource) and source.reader_clock
    async for item in _link(config).listen():
        at = datetime.fromtimestamp(clock(), UTC)
        if isinstance(item, DeviceState):
            yield at, item
        else:
            yield at, [_seen(read, at, own_clock) for read in item]


def _link(config: HandConfig) -> Link[TagRead]:
    source, quiet = config.source, config.silent_after_s
    if isinstance(source, LlrpSource):
        return Link(
            tcp(source.host, source.port),
            lambda: LlrpSession(antennas=source.antennas, keepalive_s=source.keepalive_s),
            name=f"LLRP reader {source.host}:{source.port}",
            silent_after_s=max(quiet, 2.5 * source.keepalive_s),
        )
    assert not isinstance(source, CaptureSource)
    if isinstance(source, Tr3SerialSource):
        opener, name = serial(source.device, source.baud), f"TR3 {source.device}"
    else:
        opener, name = tcp(source.host, source.port), f"TR3 {source.host}:{source.port}"
    return Link(
        opener,
        lambda: Tr3Session(antennas=source.antennas, mode=source.mode, poll_s=source.poll_s),
        name=name,
        silent_after_s=quiet,
        tick_s=min(0.05, source.poll_s / 2),
    )


def _seen(read: TagRead, at: datetime, own_clock: bool) -> Seen:
    first = read.first_seen or read.last_seen
    if own_clock and first is not None:
        return Seen(read, first, max(read.last_seen or first, first))
    return Seen(read, at, at)


def _capture(source: CaptureSource) -> Iterator[Arrival]:
    try:
        written = datetime.fromtimestamp(source.path.stat().st_mtime, UTC)
    except OSError as error:
        raise CommandError(f"capture {source.path}: {error.strerror}") from error
    groups = _llrp_groups(source.path) if source.format == "llrp" else _tr3_groups(source.path)
    at = (source.start or written).astimezone(UTC)
    step = timedelta(seconds=source.frame_s)
    connected = False
    for stamp, reads in groups:
        if stamp is not None:
            at = max(at, stamp) if connected else stamp
        if not connected:
            connected = True
            yield at, DeviceState("connected", f"capture {source.path.name}")
        if reads:
            yield at, [_seen(read, at, own_clock=True) for read in reads]
        at += timedelta() if stamp else step
    if not connected:
        yield at, DeviceState("faulty", f"capture {source.path.name} holds no {source.format} frame")


def _llrp_groups(path: Path) -> Iterator[tuple[datetime | None, list[TagRead]]]:
    """Per message that has a time: that time and its tag reports."""
    parser = LlrpParser()
    for piece in _pieces(path):
        for message in parser.feed(piece):
            reads = messages.tag_reads(message)
            times = [time for read in reads if (time := read.last_seen or read.first_seen)]
            yield (max(times) if times else _stamp(message)), reads


def _stamp(message: Message) -> datetime | None:
    event = message.find("ReaderEventNotificationData")
    return messages.time_of(event, "UTCTimestamp") if event is not None else None


def _tr3_groups(path: Path) -> Iterator[tuple[datetime | None, list[TagRead]]]:
    parser = Tr3Parser()
    for piece in _pieces(path):
        for frame in parser.feed(piece):
            uid = frame.uid()
            yield None, [TagRead(tag=uid)] if uid else []


def _pieces(path: Path) -> Iterator[bytes]:
    try:
        with path.open("rb") as file:
            while piece := file.read(_PIECE):
                yield piece
    except OSError as error:
        raise CommandError(f"capture {path}: {error.strerror}") from error
