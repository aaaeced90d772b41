"""What a change of the registry means for the belief: the records that go into the rooms' logs."""

from __future__ import annotations

from collections.abc import Iterable
from datetime import datetime

from sqlalchemy.ext.asyncio import AsyncSession

from tms_server.log.bodies import ObjectChanged, ObjectRegistered, ObjectRemoved, RegistryBody, TrackedObject
from tms_server.log.registry import append_registry

#: The room that tracks an object and what its belief knows of it; None where no room does.
Tracked = tuple[str, TrackedObject] | None


async def record_changes(session: AsyncSession, changes: Iterable[tuple[Tracked, Tracked]], now: datetime) -> None:
    """Append what each change from (before, after) means, room by room in the order of their ids."""
    records = [record for before, after in changes for record in _records(before, after)]
    for room, body in sorted(records, key=lambda record: record[0]):
        await append_registry(session, room, body, now=now)


def _records(before: Tracked, after: Tracked) -> list[tuple[str, RegistryBody]]:
    if before == after:
        return []
    if before is not None and after is not None and before[0] == after[0]:
        return [(after[0], ObjectChanged(**dict(after[1])))]
    records: list[tuple[str, RegistryBody]] = []
    if before is not None:
        records.append((before[0], ObjectRemoved(tag=before[1].tag)))
    if after is not None:
        records.append((after[0], ObjectRegistered(**dict(after[1]))))
    return records
