"""Objects: put, change, remove, find. What the belief must know goes into the room's log in the same transaction."""

from __future__ import annotations

from typing import NamedTuple

from sqlalchemy.ext.asyncio import AsyncSession

from tms_schemas.objects import ObjectFields, ObjectModel, ObjectPatch, Shape, TownObject
from tms_schemas.problem import ProblemItem
from tms_server.clock import Clock
from tms_server.db.session import ReadOnlySession
from tms_server.db.tables import ObjectRow, ProductRow
from tms_server.db.times import to_us
from tms_server.db.turns import take_turn
from tms_server.errors import Invalid, NotFound
from tms_server.objects.changes import record_changes
from tms_server.objects.gtin import InvalidGtin, canonical_gtin
from tms_server.objects.repository import ObjectRepository, ProductRepository
from tms_server.objects.views import Stored, object_columns, own_fields, shape, town_object, tracked
from tms_server.rooms.polygons import require_area
from tms_server.rooms.repository import RoomRepository


class Put(NamedTuple):
    object: TownObject
    created: bool


async def put_object(session: AsyncSession, clock: Clock, tag: str, fields: ObjectFields) -> Put:
    """Store the object. The same fields again change nothing, in the table and in the log.

    Raises:
        Invalid: a JAN with a wrong check digit or outside the catalogue, an unknown room, or a shape without area.
    """
    require_shape(fields.shape)
    await take_turn(session)
    return await store(session, clock, tag, await ObjectRepository(session).get(tag), fields)


async def patch_object(session: AsyncSession, clock: Clock, tag: str, patch: ObjectPatch) -> TownObject:
    """Change the fields that ``patch`` holds. Raises ``NotFound``, and ``Invalid`` as ``put_object``."""
    changes = patch.model_dump(exclude_unset=True)
    if "name" in changes and changes["name"] is None:
        raise Invalid("name: an object needs one", items=[ProblemItem(where="name", why="cannot be cleared")])
    for field in ("synonyms", "tracking"):  # to clear these is to take their default
        if field in changes and changes[field] is None:
            changes[field] = ObjectFields.model_fields[field].get_default()
    await take_turn(session)
    before = await find(session, tag)
    fields = ObjectFields.model_validate(dict(own_fields(before.object)) | changes)
    require_shape(fields.shape)
    return (await store(session, clock, tag, before, fields)).object


async def delete_object(session: AsyncSession, clock: Clock, tag: str) -> None:
    """Raises ``NotFound``."""
    await take_turn(session)
    before = await find(session, tag)
    if before.object.room is not None:
        await RoomRepository(session).lock([before.object.room])
    was = tracked(before)
    await ObjectRepository(session).delete(before.object)
    await record_changes(session, [(was, None)], clock.now())


async def get_object(session: AsyncSession | ReadOnlySession, tag: str) -> TownObject:
    """Raises ``NotFound``."""
    return town_object(await find(session, tag))


async def get_model(session: AsyncSession | ReadOnlySession, tag: str) -> ObjectModel:
    """Geometry for mapping. Raises ``NotFound`` where there is no object, or no shape is known."""
    found = await find(session, tag)
    known = shape(found)
    if known is None:
        raise NotFound(f"no shape is known for {tag}: neither it nor its product has one")
    return ObjectModel(
        tag=tag,
        polygon=known.polygon,
        parts=known.parts,
        tag_pose=own_fields(found.object).tag_pose,
        **{"class": known.class_},
    )


async def find(session: AsyncSession | ReadOnlySession, tag: str) -> Stored:
    """Raises ``NotFound``."""
    found = await ObjectRepository(session).get(tag)
    if found is None:
        raise NotFound(f"there is no object {tag!r}")
    return found


async def store(session: AsyncSession, clock: Clock, tag: str, before: Stored | None, fields: ObjectFields) -> Put:
    """Write what differs from ``before``. The caller took its turn."""
    product = await _product(session, fields.jan)
    if product is not None:
        fields = fields.model_copy(update={"jan": product.jan})
    await _lock_rooms(session, before, fields.room)
    columns, now = object_columns(fields, product, tag), clock.now()
    if before is not None and all(getattr(before.object, name) == value for name, value in columns.items()):
        return Put(town_object(before), created=False)
    was = None if before is None else tracked(before)
    if before is None:
        row = ObjectRow(tag=tag, created_at=to_us(now), updated_at=to_us(now), **columns)
        ObjectRepository(session).add(row)
    else:
        row = before.object
        for name, value in columns.items():
            setattr(row, name, value)
        row.updated_at = to_us(now)
    after = Stored(row, product)
    await session.flush()
    await record_changes(session, [(was, tracked(after))], now)
    return Put(town_object(after), created=before is None)


def require_shape(shape: Shape | None) -> None:
    """Raises ``Invalid`` naming the polygons that enclose no area."""
    if shape is not None:
        parts = ((f"shape/parts/{i}", part) for i, part in enumerate(shape.parts))
        require_area([("shape/polygon", shape.polygon), *parts])


def checked_jan(digits: str, where: str = "jan") -> str:
    """The canonical form. Raises ``Invalid`` naming the field."""
    try:
        return canonical_gtin(digits)
    except InvalidGtin as error:
        raise Invalid(f"{where}: {error}", items=[ProblemItem(where=where, why=str(error))]) from error


async def _product(session: AsyncSession, jan: str | None) -> ProductRow | None:
    if jan is None:
        return None
    canonical = checked_jan(jan)
    product = await ProductRepository(session).get(canonical)
    if product is None:
        why = f"product {canonical} is not in the catalogue; PUT /v1/products/{canonical} first"
        raise Invalid(f"jan: {why}", items=[ProblemItem(where="jan", why=why)])
    return product


async def _lock_rooms(session: AsyncSession, before: Stored | None, room: str | None) -> None:
    """Take the rooms that will be written to in one go, before a foreign key takes one of them out of order."""
    rooms = {name for name in (room, before.object.room if before else None) if name is not None}
    known = await RoomRepository(session).lock(rooms) if rooms else frozenset()
    if room is not None and room not in known:
        raise Invalid(f"room: there is no room {room!r}", items=[ProblemItem(where="room", why="unknown room")])
