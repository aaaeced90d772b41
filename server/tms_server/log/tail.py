"""The newest records of each room in memory, so that a follower need not ask the database for what was just written."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Iterator
from itertools import groupby, islice
from operator import attrgetter

from tms_server.log.record import Record

#: Records kept per room.
_KEPT = 4000


class Tail:
    """Holds what this process appended, as far as it is without gaps up to the newest record it was told of."""

    def __init__(self) -> None:
        self._records: dict[str, deque[Record]] = {}

    def add(self, records: Iterable[Record]) -> None:
        """Records of one transaction, of each room in order of offset."""
        for room, some in groupby(records, key=attrgetter("room")):
            kept = self._records.setdefault(room, deque(maxlen=_KEPT))
            for record in some:
                if kept and record.offset != kept[-1].offset + 1:
                    kept.clear()  # somebody else wrote in between
                kept.append(record)

    def after(self, room: str, offset: int, limit: int) -> list[Record]:
        """The records that follow ``offset``; nothing where the next one is not here."""
        kept = self._records.get(room)
        if not kept or not kept[0].offset <= offset + 1 <= kept[-1].offset:
            return []
        start = offset + 1 - kept[0].offset
        if start < len(kept) // 2:
            return list(islice(kept, start, start + limit))
        newest_first: Iterator[Record] = islice(reversed(kept), len(kept) - start)
        return list(newest_first)[::-1][:limit]
