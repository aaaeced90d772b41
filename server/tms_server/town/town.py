"""All rooms of one server: their log, the writer in front of it, an actor per room."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from datetime import datetime

from sqlalchemy.ext.asyncio import AsyncEngine

from tms_server.clock import Clock
from tms_server.db.session import Sessions
from tms_server.db.times import to_us
from tms_server.errors import NotFound
from tms_server.ingest.writer import GroupWriter
from tms_server.log.record import Record
from tms_server.log.seam import RoomLog, Snapshots
from tms_server.log.snapshots import SqlSnapshots
from tms_server.log.sql import SqlRoomLog
from tms_server.settings import Settings
from tms_server.town.actor import Frozen, RoomActor
from tms_server.town.views import RoomView


class Town:
    """See the package for what it offers. ``writer`` is the door for observations."""

    def __init__(self, log: RoomLog, snapshots: Snapshots, settings: Settings, clock: Clock) -> None:
        self._log, self._snapshots, self._settings, self._clock = log, snapshots, settings, clock
        self._actors: dict[str, RoomActor] = {}
        self._tasks: dict[str, asyncio.Task[None]] = {}
        self._writing: asyncio.Task[None] | None = None
        self.writer = GroupWriter(log, settings, self.backlog)

    async def belief(self, room: str, at: datetime | None = None, known_at: datetime | None = None) -> RoomView:
        """The room at ``at`` (time of observation), as known at ``known_at`` (time of receipt); None is the newest.

        Knows every record that was committed before the call.

        Raises:
            NotFound: no such room.
            Unavailable: the fold is too far behind the log.
        """
        head = await self._log.head(room)
        if head is None:
            raise NotFound(f"there is no room {room!r}")
        actor = self._actor(room)
        if known_at is not None:
            head = min(head, await self._log.head_at(room, to_us(known_at)))
            frozen = Frozen(await actor.past(at, head), head, {})
        else:
            if actor.head < head:
                self._log.poke(room)
            await actor.reach(head)
            frozen = await actor.now()
            if at is not None and to_us(at) < frozen.fold.position.observed_at:
                frozen = Frozen(await actor.past(at, frozen.cursor), frozen.cursor, {})
        return RoomView(
            room=room,
            frozen=frozen,
            asked=at,
            now=self._clock.now(),
            silent_after_s=self._settings.silent_after_s,
            patience_s=self._settings.patience_s,
        )

    @asynccontextmanager
    async def subscribe(self, room: str) -> AsyncIterator[AsyncIterator[int]]:
        """The newest folded offset of ``room``, at once and after every change; latest wins. NotFound as ``belief``."""
        if await self._log.head(room) is None:
            raise NotFound(f"there is no room {room!r}")
        yield self._actor(room).changes()

    async def records(self, room: str, after: int, limit: int) -> list[Record]:
        """Log records after an offset, in order of offset."""
        return await self._log.read(room, after, limit)

    def poke(self, room: str) -> None:
        """The log of ``room`` has new records."""
        self._actor(room)
        self._log.poke(room)

    def backlog(self, room: str) -> int:
        """Records of ``room`` that are durable but not folded yet, as far as this process knows."""
        actor = self._actors.get(room)
        return 0 if actor is None else max(0, self._log.committed(room) - actor.head)

    async def start(self) -> None:
        self._writing = asyncio.create_task(self.writer.run())
        for room in await self._log.heads():
            self._actor(room)

    async def close(self) -> None:
        """Everything admitted becomes durable, what was folded becomes a snapshot."""
        self.writer.close()
        if self._writing is not None:
            await self._writing
        for task in self._tasks.values():
            task.cancel()
        await asyncio.gather(*self._tasks.values(), return_exceptions=True)
        for actor in self._actors.values():
            await actor.close()

    def _actor(self, room: str) -> RoomActor:
        if room not in self._actors:
            actor = RoomActor(room, self._log, self._snapshots, self._settings, self._clock)
            self._actors[room] = actor
            self._tasks[room] = asyncio.create_task(actor.run())
        return self._actors[room]


@asynccontextmanager
async def open_town(engine: AsyncEngine, sessions: Sessions, settings: Settings, clock: Clock) -> AsyncIterator[Town]:
    """The town over one database, for as long as the context lasts."""
    log = SqlRoomLog(engine, clock, retention_s=settings.retention_s)
    town = Town(log, SqlSnapshots(engine, clock), settings, clock)
    try:
        await town.start()
        yield town
    finally:
        await town.close()
        await log.close()
