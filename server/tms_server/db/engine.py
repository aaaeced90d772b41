"""One async engine per database URL; all that differs between SQLite and PostgreSQL connections is here."""

from __future__ import annotations

import sqlite3
from typing import Any

from sqlalchemy import Connection, event
from sqlalchemy.engine import make_url
from sqlalchemy.ext.asyncio import AsyncEngine, create_async_engine

#: Execution option of transactions that will write (SQLite takes its write lock at once instead of failing to upgrade).
WRITE = "tms_write"


def create_engine(url: str) -> AsyncEngine:
    """An engine for ``url`` (drivers aiosqlite or asyncpg).

    Raises:
        ValueError: the URL names another database.
    """
    backend = make_url(url).get_backend_name()
    if backend == "sqlite":
        return _sqlite(url)
    if backend == "postgresql":
        # READ COMMITTED: an append waits for the room's head row and then must see the newest head.
        return create_async_engine(
            url,
            isolation_level="READ COMMITTED",
            pool_pre_ping=True,
            pool_use_lifo=True,
            pool_size=10,
            max_overflow=10,
        )
    raise ValueError(f"database {backend!r} is not supported; use SQLite or PostgreSQL")


def is_sqlite(engine: AsyncEngine) -> bool:
    return engine.dialect.name == "sqlite"


def _sqlite(url: str) -> AsyncEngine:
    engine = create_async_engine(url, connect_args={"timeout": 60.0}, pool_size=10, max_overflow=10)

    @event.listens_for(engine.sync_engine, "connect")
    def configure(dbapi: Any, _record: Any) -> None:
        dbapi.isolation_level = None  # the driver must not begin transactions by itself
        cursor: sqlite3.Cursor = dbapi.cursor()
        for pragma in ("journal_mode=WAL", "synchronous=FULL", "foreign_keys=ON", "busy_timeout=60000"):
            cursor.execute(f"PRAGMA {pragma}")
        cursor.close()

    @event.listens_for(engine.sync_engine, "begin")
    def begin(connection: Connection) -> None:
        write = connection.get_execution_options().get(WRITE)
        connection.exec_driver_sql("BEGIN IMMEDIATE" if write else "BEGIN")

    return engine
