"""Intake: one call registers a thing from what reader and scanner say; and the list of tags that wait for it."""

from __future__ import annotations

from typing import Any

from sqlalchemy.ext.asyncio import AsyncSession

from tms_schemas.objects import (
    IntakeRequest,
    IntakeResult,
    ObjectFields,
    Product,
    ProductIn,
    UnknownTag,
    UnknownTagPage,
)
from tms_schemas.problem import ProblemItem
from tms_server.auth import require_admin, require_observe
from tms_server.clock import Clock
from tms_server.db.paging import cut, decode_cursor
from tms_server.db.session import ReadOnlySession
from tms_server.db.tables import UnknownTagRow
from tms_server.db.times import from_us
from tms_server.db.turns import take_turn
from tms_server.errors import Conflict, Invalid
from tms_server.keys.scopes import Principal
from tms_server.objects.gtin import gtin_of_epc
from tms_server.objects.products import store_products
from tms_server.objects.repository import ObjectRepository, ProductRepository, UnknownTagRepository
from tms_server.objects.service import checked_jan, store
from tms_server.objects.views import Stored, own_fields, town_product


async def intake(session: AsyncSession, clock: Clock, caller: Principal, request: IntakeRequest) -> IntakeResult:
    """Register ``request.tag``, or confirm that it is registered so.

    The JAN comes from the request or from an SGTIN-96 tag itself; name and all else from its product. What the object
    lacks is filled in; what it has and the request says otherwise is a conflict, never overwritten.

    Raises:
        Invalid: no name to be had, a wrong or contradicting JAN, an unknown room.
        Conflict: the tag is registered as something else.
        Forbidden: the key may not observe in the room.
    """
    jan = _jan(request)
    await take_turn(session)
    before = await ObjectRepository(session).get(request.tag)
    room = await _room(session, caller, request, before)
    _authorise(caller, room, before)
    product = await _product(session, clock, jan, request.name)
    wanted: dict[str, Any] = {"jan": jan, "room": room, "name": request.name, "synonyms": request.synonyms}
    if before is None:
        wanted["name"] = request.name or (product.name if product else None)
        fields = ObjectFields.model_validate(wanted)
    else:
        fields = _filled(own_fields(before.object), wanted)
    put = await store(session, clock, request.tag, before, fields)
    return IntakeResult(object=put.object, product=product, created=put.created)


async def list_unknown_tags(
    session: AsyncSession | ReadOnlySession, caller: Principal, *, room: str | None, cursor: str | None, limit: int
) -> UnknownTagPage:
    """Tags that were seen but belong to no object, by tag, in the rooms that the caller may see."""
    after = decode_cursor(cursor, 2)
    rows = await UnknownTagRepository(session).page(room=room, rooms=caller.rooms(), after=after, limit=limit)
    page, following = cut(rows, limit, lambda row: (row.tag, row.room))
    return UnknownTagPage(items=[_unknown(row) for row in page], next_cursor=following)


def _jan(request: IntakeRequest) -> str | None:
    inside = gtin_of_epc(request.tag)
    if request.jan is None:
        return inside
    jan = checked_jan(request.jan)
    if inside is not None and inside != jan:
        why = f"the tag itself names product {inside}, not {jan}"
        raise Invalid(f"jan: {why}", items=[ProblemItem(where="jan", why=why)])
    return jan


async def _room(session: AsyncSession, caller: Principal, request: IntakeRequest, before: Stored | None) -> str | None:
    """The room named; else where the object is; else where the tag was seen as unknown, if that is one room."""
    if request.room is not None:
        return request.room
    if before is not None:
        return before.object.room
    seen = [room for room in await UnknownTagRepository(session).rooms_of(request.tag) if caller.may_observe(room)]
    return seen[0] if len(seen) == 1 else None


def _authorise(caller: Principal, room: str | None, before: Stored | None) -> None:
    for name in {room, before.object.room if before else room}:
        if name is None:
            if room is None:
                require_admin(caller)
        else:
            require_observe(caller, name)


async def _product(session: AsyncSession, clock: Clock, jan: str | None, name: str | None) -> Product | None:
    """The product of ``jan``; one that the catalogue lacks is added under the name given."""
    if jan is None:
        if name is None:
            why = "the tag names no product by itself: give a JAN of the catalogue, or a name"
            raise Invalid(f"jan: {why}", items=[ProblemItem(where="jan", why=why)])
        return None
    row = await ProductRepository(session).get(jan)
    if row is not None:
        return town_product(row)
    if name is None:
        why = f"product {jan} is not in the catalogue: give a name as well, or PUT /v1/products/{jan} first"
        raise Invalid(f"jan: {why}", items=[ProblemItem(where="jan", why=why)])
    product = ProductIn(name=name)
    await store_products(session, clock, {jan: product})
    return Product(jan=jan, **dict(product))


def _filled(known: ObjectFields, wanted: dict[str, Any]) -> ObjectFields:
    """``known`` with its gaps filled. Raises ``Conflict`` naming what contradicts."""
    update: dict[str, Any] = {}
    items: list[ProblemItem] = []
    for field, value in wanted.items():
        has = getattr(known, field)
        if not value or has == value or (field == "synonyms" and set(value) <= set(has)):
            continue
        if has:
            items.append(ProblemItem(where=field, why=f"registered as {has!r}, not {value!r}"))
        else:
            update[field] = value
    if items:
        why = f"{items[0].where} is {items[0].why}"
        raise Conflict(f"the tag is registered already and its {why}; PATCH the object to change it", items=items)
    return known.model_copy(update=update)


def _unknown(row: UnknownTagRow) -> UnknownTag:
    return UnknownTag(
        tag=row.tag,
        room=row.room,
        agent=row.agent,
        first_seen=from_us(row.first_seen),
        last_seen=from_us(row.last_seen),
        count=row.count,
        label=row.label,
        xy=None if row.x is None or row.y is None else (row.x, row.y),
    )
