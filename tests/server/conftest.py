"""What the tests of the server share: the database beside the running server, keys in it, and its room logs."""

from __future__ import annotations

import asyncio
import json
from collections.abc import AsyncIterator, Awaitable, Callable
from typing import Any

import pytest
from fastapi import FastAPI
from sqlalchemy import select

from tms_server.clock import SystemClock
from tms_server.db.engine import create_engine
from tms_server.db.session import Sessions
from tms_server.db.tables import LogRow
from tms_server.keys.ring import MAX_AGE_S
from tms_server.keys.service import KeyService


@pytest.fixture
async def sessions(app: FastAPI, database_url: str) -> AsyncIterator[Sessions]:
    """The database of the running server, seen from outside."""
    engine = create_engine(database_url)
    yield Sessions(engine)
    await engine.dispose()


@pytest.fixture
def make_key(sessions: Sessions) -> Callable[..., Awaitable[str]]:
    """Make a key with scopes, as `tms keys create` does, and wait until the running server knows it."""

    async def make(*scopes: str) -> str:
        async with sessions.write() as session:
            key = await KeyService(session, SystemClock()).create("test", scopes)
            await session.commit()
        await asyncio.sleep(MAX_AGE_S + 0.1)
        return key

    return make


@pytest.fixture
def registry(sessions: Sessions) -> Callable[[str], Awaitable[list[dict[str, Any]]]]:
    """The registry records of a room, oldest first."""

    async def read(room: str) -> list[dict[str, Any]]:
        async with sessions.read() as session:
            query = select(LogRow).where(LogRow.room == room, LogRow.agent == f"@{room}").order_by(LogRow.offset)
            return [json.loads(row.body) for row in (await session.scalars(query)).all()]

    return read
