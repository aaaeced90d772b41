"""Snapshots in SQL."""

from __future__ import annotations

from collections.abc import AsyncIterator

from sqlalchemy import BigInteger, Text, Tuple, delete, exists, insert, literal, select, tuple_
from sqlalchemy.ext.asyncio import AsyncEngine

from tms_server.clock import Clock
from tms_server.db.engine import WRITE
from tms_server.db.tables import LogRow, SnapshotRow
from tms_server.db.times import to_us
from tms_server.log.record import Position
from tms_server.log.seam import Snapshot

#: Neighbours of a kept snapshot are at most this part of its age (in records) apart.
_DENSITY = 0.25


class SqlSnapshots:
    def __init__(self, engine: AsyncEngine, clock: Clock) -> None:
        self._engine = engine
        self._clock = clock

    async def load(self, room: str, *, head: int, before: Position | None = None) -> AsyncIterator[Snapshot]:
        place = tuple_(SnapshotRow.observed_at, SnapshotRow.agent, SnapshotRow.seq)
        came_late = exists().where(
            LogRow.room == SnapshotRow.room,
            LogRow.late.is_(False),
            LogRow.offset > SnapshotRow.offset,
            LogRow.offset - LogRow.records < head,
            # Nothing in a block comes before this; a block that holds nothing too early may look as if it did.
            tuple_(LogRow.first_at, LogRow.agent, LogRow.seq) < place,
        )
        query = (
            select(SnapshotRow.offset, SnapshotRow.observed_at, SnapshotRow.agent, SnapshotRow.seq, SnapshotRow.body)
            .where(SnapshotRow.room == room, SnapshotRow.offset <= head, ~came_late)
            .order_by(SnapshotRow.observed_at.desc(), SnapshotRow.agent.desc(), SnapshotRow.seq.desc())
            .limit(1)
        )
        while True:
            bounded = query if before is None else query.where(place <= sql_position(before))
            async with self._engine.connect() as connection:
                row = (await connection.execute(bounded)).first()
            if row is None:
                return
            found = Snapshot(room, row[0], Position(row[1], row[2], row[3]), row[4])
            yield found
            query = query.where(place < sql_position(found.position))

    async def save(self, snapshot: Snapshot) -> None:
        async with self._engine.execution_options(**{WRITE: True}).begin() as connection:
            this = (SnapshotRow.room == snapshot.room) & (SnapshotRow.offset == snapshot.offset)
            await connection.execute(delete(SnapshotRow).where(this))
            await connection.execute(
                insert(SnapshotRow).values(
                    room=snapshot.room,
                    offset=snapshot.offset,
                    observed_at=snapshot.position.observed_at,
                    agent=snapshot.position.agent,
                    seq=snapshot.position.seq,
                    created_at=to_us(self._clock.now()),
                    body=snapshot.body,
                )
            )
            of_room = select(SnapshotRow.offset).where(SnapshotRow.room == snapshot.room)
            offsets = (await connection.scalars(of_room.order_by(SnapshotRow.offset.desc()))).all()
            surplus = thinned_out(list(offsets))
            await connection.execute(
                delete(SnapshotRow).where(SnapshotRow.room == snapshot.room, SnapshotRow.offset.in_(surplus))
            )


def sql_position(position: Position) -> Tuple:
    """To compare with the tuple (observed_at, agent, seq) of columns."""
    observed_at, agent, seq = position
    return tuple_(literal(observed_at, BigInteger), literal(agent, Text), literal(seq, BigInteger))


def thinned_out(newest_first: list[int]) -> list[int]:
    """Members of a falling sequence to drop, so that the gaps grow with the age: a handful covers any history.

    The newest three and the oldest stay.
    """
    head, kept, dropped = newest_first[0], newest_first[:3], []
    for index in range(3, len(newest_first) - 1):
        value, older = newest_first[index], newest_first[index + 1]
        if kept[-1] - older <= _DENSITY * (head - older):
            dropped.append(value)
        else:
            kept.append(value)
    return dropped
