"""SQL of maps and their versions."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from sqlalchemy import delete, select
from sqlalchemy.ext.asyncio import AsyncSession

from tms_server.db.session import ReadOnlySession
from tms_server.db.tables import MapBlobRow, MapRow, MapTileRow, MapVersionRow


class MapRepository:
    def __init__(self, session: AsyncSession | ReadOnlySession) -> None:
        self._session = session

    async def get(self, map: str) -> MapRow | None:
        return await self._session.get(MapRow, map)

    async def lock(self, map: str) -> MapRow | None:
        """The map's row as it is now, locked until the commit."""
        query = select(MapRow).where(MapRow.map == map).with_for_update()
        return (await self._session.scalars(query, execution_options={"populate_existing": True})).first()

    async def page(
        self, *, room: str | None, among: Iterable[str] | None, after: str | None, limit: int
    ) -> Sequence[MapRow]:
        """Up to ``limit + 1`` maps by id; ``among`` are the rooms that count, None means all."""
        query = select(MapRow).order_by(MapRow.map).limit(limit + 1)
        if room is not None:
            query = query.where(MapRow.room == room)
        if among is not None:
            query = query.where(MapRow.room.in_(sorted(among)))
        if after is not None:
            query = query.where(MapRow.map > after)
        return (await self._session.scalars(query)).all()

    async def of_room(self, room: str) -> Sequence[MapRow]:
        """By id."""
        return (await self._session.scalars(select(MapRow).where(MapRow.room == room).order_by(MapRow.map))).all()

    async def version(self, map: str, version: int) -> MapVersionRow | None:
        return await self._session.get(MapVersionRow, (map, version))

    async def versions(self, map: str, *, before: int | None, limit: int) -> Sequence[MapVersionRow]:
        """Up to ``limit + 1`` versions, the newest first."""
        query = select(MapVersionRow).where(MapVersionRow.map == map).order_by(MapVersionRow.version.desc())
        if before is not None:
            query = query.where(MapVersionRow.version < before)
        return (await self._session.scalars(query.limit(limit + 1))).all()

    async def objects(self, map: str, version: int) -> str | None:
        """JSON of the semi-dynamic objects as ``version`` has them; None where none were ever told."""
        query = (
            select(MapVersionRow.objects)
            .where(MapVersionRow.map == map, MapVersionRow.version <= version, MapVersionRow.objects.is_not(None))
            .order_by(MapVersionRow.version.desc())
            .limit(1)
        )
        return await self._session.scalar(query)

    async def objects_made_at(self, map: str, version: int) -> int | None:
        """When the version was made that told the objects as ``version`` has them (us); None where none were told."""
        query = (
            select(MapVersionRow.created_at)
            .where(MapVersionRow.map == map, MapVersionRow.version <= version, MapVersionRow.objects.is_not(None))
            .order_by(MapVersionRow.version.desc())
            .limit(1)
        )
        return await self._session.scalar(query)

    def add(self, row: MapRow | MapVersionRow) -> None:
        self._session.add(row)

    async def delete(self, map: str) -> None:
        """The map with all its versions and tiles."""
        for table in (MapTileRow, MapBlobRow, MapVersionRow, MapRow):
            await self._session.execute(
                delete(table).where(table.map == map), execution_options={"synchronize_session": False}
            )
