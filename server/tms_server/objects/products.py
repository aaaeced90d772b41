"""Products: put, get, find. A product's new weight or size is a change of each of its objects."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from sqlalchemy.ext.asyncio import AsyncSession

from tms_schemas.objects import Product, ProductIn, ProductPage
from tms_server.clock import Clock
from tms_server.db.paging import cut, decode_cursor
from tms_server.db.session import ReadOnlySession
from tms_server.db.tables import ProductRow
from tms_server.db.times import to_us
from tms_server.db.turns import take_turn
from tms_server.errors import NotFound
from tms_server.objects.changes import record_changes
from tms_server.objects.repository import ObjectRepository, ProductRepository
from tms_server.objects.search import words
from tms_server.objects.service import checked_jan, require_shape
from tms_server.objects.views import object_columns, own_fields, product_columns, town_product, tracked
from tms_server.rooms.repository import RoomRepository


async def put_product(session: AsyncSession, clock: Clock, jan: str, fields: ProductIn) -> tuple[Product, bool]:
    """Store the product under its canonical JAN; true where it is new.

    Raises:
        Invalid: a wrong check digit, or a polygon of the shape without area.
    """
    canonical = checked_jan(jan)
    require_shape(fields.shape)
    await take_turn(session)
    new = await store_products(session, clock, {canonical: fields})
    return Product(jan=canonical, **dict(fields)), bool(new)


async def get_product(session: AsyncSession | ReadOnlySession, jan: str) -> Product:
    """By any form of its JAN. Raises ``NotFound``, or ``Invalid`` for a wrong check digit."""
    canonical = checked_jan(jan)
    row = await ProductRepository(session).get(canonical)
    if row is None:
        raise NotFound(f"product {canonical} is not in the catalogue")
    return town_product(row)


async def list_products(
    session: AsyncSession | ReadOnlySession, *, q: str | None, cursor: str | None, limit: int
) -> ProductPage:
    """By JAN. Raises ``Invalid`` for a bad cursor."""
    after = decode_cursor(cursor, 1)
    rows = await ProductRepository(session).page(words(q or ""), after=after[0] if after else None, limit=limit)
    page, following = cut(rows, limit, lambda row: (row.jan,))
    return ProductPage(items=[town_product(row) for row in page], next_cursor=following)


async def store_products(session: AsyncSession, clock: Clock, products: Mapping[str, ProductIn]) -> frozenset[str]:
    """Write the products (by canonical JAN) and record what that changes for their objects; returns the new ones.

    The caller took its turn.
    """
    repository, now = ProductRepository(session), clock.now()
    known = await repository.many(list(products))
    changed: dict[str, dict[str, Any]] = {}
    for jan, fields in products.items():
        columns = product_columns(jan, fields)
        row = known.get(jan)
        if row is None:
            repository.add(ProductRow(jan=jan, updated_at=to_us(now), **columns))
        elif any(getattr(row, name) != value for name, value in columns.items()):
            changed[jan] = columns
    objects = await ObjectRepository(session).of_products(list(changed)) if changed else []
    await RoomRepository(session).lock({o.object.room for o in objects if o.object.room is not None})
    before = [tracked(stored) for stored in objects]
    for jan, columns in changed.items():
        _assign(known[jan], columns | {"updated_at": to_us(now)})
    for stored in objects:
        # The category, which is searched for, may be the product's.
        columns = object_columns(own_fields(stored.object), stored.product, stored.object.tag)
        stored.object.search_text = columns["search_text"]
    await record_changes(session, zip(before, map(tracked, objects), strict=True), now)
    await session.flush()
    return frozenset(products) - known.keys()


def _assign(row: ProductRow, columns: Mapping[str, Any]) -> None:
    for name, value in columns.items():
        setattr(row, name, value)
