"""SQL of objects, products and unknown tags."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from sqlalchemy import ColumnElement, func, or_, select, tuple_
from sqlalchemy.ext.asyncio import AsyncSession
from sqlalchemy.orm import InstrumentedAttribute

from tms_server.db.session import ReadOnlySession
from tms_server.db.tables import ObjectRow, ProductRow, UnknownTagRow
from tms_server.objects.search import Word
from tms_server.objects.views import Stored

#: Values per IN list; both databases bound the number of parameters of a statement.
CHUNK = 500


@dataclass(frozen=True, kw_only=True, slots=True)
class ObjectFilter:
    """Which objects. ``rooms`` are those that the caller may see (None: all); roomless objects are for everybody."""

    words: Sequence[Word] = ()
    room: str | None = None
    category: str | None = None
    rooms: frozenset[str] | None = None


class ObjectRepository:
    def __init__(self, session: AsyncSession | ReadOnlySession) -> None:
        self._session = session

    async def get(self, tag: str) -> Stored | None:
        found = await self._stored([ObjectRow.tag == tag], limit=1)
        return found[0] if found else None

    async def page(self, wanted: ObjectFilter, *, after: str | None, limit: int) -> Sequence[Stored]:
        """Up to ``limit + 1`` objects by tag."""
        where = _conditions(wanted)
        if after is not None:
            where.append(ObjectRow.tag > after)
        return await self._stored(where, limit=limit + 1)

    async def page_among(
        self, wanted: ObjectFilter, tags: Iterable[str], *, after: str | None, limit: int
    ) -> Sequence[Stored]:
        """The same among the given tags."""
        rest = sorted(tag for tag in tags if after is None or tag > after)
        where = _conditions(wanted)
        found: list[Stored] = []
        for start in range(0, len(rest), CHUNK):
            among = ObjectRow.tag.in_(rest[start : start + CHUNK])
            found += await self._stored([*where, among], limit=limit + 1 - len(found))
            if len(found) > limit:
                break
        return found

    async def of_products(self, jans: Sequence[str]) -> Sequence[Stored]:
        """Every object of the products."""
        found: list[Stored] = []
        for start in range(0, len(jans), CHUNK):
            found += await self._stored([ObjectRow.jan.in_(jans[start : start + CHUNK])])
        return found

    def add(self, row: ObjectRow) -> None:
        self._session.add(row)

    async def delete(self, row: ObjectRow) -> None:
        await self._session.delete(row)

    async def _stored(self, where: Iterable[ColumnElement[bool]], limit: int | None = None) -> Sequence[Stored]:
        query = (
            select(ObjectRow, ProductRow)
            .outerjoin(ProductRow, ProductRow.jan == ObjectRow.jan)
            .where(*where)
            .order_by(ObjectRow.tag)
            .limit(limit)
        )
        return [Stored(row, product) for row, product in (await self._session.execute(query)).all()]


class ProductRepository:
    def __init__(self, session: AsyncSession | ReadOnlySession) -> None:
        self._session = session

    async def get(self, jan: str) -> ProductRow | None:
        return await self._session.get(ProductRow, jan)

    async def many(self, jans: Sequence[str]) -> dict[str, ProductRow]:
        found: dict[str, ProductRow] = {}
        for start in range(0, len(jans), CHUNK):
            query = select(ProductRow).where(ProductRow.jan.in_(jans[start : start + CHUNK]))
            found.update({row.jan: row for row in (await self._session.scalars(query)).all()})
        return found

    async def page(self, words: Sequence[Word], *, after: str | None, limit: int) -> Sequence[ProductRow]:
        """Up to ``limit + 1`` products by JAN."""
        query = select(ProductRow).where(*_contain(ProductRow.search_text, words)).order_by(ProductRow.jan)
        if after is not None:
            query = query.where(ProductRow.jan > after)
        return (await self._session.scalars(query.limit(limit + 1))).all()

    def add(self, row: ProductRow) -> None:
        self._session.add(row)


class UnknownTagRepository:
    def __init__(self, session: AsyncSession | ReadOnlySession) -> None:
        self._session = session

    async def page(
        self, *, room: str | None, rooms: frozenset[str] | None, after: tuple[str, ...] | None, limit: int
    ) -> Sequence[UnknownTagRow]:
        """Up to ``limit + 1`` tags that no object has, by tag and room, out of ``rooms`` (None: all)."""
        registered = select(ObjectRow.tag).where(ObjectRow.tag == UnknownTagRow.tag).exists()
        query = select(UnknownTagRow).where(~registered).order_by(UnknownTagRow.tag, UnknownTagRow.room)
        if room is not None:
            query = query.where(UnknownTagRow.room == room)
        if rooms is not None:
            query = query.where(UnknownTagRow.room.in_(sorted(rooms)))
        if after is not None:
            query = query.where(tuple_(UnknownTagRow.tag, UnknownTagRow.room) > after)
        return (await self._session.scalars(query.limit(limit + 1))).all()

    async def rooms_of(self, tag: str) -> Sequence[str]:
        """The rooms where the tag was seen as unknown."""
        query = select(UnknownTagRow.room).where(UnknownTagRow.tag == tag).order_by(UnknownTagRow.room)
        return (await self._session.scalars(query)).all()


def _conditions(wanted: ObjectFilter) -> list[ColumnElement[bool]]:
    where = _contain(ObjectRow.search_text, wanted.words)
    if wanted.room is not None:
        where.append(ObjectRow.room == wanted.room)
    if wanted.category is not None:
        where.append(func.coalesce(ObjectRow.category, ProductRow.category) == wanted.category)
    if wanted.rooms is not None:
        where.append(or_(ObjectRow.room.is_(None), ObjectRow.room.in_(sorted(wanted.rooms))))
    return where


def _contain(text: InstrumentedAttribute[str], words: Sequence[Word]) -> list[ColumnElement[bool]]:
    return [or_(*(text.contains(spelling, autoescape=True) for spelling in word)) for word in words]
