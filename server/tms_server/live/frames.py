"""Frames of log records, and errors."""

from __future__ import annotations

from tms_schemas.live import ErrorFrame, EventFrame
from tms_server.db.times import from_us
from tms_server.errors import TmsError
from tms_server.log.record import Record

#: Why a connection ends, as a WebSocket close code: 4000 + the HTTP status that would say the same.
GOING_AWAY, TRY_AGAIN_LATER = 1001, 1013


def event_frame(record: Record) -> str:
    """A log record as an event frame; ``event`` is the observation without its envelope, with its ``type``."""
    event = record.content.model_dump(mode="json", exclude={"seq", "observed_at"}, exclude_unset=True, by_alias=True)
    return EventFrame(
        room=record.room,
        cursor=record.offset,
        agent=record.agent,
        seq=record.seq,
        observed_at=from_us(record.observed_at),
        received_at=from_us(record.received_at),
        event={"type": record.kind, **event},
    ).model_dump_json()


def error_frame(error: TmsError) -> str:
    return ErrorFrame(status=error.status, detail=error.detail).model_dump_json()


def close_code(error: TmsError) -> int:
    """4401, 4403, 4404, 4422 for what trying again does not cure; 1013 for what may pass."""
    return TRY_AGAIN_LATER if error.retry_after_s is not None or error.status >= 500 else 4000 + error.status
