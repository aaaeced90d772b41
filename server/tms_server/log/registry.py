"""What people and programs change in a room's registry is part of its log, beside the observations.

``append_registry`` writes the record in the transaction that changes the table row, so that table and log agree.
"""

from __future__ import annotations

from datetime import datetime

from sqlalchemy import delete, func, insert, literal, select, update
from sqlalchemy.ext.asyncio import AsyncSession

from tms_server.db.session import CHANGED_ROOMS
from tms_server.db.tables import LogRow, RoomRow, UnknownTagRow
from tms_server.db.times import to_us
from tms_server.errors import NotFound
from tms_server.log.bodies import ObjectRegistered, ObjectRemoved, RegistryBody
from tms_server.log.record import REGISTRY_MARK


async def append_registry(session: AsyncSession, room: str, body: RegistryBody, *, now: datetime) -> None:
    """Append one registry record to the log of ``room``, in the transaction of ``session`` (a writing one).

    The row of the room must exist or be pending in the session. Its row stays locked until the commit, so a unit of
    work that touches two rooms takes them in the order of their ids. A tag that is registered is unknown no more:
    its row in ``unknown_tags`` goes.

    Raises:
        NotFound: there is no such room.
    """
    await session.flush()
    updated = await session.execute(
        update(RoomRow)
        .where(RoomRow.room == room)
        .values(head=RoomRow.head + 1)
        .returning(RoomRow.head, RoomRow.newest_at),
        execution_options={"synchronize_session": False},
    )
    facts = updated.first()
    if facts is None:
        raise NotFound(f"there is no room {room!r}")
    head, newest_at = facts
    agent = REGISTRY_MARK + room
    seq = await session.scalar(select(func.coalesce(func.max(LogRow.seq), 0) + 1).where(LogRow.agent == agent))
    # From the room's newest observation on, but never from the future; from the beginning in an empty room.
    effective_at = 0 if newest_at is None else min(newest_at, to_us(now))
    if isinstance(body, ObjectRegistered):
        this = (UnknownTagRow.room == room) & (UnknownTagRow.tag == body.tag)
        first_seen = await session.scalar(select(UnknownTagRow.first_seen).where(this))
        if first_seen is not None:
            removed_at = await _removed(session, agent, body.tag)
            effective_at = max(min(effective_at, first_seen - 1), removed_at)
            await session.execute(delete(UnknownTagRow).where(this), execution_options={"synchronize_session": "fetch"})
    await session.execute(
        insert(LogRow).values(
            room=room,
            offset=head,
            agent=agent,
            seq=seq,
            records=1,
            first_at=effective_at,
            last_at=effective_at,
            received_at=to_us(now),
            late=False,
            body=body.model_dump_json(by_alias=True),
        )
    )
    session.info.setdefault(CHANGED_ROOMS, set()).add(room)


async def _removed(session: AsyncSession, agent: str, tag: str) -> int:
    """When the room last stopped tracking ``tag`` (0 if never): it cannot be registered again before that."""
    of_tag = literal(ObjectRemoved(tag=tag).model_dump_json(by_alias=True))
    found = await session.scalar(select(func.max(LogRow.last_at)).where(LogRow.agent == agent, LogRow.body == of_tag))
    return found or 0
