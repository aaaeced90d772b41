"""What queries ask of the object database."""

from __future__ import annotations

from sqlalchemy import select

from tms_server.db.session import ReadOnlySession
from tms_server.db.tables import ObjectRow
from tms_server.town.location import KnownObject


async def known_object(session: ReadOnlySession, tag: str) -> KnownObject | None:
    query = select(ObjectRow.tag, ObjectRow.name, ObjectRow.room, ObjectRow.tracking).where(ObjectRow.tag == tag)
    row = (await session.execute(query)).first()
    return None if row is None else KnownObject(row.tag, row.name, row.room, row.tracking)
