"""From blocks to records in fold order: the blocks of several agents overlap in time, and late ones lie anywhere."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Sequence
from operator import attrgetter

from tms_server.log.blocks import Block, records
from tms_server.log.record import Position, Record

_position = attrgetter("position")


class Merge:
    """Blocks in order of ``start`` in, the records with ``after < position <= until`` up to offset ``head`` out."""

    def __init__(self, *, after: Position, until: Position | None, head: int) -> None:
        self._after, self._until, self._head = after, until, head
        self._waiting: list[Record] = []

    def take(self, blocks: Sequence[Block], *, more: bool) -> list[Record]:
        """The records that no later block can precede; with ``more`` false all that are left."""
        self._waiting += [
            record
            for block in blocks
            for record in records(block)
            if record.position > self._after
            and record.offset <= self._head
            and (self._until is None or record.position <= self._until)
        ]
        self._waiting.sort(key=_position)
        ready = bisect_right(self._waiting, start(blocks[-1]), key=_position) if more else len(self._waiting)
        due, self._waiting = self._waiting[:ready], self._waiting[ready:]
        return due


def start(block: Block) -> Position:
    """Nothing in the block comes before this position."""
    return Position(block.first_at, block.agent, block.seq)
