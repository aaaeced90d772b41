"""SQL of tiles: which content a place has in a version, and the contents by digest."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple

from sqlalchemy import ColumnElement, and_, bindparam, delete, func, insert, or_, select, tuple_, update
from sqlalchemy.ext.asyncio import AsyncSession
from sqlalchemy.orm import aliased

from tms_schemas.tiles import SIDE
from tms_server.db.session import ReadOnlySession
from tms_server.db.tables import MapBlobRow, MapTileRow
from tms_server.maps.content import Content

#: Values per IN list; both databases bound the number of parameters of a statement.
_CHUNK = 400
_NOT_SYNCHRONISED = {"synchronize_session": False}
Place = tuple[int, int]


class StoredTile(NamedTuple):
    """``digest`` and ``body`` are None for a tile that is gone; ``body`` also where it was not asked for."""

    x: int
    y: int
    digest: str | None
    body: bytes | None


class TileRepository:
    """The tiles of one map."""

    def __init__(self, session: AsyncSession | ReadOnlySession, map: str) -> None:
        self._session = session
        self._map = map

    async def now_at(self, places: Sequence[Place]) -> dict[Place, str]:
        """Digests of the newest version at those places that have a tile."""
        found: dict[Place, str] = {}
        for start in range(0, len(places), _CHUNK):
            query = select(MapTileRow.x, MapTileRow.y, MapTileRow.digest).where(
                MapTileRow.map == self._map,
                MapTileRow.until.is_(None),
                tuple_(MapTileRow.x, MapTileRow.y).in_(places[start : start + _CHUNK]),
            )
            found.update({(x, y): digest for x, y, digest in (await self._session.execute(query)).all()})
        return found

    async def at(self, version: int) -> dict[Place, str]:
        """All places of a version and what is there, by digest."""
        query = select(MapTileRow.x, MapTileRow.y, MapTileRow.digest).where(self._alive(version))
        return {(x, y): digest for x, y, digest in (await self._session.execute(query)).all()}

    async def contents(self, version: int) -> Sequence[tuple[int, int, bytes]]:
        """All tiles of a version: x, y, packed."""
        query = (
            select(MapTileRow.x, MapTileRow.y, MapBlobRow.body)
            .select_from(MapTileRow)
            .join(MapBlobRow, _SAME)
            .where(self._alive(version))
        )
        return [(x, y, body) for x, y, body in (await self._session.execute(query)).all()]

    async def bodies(self, digests: Iterable[str]) -> dict[str, bytes]:
        """Packed tiles by digest."""
        wanted = sorted(set(digests))
        found: dict[str, bytes] = {}
        for start in range(0, len(wanted), _CHUNK):
            query = select(MapBlobRow.digest, MapBlobRow.body).where(
                MapBlobRow.map == self._map, MapBlobRow.digest.in_(wanted[start : start + _CHUNK])
            )
            found.update((digest, body) for digest, body in (await self._session.execute(query)).all())
        return found

    async def changed(
        self, since: int, version: int, *, after: Place | None, limit: int, with_data: bool
    ) -> list[StoredTile]:
        """Up to ``limit + 1`` tiles that are otherwise in ``version`` than in ``since``, by place."""
        beyond = [] if after is None else [tuple_(MapTileRow.x, MapTileRow.y) > tuple_(*after)]
        body = (MapBlobRow.body,) if with_data else ()
        query = select(MapTileRow.x, MapTileRow.y, MapTileRow.digest, *body)
        if with_data:
            query = query.select_from(MapTileRow).join(MapBlobRow, _SAME)
        new = query.where(self._alive(version), MapTileRow.since > since, *beyond)
        other = aliased(MapTileRow)
        still = select(other.x).where(
            other.map == self._map,
            other.x == MapTileRow.x,
            other.y == MapTileRow.y,
            other.since <= version,
            or_(other.until.is_(None), other.until > version),
        )
        gone = select(MapTileRow.x, MapTileRow.y).where(
            self._alive(since), MapTileRow.until <= version, ~still.exists(), *beyond
        )
        in_order = (MapTileRow.x, MapTileRow.y)
        rows = (await self._session.execute(new.order_by(*in_order).limit(limit + 1))).all()
        found = [StoredTile(row[0], row[1], row[2], row[3] if with_data else None) for row in rows]
        removed = (await self._session.execute(gone.order_by(*in_order).limit(limit + 1))).all()
        found += [StoredTile(x, y, None, None) for x, y in removed]
        return sorted(found, key=lambda tile: tile[:2])[: limit + 1]

    async def bounds(self) -> tuple[int, int, int, int] | None:
        """x0, y0, x1, y1 in cells of all that is known in the newest version."""
        x, y = MapTileRow.x * SIDE, MapTileRow.y * SIDE
        query = (
            select(
                func.min(x + MapBlobRow.left),
                func.min(y + MapBlobRow.bottom),
                func.max(x + MapBlobRow.right),
                func.max(y + MapBlobRow.top),
            )
            .select_from(MapTileRow)
            .join(MapBlobRow, _SAME)
            .where(MapTileRow.map == self._map, MapTileRow.until.is_(None))
        )
        sides = [side for side in (await self._session.execute(query)).one() if side is not None]
        return (sides[0], sides[1], sides[2], sides[3]) if sides else None

    async def known(self, digests: Iterable[str]) -> set[str]:
        """Those of the digests whose content the map holds."""
        wanted = sorted(set(digests))
        found: set[str] = set()
        for start in range(0, len(wanted), _CHUNK):
            query = select(MapBlobRow.digest).where(
                MapBlobRow.map == self._map, MapBlobRow.digest.in_(wanted[start : start + _CHUNK])
            )
            found.update((await self._session.scalars(query)).all())
        return found

    async def keep(self, contents: Iterable[Content], now: int) -> None:
        """Store the contents that are new, and note that the others were sent again. The map's row is locked."""
        by_digest = {one.digest: one for one in contents}
        known = await self.known(by_digest)
        if known:
            again = update(MapBlobRow).where(MapBlobRow.map == self._map, MapBlobRow.digest == bindparam("sent"))
            await self._execute_many(again.values(sent_at=now), [{"sent": digest} for digest in sorted(known)])
        rows = [
            {"map": self._map, "digest": one.digest, "body": one.body, "sent_at": now}
            | dict(zip(("left", "bottom", "right", "top"), one.known, strict=True))
            for digest, one in sorted(by_digest.items())
            if digest not in known
        ]
        if rows:
            await self._session.execute(insert(MapBlobRow), rows)

    async def put(self, version: int, tiles: Mapping[Place, str | None]) -> None:
        """From ``version`` on these places hold these digests, or nothing. The map's row is locked."""
        until = update(MapTileRow).where(
            MapTileRow.map == self._map,
            MapTileRow.until.is_(None),
            MapTileRow.x == bindparam("at_x"),
            MapTileRow.y == bindparam("at_y"),
        )
        await self._execute_many(until.values(until=version), [{"at_x": x, "at_y": y} for x, y in sorted(tiles)])
        rows = [
            {"map": self._map, "x": x, "y": y, "since": version, "until": None, "digest": digest}
            for (x, y), digest in sorted(tiles.items())
            if digest is not None
        ]
        if rows:
            await self._session.execute(insert(MapTileRow), rows)

    async def forget_unnamed(self, before: int) -> None:
        """Drop contents that no version names and that were sent before that time. The map's row is locked."""
        named = select(MapTileRow.digest).where(MapTileRow.map == self._map, MapTileRow.digest == MapBlobRow.digest)
        stale = delete(MapBlobRow).where(MapBlobRow.map == self._map, MapBlobRow.sent_at < before, ~named.exists())
        await self._session.execute(stale, execution_options=_NOT_SYNCHRONISED)

    def _alive(self, version: int) -> ColumnElement[bool]:
        until = or_(MapTileRow.until.is_(None), MapTileRow.until > version)
        return and_(MapTileRow.map == self._map, MapTileRow.since <= version, until)

    async def _execute_many(self, statement: object, rows: list[dict[str, object]]) -> None:
        # through the connection: the ORM would take an update with a list of parameters for one by primary key
        if rows:
            await (await self._session.connection()).execute(statement, rows)  # type: ignore[call-overload]


_SAME = and_(MapBlobRow.map == MapTileRow.map, MapBlobRow.digest == MapTileRow.digest)
