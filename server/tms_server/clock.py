"""Time as a parameter: the server never reads a clock that a test or a replay cannot replace."""

from __future__ import annotations

from datetime import UTC, datetime
from typing import Protocol


class Clock(Protocol):
    def now(self) -> datetime:
        """The current time, UTC."""


class SystemClock:
    def now(self) -> datetime:
        return datetime.now(UTC)
