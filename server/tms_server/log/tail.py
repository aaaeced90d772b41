"""The newest blocks of each room in memory, so that a follower need not ask the database for what was just written."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable

from tms_server.log.blocks import Written

#: Records kept per room, at least.
_KEPT = 4000


class Tail:
    """Holds what this process appended, as far as it is without gaps up to the newest record it was told of."""

    def __init__(self) -> None:
        self._blocks: dict[str, deque[Written]] = {}

    def add(self, blocks: Iterable[Written]) -> None:
        """Blocks of one transaction, of each room in order of offset."""
        for written in blocks:
            kept = self._blocks.setdefault(written.block.room, deque())
            if kept and written.block.before != kept[-1].block.offset:
                kept.clear()  # somebody else wrote in between
            kept.append(written)
            while written.block.offset - kept[0].block.offset >= _KEPT:
                kept.popleft()

    def after(self, room: str, offset: int, limit: int) -> list[Written]:
        """Blocks that end after ``offset``, of ``limit`` records or a few more; nothing where the first is not here."""
        kept = self._blocks.get(room)
        if not kept or not kept[0].block.before <= offset < kept[-1].block.offset:
            return []
        page: list[Written] = []
        for written in reversed(kept):
            if written.block.offset <= offset:
                break
            page.append(written)
        page.reverse()
        while len(page) > 1 and page[-1].block.before >= offset + limit:
            page.pop()
        return page
