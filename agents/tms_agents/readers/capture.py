"""Recorded bytes of a reader: tag reads with the times they carry, or evenly spaced where they carry none."""

from __future__ import annotations

from collections.abc import Iterator
from datetime import UTC, datetime, timedelta
from pathlib import Path

from tms_agents.devices.llrp import messages
from tms_agents.devices.llrp.codec import FrameParser as LlrpParser
from tms_agents.devices.llrp.codec import Message
from tms_agents.devices.tags import TagRead
from tms_agents.devices.tr3.codec import FrameParser as Tr3Parser
from tms_agents.devices.transport import DeviceState
from tms_agents.readers.config import CaptureSource
from tms_client.cli import CommandError

_PIECE = 1 << 16


def groups(source: CaptureSource) -> Iterator[tuple[datetime, list[TagRead] | DeviceState]]:
    """Reads in the groups they were reported in, after the state ``connected``; ``faulty`` where no frame is found.

    Raises:
        CommandError: the file cannot be read.
    """
    try:
        written = datetime.fromtimestamp(source.path.stat().st_mtime, UTC)
    except OSError as error:
        raise CommandError(f"capture {source.path}: {error.strerror}") from error
    found = _llrp_groups(source.path) if source.format == "llrp" else _tr3_groups(source.path)
    at = (source.start or written).astimezone(UTC)
    step = timedelta(seconds=source.frame_s)
    connected = False
    for stamp, reads in found:
        if stamp is not None:
            at = max(at, stamp) if connected else stamp
        if not connected:
            connected = True
            yield at, DeviceState("connected", f"capture {source.path.name}")
        if reads:
            yield at, reads
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
