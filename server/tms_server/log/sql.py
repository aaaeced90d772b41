"""The room log in SQL, SQLite or PostgreSQL."""

from __future__ import annotations

import asyncio
from collections import Counter, defaultdict
from collections.abc import AsyncIterator, Iterable, Sequence
from functools import partial
from typing import Any

from sqlalchemy import func, select, tuple_
from sqlalchemy.engine import make_url
from sqlalchemy.ext.asyncio import AsyncEngine

from tms_server.clock import Clock
from tms_server.db.engine import is_sqlite
from tms_server.db.tables import LogRow, RoomRow
from tms_server.db.times import to_us
from tms_server.errors import Unavailable
from tms_server.log.plan import decide
from tms_server.log.postgres import PostgresStore
from tms_server.log.record import Batch, Position, Record, Verdict
from tms_server.log.snapshots import sql_position
from tms_server.log.sqlite import SqliteStore
from tms_server.log.store import Store
from tms_server.log.tail import Tail

#: Records read at a time.
PAGE = 1000
#: Seconds after which a follower looks by itself, should nobody have told it.
_LOOK_AGAIN_S = 1.0
_COLUMNS = (
    LogRow.room,
    LogRow.offset,
    LogRow.agent,
    LogRow.seq,
    LogRow.observed_at,
    LogRow.received_at,
    LogRow.kind,
    LogRow.body,
    LogRow.late,
)


class SqlRoomLog:
    """``RoomLog`` over one database. ``retention_s``: see ``decide``; None keeps everything in the belief."""

    def __init__(self, engine: AsyncEngine, clock: Clock, *, retention_s: float | None) -> None:
        self._engine = engine
        self._clock = clock
        self._retention_us = None if retention_s is None else round(retention_s * 1e6)
        self._store: Store = (
            SqliteStore(str(make_url(engine.url).database)) if is_sqlite(engine) else PostgresStore(engine)
        )
        self._tail = Tail()
        self._committed: dict[str, int] = {}
        #: How often somebody said that records came by another way than ``append``.
        self._outside: Counter[str] = Counter()
        self._news: defaultdict[str, asyncio.Event] = defaultdict(asyncio.Event)

    async def append(self, batches: Sequence[Batch]) -> list[Verdict]:
        choose = partial(decide, batches, now=to_us(self._clock.now()), retention_us=self._retention_us)
        try:
            plan = await self._store.append(batches, choose, newest=self._retention_us is not None)
        except Exception as error:
            raise Unavailable(f"the log cannot be written: {type(error).__name__}", retry_after_s=2) from error
        self._committed.update(plan.heads)
        self._tail.add(plan.records)
        for room in plan.heads:
            self._wake(room)
        return plan.verdicts

    async def follow(self, room: str, after: int) -> AsyncIterator[list[Record]]:
        looked: int | None = None
        while True:
            # Both are taken before looking: what comes meanwhile is news.
            news, outside = self._news[room], self._outside[room]
            page = self._tail.after(room, after, PAGE)
            if not page and (looked != outside or self._committed.get(room, 0) > after):
                page = await self.read(room, after, PAGE)
                looked = None if page else outside
            if page:
                after = page[-1].offset
                yield page
                continue
            try:
                async with asyncio.timeout(_LOOK_AGAIN_S):
                    await news.wait()
            except TimeoutError:
                looked = None

    async def read(self, room: str, after: int, limit: int) -> list[Record]:
        query = select(*_COLUMNS).where(LogRow.room == room, LogRow.offset > after).order_by(LogRow.offset)
        async with self._engine.connect() as connection:
            return _records((await connection.execute(query.limit(limit))).all())

    async def replay(
        self, room: str, *, after: Position, until: Position | None, head: int
    ) -> AsyncIterator[list[Record]]:
        place = tuple_(LogRow.observed_at, LogRow.agent, LogRow.seq)
        query = (
            select(*_COLUMNS)
            .where(LogRow.room == room, LogRow.offset <= head, LogRow.late.is_(False))
            .order_by(LogRow.observed_at, LogRow.agent, LogRow.seq)
            .limit(PAGE)
        )
        if until is not None:
            query = query.where(place <= sql_position(until))
        while True:
            async with self._engine.connect() as connection:
                page = _records((await connection.execute(query.where(place > sql_position(after)))).all())
            if page:
                yield page
            if len(page) < PAGE:
                return
            after = page[-1].position

    async def heads(self) -> dict[str, int]:
        async with self._engine.connect() as connection:
            rows = await connection.execute(select(RoomRow.room, RoomRow.head))
            return {row.room: row.head for row in rows}

    async def head(self, room: str) -> int | None:
        async with self._engine.connect() as connection:
            return await connection.scalar(select(RoomRow.head).where(RoomRow.room == room))

    async def head_at(self, room: str, received_at: int) -> int:
        query = select(func.max(LogRow.offset)).where(LogRow.room == room, LogRow.received_at <= received_at)
        async with self._engine.connect() as connection:
            return await connection.scalar(query) or 0

    def committed(self, room: str) -> int:
        return self._committed.get(room, 0)

    def poke(self, room: str) -> None:
        self._outside[room] += 1
        self._wake(room)

    def _wake(self, room: str) -> None:
        # Whoever waits holds this event; the next to wait gets a fresh one, so no news falls between.
        self._news.pop(room, asyncio.Event()).set()

    async def close(self) -> None:
        await self._store.close()


def _records(rows: Iterable[Sequence[Any]]) -> list[Record]:
    return [Record._make(row) for row in rows]
