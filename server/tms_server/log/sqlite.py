"""Appends to SQLite: a connection and a thread of its own, one thread hop per transaction."""

from __future__ import annotations

import asyncio
import json
import sqlite3
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor

from tms_server.log import store
from tms_server.log.blocks import MOST_RECORDS
from tms_server.log.bodies import Content
from tms_server.log.plan import AgentFacts, Known, Plan, RoomFacts
from tms_server.log.record import Batch

#: Seconds that an append waits for the write lock of another connection.
_PATIENCE_S = 10.0


class SqliteStore:
    """``path`` is the database file; the schema is there already."""

    def __init__(self, path: str) -> None:
        self._path = path
        self._thread = ThreadPoolExecutor(max_workers=1, thread_name_prefix="log-append")
        self._connection: sqlite3.Connection | None = None

    async def append(self, batches: Sequence[Batch], decide: Callable[[Known], Plan]) -> Plan:
        loop = asyncio.get_running_loop()
        return await loop.run_in_executor(self._thread, self._append, batches, decide)

    async def close(self) -> None:
        await asyncio.get_running_loop().run_in_executor(self._thread, self._disconnect)
        self._thread.shutdown()

    def _append(self, batches: Sequence[Batch], decide: Callable[[Known], Plan]) -> Plan:
        connection = self._connection = self._connection or self._connect()
        try:
            connection.execute("begin immediate")
            plan = decide(_read(connection, batches))
            _write(connection, plan)
            connection.execute("commit")
            return plan
        except BaseException:
            self._disconnect()  # closing rolls back
            raise

    def _connect(self) -> sqlite3.Connection:
        connection = sqlite3.connect(self._path, isolation_level=None, timeout=_PATIENCE_S)
        # FULL: a commit in the write-ahead log is on the disk when it returns. Pages that every commit touches (the
        # ends of the indexes) are copied back once per checkpoint, so checkpoints are rarer than usual: every 32 MB.
        for pragma in ("journal_mode=WAL", "synchronous=FULL", "foreign_keys=ON", "wal_autocheckpoint=8000"):
            connection.execute(f"pragma {pragma}")
        return connection

    def _disconnect(self) -> None:
        connection, self._connection = self._connection, None
        if connection is not None:
            connection.close()


def _read(connection: sqlite3.Connection, batches: Sequence[Batch]) -> Known:
    wanted = store.Wanted.by(batches)

    def rows(select: str, *values: object) -> list[tuple[object, ...]]:
        return connection.execute(select, values).fetchall()

    rooms = rows(
        f"select {store.ROOM_COLUMNS} from rooms where room in (select value from json_each(?))", _list(wanted.rooms)
    )
    facts = rows(
        f"select {store.AGENT_COLUMNS} from agents where agent in (select value from json_each(?))",
        _list(wanted.agents),
    )
    agents = {str(row[0]): AgentFacts(*row) for row in facts}  # type: ignore[arg-type]
    stored: dict[tuple[str, int], tuple[str, Content]] = {}
    for agent, seqs in store.repeated(batches, {a.agent: a.next_seq for a in agents.values()}).items():
        select = f"select {store.LOG_COLUMNS} from log where agent = ? and seq between ? and ? and seq + records > ?"
        low, high = min(seqs), max(seqs)
        stored |= store.contents(rows(select, agent, low - MOST_RECORDS + 1, high, low))
    select = "select room, tag from objects where tag in (select value from json_each(?))"
    registered = rows(select, _list(wanted.tags)) if wanted.tags else []
    known = {str(room): RoomFacts(*facts) for room, *facts in rooms}  # type: ignore[arg-type]
    return Known(known, agents, stored, set(registered))  # type: ignore[arg-type]


def _write(connection: sqlite3.Connection, plan: Plan) -> None:
    many = connection.executemany
    many(
        f"insert into log ({store.LOG_COLUMNS}) values (?, ?, ?, ?, ?, ?, ?, ?, ?, ?)",
        [block for block, _ in plan.blocks],
    )
    many(
        "update rooms set head = ?, newest_at = ? where room = ?",
        [(*facts, room) for room, facts in plan.rooms.items()],
    )
    many(
        f"insert into agents ({store.AGENT_COLUMNS}) values (?, ?, ?, ?, ?, ?, ?, ?, ?) {store.ON_AGENT_CONFLICT}",
        list(plan.agents.values()),
    )
    many(
        f"insert into unknown_tags as u ({store.UNKNOWN_COLUMNS}) values (?, ?, ?, ?, ?, ?, ?, ?, ?)"
        + store.ON_UNKNOWN_CONFLICT,
        list(plan.unknown.values()),
    )


def _list(values: Sequence[object]) -> str:
    return json.dumps(values)
