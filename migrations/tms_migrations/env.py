"""Alembic environment: inside a connection that the server gives, or from the command line by URL."""

from __future__ import annotations

import asyncio

from alembic import context
from sqlalchemy import Connection

from tms_server.db.engine import WRITE, create_engine
from tms_server.db.tables import Base
from tms_server.settings import Settings


def run(connection: Connection) -> None:
    context.configure(connection=connection, target_metadata=Base.metadata, render_as_batch=True)
    with context.begin_transaction():
        context.run_migrations()


async def run_by_url() -> None:
    engine = create_engine(Settings().url())
    async with engine.execution_options(**{WRITE: True}).begin() as connection:
        await connection.run_sync(run)
    await engine.dispose()


given = context.config.attributes.get("connection")
if given is not None:
    run(given)
else:
    asyncio.run(run_by_url())
