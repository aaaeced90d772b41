"""The unit of work of a request: services never commit, the dependency does when the endpoint returned."""

from __future__ import annotations

from collections.abc import AsyncIterator
from typing import Annotated, NewType

from fastapi import Depends
from sqlalchemy.ext.asyncio import AsyncEngine, AsyncSession, async_sessionmaker
from starlette.requests import HTTPConnection

from tms_server.db.engine import WRITE

#: A session that only reads is another type, so that a write through it does not type-check.
ReadOnlySession = NewType("ReadOnlySession", AsyncSession)


#: Key of ``session.info``: rooms whose log this unit of work appended to; their actors are told after the commit.
CHANGED_ROOMS = "changed_rooms"


class Sessions:
    """Makes the sessions of an engine."""

    def __init__(self, engine: AsyncEngine) -> None:
        self._write = async_sessionmaker(engine.execution_options(**{WRITE: True}), expire_on_commit=False)
        self._read = async_sessionmaker(engine, expire_on_commit=False)

    def write(self) -> AsyncSession:
        return self._write()

    def read(self) -> ReadOnlySession:
        return ReadOnlySession(self._read())


async def _write_session(connection: HTTPConnection) -> AsyncIterator[AsyncSession]:
    sessions: Sessions = connection.state.sessions
    async with sessions.write() as session:
        try:
            yield session
        except BaseException:
            await session.rollback()
            raise
        await session.commit()
        for room in session.info.get(CHANGED_ROOMS, ()):
            connection.state.town.poke(room)


async def _read_session(connection: HTTPConnection) -> AsyncIterator[ReadOnlySession]:
    sessions: Sessions = connection.state.sessions
    async with sessions.read() as session:
        yield session


# scope="function": the commit happens before the answer is sent, so what was answered is durable.
Session = Annotated[AsyncSession, Depends(_write_session, scope="function")]
ReadSession = Annotated[ReadOnlySession, Depends(_read_session, scope="function")]
