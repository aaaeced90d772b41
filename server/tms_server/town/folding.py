"""What the parts of a fold may do with it: `inventory`, `registry`, `reports` and `sight` are given one."""

from __future__ import annotations

from typing import Protocol

from tms_schemas import events
from tms_server.log.record import Record
from tms_server.placement import Engine
from tms_server.town.state import RoomState


class Folding(Protocol):
    """A fold in the middle of a record; `RoomFold` is one."""

    state: RoomState
    engine: Engine

    @property
    def record(self) -> Record:
        """The record being folded."""

    def fold(self, event: events.Event, *, p_jump: float | None = None) -> None:
        """One event of the vocabulary."""

    def note(self, kind: str, detail: str) -> None:
        """An anomaly of the record being folded."""

    def read(self, tag: str, label: str | None) -> None:
        """The record read the tag of an object."""
