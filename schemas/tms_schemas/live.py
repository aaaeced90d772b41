"""Frames of ``WS /v1/live``.

The client connects with query parameters or sends one ``Subscribe`` message. The first frame is a ``SnapshotFrame``;
when resuming with a cursor that the log holds, the events since then come before it. Every frame carries ``cursor``,
the room log offset: *event* frames are lossless by cursor across reconnects, *state* frames are latest-wins.
"""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import Field

from tms_schemas.base import Model, Probability, RoomId, Tag, UtcTime
from tms_schemas.belief import LabelView, MoverView, ObjectPlacement


class Subscribe(Model):
    """What a viewer wants. Empty lists mean everything."""

    type: Literal["subscribe"] = "subscribe"
    room: RoomId
    objects: list[Tag] = []
    events: list[str] = []
    #: Send an object's state only when some p moved by at least this much since the last frame.
    min_change: Probability = 0.0
    #: Resume after this log offset instead of starting with a snapshot.
    cursor: Annotated[int, Field(ge=0)] | None = None
    #: False leaves out event frames (a page needs only states).
    with_events: bool = True


class SnapshotFrame(Model):
    """The whole room; always the first frame of a fresh subscription."""

    type: Literal["snapshot"] = "snapshot"
    room: RoomId
    cursor: int
    at: UtcTime | None
    objects: list[ObjectPlacement]
    labels: list[LabelView]
    movers: list[MoverView]


class StateFrame(Model):
    """What changed since the viewer's last frame, coalesced: latest wins."""

    type: Literal["state"] = "state"
    room: RoomId
    cursor: int
    at: UtcTime | None
    objects: list[ObjectPlacement] = []
    objects_gone: list[str] = []
    labels: list[LabelView] = []
    labels_gone: list[str] = []
    movers: list[MoverView] = []
    movers_gone: list[str] = []


class EventFrame(Model):
    """One log record, in log order."""

    type: Literal["event"] = "event"
    room: RoomId
    cursor: int
    agent: str
    seq: int
    observed_at: UtcTime
    received_at: UtcTime
    event: dict[str, Any]


class ErrorFrame(Model):
    type: Literal["error"] = "error"
    status: int
    detail: str


Frame = Annotated[SnapshotFrame | StateFrame | EventFrame | ErrorFrame, Field(discriminator="type")]
