"""Bring a database to the newest revision with the migrations that were installed with the package."""

from __future__ import annotations

from alembic import command
from alembic.config import Config
from alembic.runtime.migration import MigrationContext
from alembic.script import ScriptDirectory
from sqlalchemy import Connection
from sqlalchemy.ext.asyncio import AsyncEngine

from tms_server.db.engine import WRITE


def alembic_config() -> Config:
    """Works from an installed wheel: the scripts are found as a package."""
    config = Config()
    config.set_main_option("script_location", "tms_migrations:")
    config.set_main_option("path_separator", "os")
    return config


async def migrate(engine: AsyncEngine, revision: str = "head") -> None:
    """Upgrade to ``revision``. The caller owns the database (``own_database``), so nobody migrates beside it."""
    async with engine.execution_options(**{WRITE: True}).begin() as connection:
        await connection.run_sync(_upgrade, revision)


def _upgrade(connection: Connection, revision: str) -> None:
    config = alembic_config()
    config.attributes["connection"] = connection
    command.upgrade(config, revision)


async def is_current(engine: AsyncEngine) -> bool:
    """True where the database is at the newest revision already."""
    async with engine.connect() as connection:
        return await connection.run_sync(_is_current)


def _is_current(connection: Connection) -> bool:
    heads = ScriptDirectory.from_config(alembic_config()).get_heads()
    return set(MigrationContext.configure(connection).get_current_heads()) == set(heads)
