"""Migrations on both databases, as they run from the installed package."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import AsyncIterator, Callable
from pathlib import Path
from typing import Any, TypeVar

import pytest
from alembic import command
from alembic.autogenerate import compare_metadata
from alembic.migration import MigrationContext
from alembic.script import ScriptDirectory
from sqlalchemy import Connection, inspect, text
from sqlalchemy.ext.asyncio import AsyncEngine

from tms_schemas.observation import MoverLeft
from tms_server.clock import SystemClock
from tms_server.db.engine import WRITE, create_engine
from tms_server.db.migrate import alembic_config, is_current, migrate
from tms_server.db.tables import Base
from tms_server.log.bodies import ObjectRemoved
from tms_server.log.record import Record
from tms_server.log.sql import SqlRoomLog

T = TypeVar("T")


@pytest.fixture
async def engine(database_url: str) -> AsyncIterator[AsyncEngine]:
    engine = create_engine(database_url)
    yield engine
    await engine.dispose()


async def within(engine: AsyncEngine, ask: Callable[[Connection], T]) -> T:
    async with engine.execution_options(**{WRITE: True}).begin() as connection:
        return await connection.run_sync(ask)


def downgrade(revision: str) -> Callable[[Connection], None]:
    def run(connection: Connection) -> None:
        config = alembic_config()
        config.attributes["connection"] = connection
        command.downgrade(config, revision)

    return run


def tables(connection: Connection) -> set[str]:
    return set(inspect(connection).get_table_names())


def test_there_is_one_head() -> None:
    assert len(ScriptDirectory.from_config(alembic_config()).get_heads()) == 1


async def test_models_and_migrations_agree(engine: AsyncEngine) -> None:
    await migrate(engine)

    def differences(connection: Connection) -> list[Any]:
        context = MigrationContext.configure(connection, opts={"compare_server_default": True})
        return list(compare_metadata(context, Base.metadata))

    assert await within(engine, differences) == []


async def test_migrating_twice_changes_nothing(engine: AsyncEngine) -> None:
    assert not await is_current(engine)
    await migrate(engine)
    assert await is_current(engine)
    await migrate(engine)
    assert await is_current(engine)


async def test_one_down_and_up_again(engine: AsyncEngine) -> None:
    await migrate(engine)
    before = await within(engine, tables)
    assert before >= set(Base.metadata.tables)
    await within(engine, downgrade("-1"))
    assert not await is_current(engine)
    await migrate(engine)
    assert await within(engine, tables) == before


async def test_text_orders_by_code_point_on_both(engine: AsyncEngine) -> None:
    """Paging and folding compare text in the database and in Python; both must see one order."""
    names = ["a", "B", "_", "0", "-", "Z9", "z.1"]
    await migrate(engine)
    async with engine.execution_options(**{WRITE: True}).begin() as connection:
        table = Base.metadata.tables["rooms"]
        rows = [{"room": name, "body": "", "created_at": 0, "updated_at": 0, "head": 0} for name in names]
        await connection.execute(table.insert(), rows)
        found = (await connection.scalars(table.select().with_only_columns(table.c.room).order_by(table.c.room))).all()
    assert found == sorted(names)


def test_they_run_from_the_package_whatever_the_directory(tmp_path: Path) -> None:
    """As on a machine that has only the wheel: no alembic.ini, no checkout around."""
    command = [sys.executable, "-m", "tms_client", "keys", "create", "x", "--scope", "admin", "--data-dir", "data"]
    subprocess.run(command, cwd=tmp_path, check=True, capture_output=True, timeout=60)
    assert (tmp_path / "data" / "tms.sqlite").stat().st_size > 0


async def test_a_log_of_rows_becomes_a_log_of_blocks(engine: AsyncEngine) -> None:
    """A database of the first release: the same records are read from it, and again after going back."""
    await migrate(engine, "0001")
    log = ('{"seq":7,"observed_at":"1970-01-01T00:00:00.000005Z","type":"mover_left","label":"floor/1"}', "mover_left")
    registry = ('{"type":"object_removed","tag":"E1"}', "registry")
    async with engine.execution_options(**{WRITE: True}).begin() as connection:
        for statement in (
            "insert into rooms (room, body, created_at, updated_at, head) values ('lab', '{}', 0, 0, 2)",
            f"insert into log values ('lab', 1, '@lab', 1, 0, 3, '{registry[1]}', '{registry[0]}', false)",
            f"insert into log values ('lab', 2, 'floor', 7, 5, 9, '{log[1]}', '{log[0]}', false)",
        ):
            await connection.exec_driver_sql(statement)
    await migrate(engine)

    async def read() -> list[Record]:
        return await SqlRoomLog(engine, SystemClock(), retention_s=None).read("lab", 0, 10)

    first, second = await read()
    assert (first.offset, first.kind, first.content) == (1, "registry", ObjectRemoved(tag="E1"))
    assert (second.offset, second.seq, second.observed_at, second.received_at) == (2, 7, 5, 9)
    assert second.content == MoverLeft.model_validate_json(log[0])
    async with engine.connect() as connection:
        assert await connection.scalar(text("select newest_at from rooms")) == 5

    # A block of two, one with a time in another form that the wire accepts.
    left = '{"seq":%d,"observed_at":%s,"type":"mover_left","label":"floor/1"}'
    body = '{{"agent":"floor","room":"lab","observations":[{},{}]}}'.format(
        left % (8, "6"),
        left % (9, '"1970-01-01T00:00:07Z"'),
    )
    async with engine.execution_options(**{WRITE: True}).begin() as connection:
        block = f"('lab', 4, 'floor', 8, 2, 6000000, 7000000, 9, false, '{body}')"
        await connection.exec_driver_sql(f"insert into log values {block}")
    everything = await read()
    assert [record.seq for record in everything] == [1, 7, 8, 9]

    await within(engine, downgrade("0001"))
    async with engine.connect() as connection:
        found = await connection.execute(text('select "offset", agent, seq, observed_at, kind from log order by 1'))
    assert [tuple(row) for row in found.all()] == [
        (1, "@lab", 1, 0, "registry"),
        (2, "floor", 7, 5, "mover_left"),
        (3, "floor", 8, 6_000_000, "mover_left"),
        (4, "floor", 9, 7_000_000, "mover_left"),
    ]
    await migrate(engine)
    assert await read() == everything
