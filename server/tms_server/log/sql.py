"""The room log in SQL, SQLite or PostgreSQL."""

from __future__ import annotations

import asyncio
import sqlite3
from collections import Counter, defaultdict
from collections.abc import AsyncIterator, Sequence
from functools import partial
from typing import Any

from sqlalchemy import Select, func, select, tuple_
from sqlalchemy.engine import make_url
from sqlalchemy.ext.asyncio import AsyncEngine

from tms_server.clock import Clock
from tms_server.db.engine import is_sqlite
from tms_server.db.tables import LogRow, RoomRow
from tms_server.db.times import to_us
from tms_server.errors import Unavailable
from tms_server.log.blocks import MOST_RECORDS, SPAN_US, Block, Written, contents, records
from tms_server.log.merging import Merge, start
from tms_server.log.plan import decide
from tms_server.log.postgres import PostgresStore
from tms_server.log.record import ORIGIN, Batch, Position, Record, Verdict
from tms_server.log.snapshots import sql_position
from tms_server.log.sqlite import SqliteStore
from tms_server.log.store import Store
from tms_server.log.tail import Tail

#: Records that a follower gets at a time, and blocks read at a time for a replay.
PAGE, _PAGE_BLOCKS = 1000, 50
#: Seconds after which a follower looks by itself, should nobody have told it.
_LOOK_AGAIN_S = 1.0
_COLUMNS = (
    LogRow.room,
    LogRow.offset,
    LogRow.agent,
    LogRow.seq,
    LogRow.records,
    LogRow.first_at,
    LogRow.last_at,
    LogRow.received_at,
    LogRow.late,
    LogRow.body,
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
            plan = await self._store.append(batches, choose)
        except Exception as error:
            # What SQLite says is of the disk; what others say may hold rows and addresses.
            why = str(error) if isinstance(error, sqlite3.Error) else type(error).__name__
            raise Unavailable(f"the log cannot be written: {why}", retry_after_s=2) from error
        self._tail.add(plan.blocks)
        for room, facts in plan.rooms.items():
            self._committed[room] = facts.head
            self._wake(room)
        return plan.verdicts

    async def follow(self, room: str, after: int) -> AsyncIterator[list[Written]]:
        looked: int | None = None
        while True:
            # Both are taken before looking: what comes meanwhile is news.
            news, outside = self._news[room], self._outside[room]
            page = self._tail.after(room, after, PAGE)
            if not page and (looked != outside or self._committed.get(room, 0) > after):
                page = await self._written(room, after, PAGE)
                looked = None if page else outside
            if page:
                after = page[-1].block.offset
                yield page
                continue
            try:
                async with asyncio.timeout(_LOOK_AGAIN_S):
                    await news.wait()
            except TimeoutError:
                looked = None

    async def read(self, room: str, after: int, limit: int) -> list[Record]:
        found = [record for written in await self._written(room, after, limit) for record in records(*written)]
        return [record for record in found if record.offset > after]

    async def _written(self, room: str, after: int, limit: int) -> list[Written]:
        query = (
            select(*_COLUMNS)
            .where(LogRow.room == room, LogRow.offset > after, LogRow.offset <= after + limit + MOST_RECORDS)
            .where(LogRow.offset - LogRow.records < after + limit)
            .order_by(LogRow.offset)
        )
        blocks = await self._blocks(query)
        return await asyncio.to_thread(lambda: [Written(block, contents(block)) for block in blocks])

    async def replay(
        self, room: str, *, after: Position, until: Position | None, head: int
    ) -> AsyncIterator[list[Record]]:
        place = tuple_(LogRow.first_at, LogRow.agent, LogRow.seq)
        earliest = max(after.observed_at - SPAN_US, ORIGIN.observed_at)
        query = (
            select(*_COLUMNS)
            .where(LogRow.room == room, LogRow.offset - LogRow.records < head, LogRow.late.is_(False))
            .where(LogRow.first_at >= earliest, LogRow.last_at >= after.observed_at)
            .order_by(LogRow.first_at, LogRow.agent, LogRow.seq)
            .limit(_PAGE_BLOCKS)
        )
        if until is not None:
            query = query.where(place <= sql_position(until))
        merge, rest = Merge(after=after, until=until, head=head), query
        while True:
            blocks = await self._blocks(rest)
            more = len(blocks) == _PAGE_BLOCKS
            if page := await asyncio.to_thread(merge.take, blocks, more=more):
                yield page
            if not more:
                return
            rest = query.where(place > sql_position(start(blocks[-1])))

    async def _blocks(self, query: Select[*tuple[Any, ...]]) -> list[Block]:
        async with self._engine.connect() as connection:
            return [Block._make(row) for row in await connection.execute(query)]

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
