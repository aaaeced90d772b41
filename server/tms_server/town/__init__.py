"""Room actors: fold(log) -> belief, snapshots, queries."""

from __future__ import annotations

from collections.abc import AsyncIterator
from contextlib import asynccontextmanager

from sqlalchemy.ext.asyncio import AsyncEngine

from tms_server.clock import Clock
from tms_server.db.session import Sessions
from tms_server.settings import Settings


class Town:
    """All rooms of one server."""


@asynccontextmanager
async def open_town(engine: AsyncEngine, sessions: Sessions, settings: Settings, clock: Clock) -> AsyncIterator[Town]:
    yield Town()
