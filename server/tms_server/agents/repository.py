"""Agents as the log knows them: the rows that every append keeps."""

from __future__ import annotations

from sqlalchemy import select

from tms_server.db.session import ReadOnlySession
from tms_server.db.tables import AgentRow


class AgentRepository:
    def __init__(self, session: ReadOnlySession) -> None:
        self._session = session

    async def get(self, agent: str) -> AgentRow | None:
        return await self._session.get(AgentRow, agent)

    async def page(self, *, after: str, limit: int, rooms: frozenset[str] | None) -> list[AgentRow]:
        """The next agents by name; ``rooms`` None means those of every room."""
        query = select(AgentRow).where(AgentRow.agent > after).order_by(AgentRow.agent).limit(limit)
        if rooms is not None:
            query = query.where(AgentRow.room.in_(rooms))
        return list(await self._session.scalars(query))
