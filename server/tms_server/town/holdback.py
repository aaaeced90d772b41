"""Records that wait: with a hold-back, what was just observed is not folded before late neighbours had time to come."""

from __future__ import annotations

from collections.abc import Iterable
from heapq import heapify, heappop, heappush

from tms_server.log.blocks import Block, Written, records
from tms_server.log.merging import start
from tms_server.log.record import Record

#: (observed_at, agent, seq): a plain tuple, which costs a fraction of a ``Position`` and compares the same.
_Place = tuple[int, str, int]
#: Records kept as objects; what waits behind them is kept as text, which takes far less memory.
_AT_HAND = 10_000


class HoldBack:
    """Blocks in, records in fold order out. What waits is a heap of records, and of blocks not yet opened."""

    def __init__(self, waiting: Iterable[Record] = ()) -> None:
        self._heap: list[tuple[_Place, Record | Written | Block]] = [(_place(record), record) for record in waiting]
        self._at_hand = len(self._heap)
        heapify(self._heap)

    def add(self, blocks: Iterable[Written]) -> None:
        """Late blocks are left out: no belief knows them."""
        for written in blocks:
            block = written.block
            if block.late:
                continue
            if self._at_hand < _AT_HAND:
                self._at_hand += block.records
                heappush(self._heap, (start(block), written))
            else:
                heappush(self._heap, (start(block), block))

    def due(self, horizon: float) -> list[Record]:
        """Takes out what was observed at ``horizon`` (microseconds UTC) or before, in fold order."""
        opened: list[Record] = []
        heap = self._heap
        while heap and heap[0][0][0] <= horizon:
            _, one = heappop(heap)
            if isinstance(one, Record):
                opened.append(one)
                continue
            found = records(one) if isinstance(one, Block) else records(*one)
            self._at_hand += len(found) if isinstance(one, Block) else 0
            for record in found:
                if record.observed_at <= horizon:
                    opened.append(record)
                else:
                    heappush(heap, (_place(record), record))
        self._at_hand -= len(opened)
        opened.sort(key=_place)
        return opened


def _place(record: Record) -> _Place:
    return (record.observed_at, record.agent, record.seq)
