"""States of a room kept in memory, so that a record that comes late costs a short re-fold."""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from operator import attrgetter
from typing import NamedTuple

from tms_server.log.record import Position, Record
from tms_server.log.snapshots import thinned_out
from tms_server.town.fold import RoomFold

#: Records between two checkpoints while they are young.
SPACING = 16
#: Records remembered; what comes later than these is re-folded from a stored snapshot.
REACH = 4000

_position = attrgetter("position")


class Checkpoint(NamedTuple):
    """A fold that is never applied to again; ``folded``: records folded by this actor up to it."""

    folded: int
    fold: RoomFold


class Checkpoints:
    """The recent past of one room: some of its states and all records since the oldest of them, in fold order."""

    def __init__(self, start: RoomFold) -> None:
        self._kept = [Checkpoint(0, start.copy())]
        self._records: list[Record] = []

    def before(self, position: Position) -> RoomFold | None:
        """The newest kept state that ends before ``position``; None where all are later."""
        index = bisect_left(self._kept, position, key=lambda kept: kept.fold.position)
        return self._kept[index - 1].fold if index else None

    def rewind(self, position: Position) -> tuple[RoomFold, list[Record]] | None:
        """Forget states from ``position`` on: the state to fold on from, and the records to fold again after it."""
        index = bisect_left(self._kept, position, key=lambda kept: kept.fold.position)
        if index == 0:
            return None
        del self._kept[index:]
        base = self._kept[-1].fold
        at = bisect_right(self._records, base.position, key=_position)
        again = self._records[at:]
        del self._records[at:]
        return base.copy(), again

    def folded(self, record: Record, fold: RoomFold) -> None:
        """``fold`` has just folded ``record``."""
        self._records.append(record)
        newest = self._kept[-1]
        if len(self._records) + self._first() - newest.folded >= SPACING:
            self._kept.append(Checkpoint(self._first() + len(self._records), fold.copy()))
            self._thin_out()

    def _first(self) -> int:
        return self._kept[0].folded

    def _thin_out(self) -> None:
        newest_first = [kept.folded for kept in reversed(self._kept)]
        surplus = set(thinned_out(newest_first))
        kept = [one for one in self._kept if one.folded not in surplus]
        while len(kept) > 1 and kept[-1].folded - kept[1].folded >= REACH:
            del kept[0]
        del self._records[: kept[0].folded - self._first()]
        self._kept = kept
