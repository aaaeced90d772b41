"""SQL of the rooms."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from sqlalchemy import select
from sqlalchemy.ext.asyncio import AsyncSession

from tms_server.db.session import ReadOnlySession
from tms_server.db.tables import RoomRow


class RoomRepository:
    def __init__(self, session: AsyncSession | ReadOnlySession) -> None:
        self._session = session

    async def get(self, room: str) -> RoomRow | None:
        return await self._session.get(RoomRow, room)

    async def page(self, *, among: Iterable[str] | None, after: str | None, limit: int) -> Sequence[RoomRow]:
        """Up to ``limit + 1`` rooms by id; ``among`` None means all rooms."""
        query = select(RoomRow).order_by(RoomRow.room).limit(limit + 1)
        if among is not None:
            query = query.where(RoomRow.room.in_(sorted(among)))
        if after is not None:
            query = query.where(RoomRow.room > after)
        return (await self._session.scalars(query)).all()

    async def lock(self, rooms: Iterable[str]) -> frozenset[str]:
        """Those of the rooms that exist, locked until the commit, in the order in which every writer takes them."""
        query = select(RoomRow.room).where(RoomRow.room.in_(sorted(rooms))).order_by(RoomRow.room).with_for_update()
        return frozenset((await self._session.scalars(query)).all())

    def add(self, row: RoomRow) -> None:
        self._session.add(row)
