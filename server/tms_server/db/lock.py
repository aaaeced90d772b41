"""One server process owns a database: a file lock beside SQLite, an advisory lock in PostgreSQL."""

from __future__ import annotations

import fcntl
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path

from sqlalchemy import text
from sqlalchemy.engine import make_url
from sqlalchemy.ext.asyncio import AsyncEngine

from tms_server.db.engine import is_sqlite

#: Any constant will do; it must only be the same in every server.
_ADVISORY_KEY = 0x746D73  # "tms"


class DatabaseOwned(RuntimeError):
    """Another server process owns this database."""


@asynccontextmanager
async def own_database(engine: AsyncEngine) -> AsyncIterator[None]:
    """Hold the database exclusively for as long as the context lasts.

    Raises:
        DatabaseOwned: another process holds it.
    """
    if is_sqlite(engine):
        with _file_lock(Path(str(make_url(engine.url).database) + ".lock")):
            yield
        return
    async with engine.connect() as connection:
        connection = await connection.execution_options(isolation_level="AUTOCOMMIT")
        if not await connection.scalar(text("select pg_try_advisory_lock(:key)"), {"key": _ADVISORY_KEY}):
            raise DatabaseOwned("another tms server owns this PostgreSQL database")
        try:
            yield
        finally:
            await connection.scalar(text("select pg_advisory_unlock(:key)"), {"key": _ADVISORY_KEY})


class _file_lock:
    """The kernel drops it with the process, however that dies."""

    def __init__(self, path: Path) -> None:
        self._path = path

    def __enter__(self) -> None:
        self._file = self._path.open("w")
        try:
            fcntl.flock(self._file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            self._file.close()
            raise DatabaseOwned(f"another tms server owns {self._path.with_suffix('')}") from None

    def __exit__(self, *_: object) -> None:
        self._file.close()
