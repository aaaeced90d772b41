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
from tms_server.objects.gtin import gtin_of_epc, in_store, names_its_company
from tms_server.objects.products import store_products
from tms_server.objects.repository import ObjectRepository, ProductRepository, UnknownTagRepository
from tms_server.objects.service import checked_jan, store
from tms_server.objects.views import Stored, own_fields, town_product


async def intake(session: AsyncSession, clock: Clock, caller: Principal, request: IntakeRequest) -> IntakeResult:
    """Register ``request.tag``, or confirm that it is registered so.

    The JAN comes from the request or from an SGTIN-96 tag itself, where that can be trusted; name and all else from
    its product. What the object lacks is filled in; what it has and the request says otherwise is a conflict, never
    overwritten. An in-store number that the catalogue lacks names no product: the object is registered by its name.

    Raises:
        Invalid: no name to be had, a wrong or contradicting JAN, an unknown room.
        Conflict: the tag is registered as something else.
        Forbidden: the key may not observe in the room.
    """
    await take_turn(session)
    jan = await _jan(session, request)
    before = await ObjectRepository(session).get(request.tag)
    room = await _room(session, caller, request, before)
    _authorise(caller, room, before)
    product = await _product(session, clock, jan, request)
    wanted: dict[str, Any] = {
        "jan": product.jan if product else None,
        "room": room,
        "name": request.name,
        "synonyms": request.synonyms,
    }
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


async def _jan(session: AsyncSession, request: IntakeRequest) -> str | None:
    """What the scanner says, or the tag itself. Tags in use carry made-up numbers too: those say nothing."""
    inside = gtin_of_epc(request.tag)
    trusted = inside is not None and (
        names_its_company(request.tag) or await ProductRepository(session).get(inside) is not None
    )
    if request.jan is None:
        return inside if trusted else None
    jan = checked_jan(request.jan)
    if inside is not None and trusted and inside != jan:
        packing = f" (packing level {inside[0]} of it)" if len(inside) == 14 and inside[1:13] == jan[:12] else ""
        raise _refused(f"the tag itself names product {inside}, not {jan}{packing}")
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


async def _product(session: AsyncSession, clock: Clock, jan: str | None, request: IntakeRequest) -> Product | None:
    """The product of ``jan``; one that the catalogue lacks is added under the name given."""
    if jan is None:
        if request.name is not None:
            return None
        inside = gtin_of_epc(request.tag)
        if inside is None:
            raise _refused("the tag names no product by itself: give a JAN of the catalogue, or a name")
        why = f"the tag's number {inside} is in no catalogue and of no known company"
        raise _refused(f"{why}: give a JAN of the catalogue, or a name")
    row = await ProductRepository(session).get(jan)
    if row is not None:
        return town_product(row)
    if request.name is None:
        raise _refused(f"product {jan} is not in the catalogue: give a name as well, or PUT /v1/products/{jan} first")
    if in_store(jan):
        return None
    product = ProductIn(name=request.name)
    await store_products(session, clock, {jan: product})
    return Product(jan=jan, **dict(product))


def _refused(why: str) -> Invalid:
    return Invalid(f"jan: {why}", items=[ProblemItem(where="jan", why=why)])


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
