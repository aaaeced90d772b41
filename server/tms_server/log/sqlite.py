"""Appends to SQLite: a connection and a thread of its own, one thread hop per transaction."""

from __future__ import annotations

import asyncio
import json
import sqlite3
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from itertools import chain

from tms_server.log import store
from tms_server.log.plan import AgentFacts, Known, Plan
from tms_server.log.record import Batch, Record

#: Seconds that an append waits for the write lock of another connection.
_PATIENCE_S = 10.0


class SqliteStore:
    """``path`` is the database file; the schema is there already."""

    def __init__(self, path: str) -> None:
        self._path = path
        self._thread = ThreadPoolExecutor(max_workers=1, thread_name_prefix="log-append")
        self._connection: sqlite3.Connection | None = None

    async def append(self, batches: Sequence[Batch], decide: Callable[[Known], Plan], *, newest: bool) -> Plan:
        loop = asyncio.get_running_loop()
        return await loop.run_in_executor(self._thread, self._append, batches, decide, newest)

    async def close(self) -> None:
        await asyncio.get_running_loop().run_in_executor(self._thread, self._disconnect)
        self._thread.shutdown()

    def _append(self, batches: Sequence[Batch], decide: Callable[[Known], Plan], newest: bool) -> Plan:
        connection = self._connection = self._connection or self._connect()
        try:
            connection.execute("begin immediate")
            plan = decide(_read(connection, batches, newest))
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


def _read(connection: sqlite3.Connection, batches: Sequence[Batch], newest: bool) -> Known:
    wanted = store.Wanted.by(batches)

    def rows(select: str, *values: object) -> list[tuple[object, ...]]:
        return connection.execute(select, values).fetchall()

    heads = rows("select room, head from rooms where room in (select value from json_each(?))", _list(wanted.rooms))
    facts = rows(
        f"select {store.AGENT_COLUMNS} from agents where agent in (select value from json_each(?))",
        _list(wanted.agents),
    )
    agents = {str(row[0]): AgentFacts(*row) for row in facts}  # type: ignore[arg-type]
    stored: dict[tuple[str, int], tuple[str, str]] = {}
    for agent, seqs in store.repeated(batches, {a.agent: a.next_seq for a in agents.values()}).items():
        select = "select seq, room, body from log where agent = ? and seq in (select value from json_each(?))"
        stored.update({(agent, s): (r, b) for s, r, b in rows(select, agent, _list(seqs))})  # type: ignore[misc]
    select = "select room, tag from objects where tag in (select value from json_each(?))"
    registered = rows(select, _list(wanted.tags)) if wanted.tags else []
    known = Known(dict(heads), {}, agents, stored, set(registered))  # type: ignore[arg-type]
    if newest:
        select = "select room, max(observed_at) from log where room = ? having count(*)"
        known.newest = dict(row for room in wanted.rooms for row in rows(select, room))  # type: ignore[misc]
    return known


def _write(connection: sqlite3.Connection, plan: Plan) -> None:
    many = connection.executemany
    _insert(connection, plan.records)
    many("update rooms set head = ? where room = ?", [(head, room) for room, head in plan.heads.items()])
    many(
        f"insert into agents ({store.AGENT_COLUMNS}) values (?, ?, ?, ?, ?, ?, ?, ?, ?) {store.ON_AGENT_CONFLICT}",
        list(plan.agents.values()),
    )
    many(
        f"insert into unknown_tags as u ({store.UNKNOWN_COLUMNS}) values (?, ?, ?, ?, ?, ?, ?, ?, ?)"
        + store.ON_UNKNOWN_CONFLICT,
        list(plan.unknown.values()),
    )


def _insert(connection: sqlite3.Connection, records: Sequence[Record]) -> None:
    """Many rows per statement: the driver gives the interpreter's lock away and fetches it back once for each step.

    With one row per step every row would wait for whatever the event loop is doing.
    """
    at = 0
    for size in (64, 16, 4, 1):
        row = "(" + ", ".join("?" * len(Record._fields)) + ")"
        statement = f"insert into log ({store.LOG_COLUMNS}) values {', '.join([row] * size)}"
        while len(records) - at >= size:
            connection.execute(statement, list(chain.from_iterable(records[at : at + size])))
            at += size


def _list(values: Sequence[object]) -> str:
    return json.dumps(values)
