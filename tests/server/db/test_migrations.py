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
from sqlalchemy import Connection, inspect
from sqlalchemy.ext.asyncio import AsyncEngine

from tms_server.db.engine import WRITE, create_engine
from tms_server.db.migrate import alembic_config, is_current, migrate
from tms_server.db.tables import Base

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
