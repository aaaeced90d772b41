"""The door between rooms and storage. One process and SQL stand behind it now; nothing in front may know."""

from __future__ import annotations

from collections.abc import AsyncIterator, Sequence
from typing import NamedTuple, Protocol

from tms_server.log.blocks import Written
from tms_server.log.record import Batch, Position, Record, Verdict


class RoomLog(Protocol):
    """Ordered and durable. Offsets of a room increase by one per record, in order of commit."""

    async def append(self, batches: Sequence[Batch]) -> list[Verdict]:
        """Record the batches in one durable transaction; a verdict for each, in order.

        Raises:
            Unavailable: the storage failed and nothing is acknowledged. The same batches may be sent again.
        """

    def follow(self, room: str, after: int) -> AsyncIterator[list[Written]]:
        """Blocks that end after the offset ``after``, in pages, as they are committed. Never ends."""

    async def read(self, room: str, after: int, limit: int) -> list[Record]:
        """The next records after an offset, in order of offset: ``limit``, or a few more; fewer only at the end."""

    def replay(self, room: str, *, after: Position, until: Position | None, head: int) -> AsyncIterator[list[Record]]:
        """Records up to offset ``head`` with ``after < position <= until``, in fold order, in pages; none late."""

    async def heads(self) -> dict[str, int]:
        """Newest offset of every room."""

    async def head(self, room: str) -> int | None:
        """Newest offset of one room; None where there is no such room."""

    async def head_at(self, room: str, received_at: int) -> int:
        """Newest offset recorded at ``received_at`` (microseconds UTC) or before; 0 where there is none."""

    def committed(self, room: str) -> int:
        """Newest offset that this process appended; costs nothing. 0 where it appended none."""

    def poke(self, room: str) -> None:
        """Tell followers in this process that the room has new records."""


class Snapshot(NamedTuple):
    """A folded state that knows exactly the records with offset <= ``offset`` and position <= ``position``."""

    room: str
    offset: int
    position: Position
    body: bytes


class Snapshots(Protocol):
    """Folded states of a room. A snapshot saves time only: the log alone says what is true."""

    def load(self, room: str, *, head: int, before: Position | None = None) -> AsyncIterator[Snapshot]:
        """Usable snapshots, newest position first.

        Usable: at a position <= ``before``, at an offset <= ``head``, and no record between its offset and ``head``
        belongs before its position.
        """

    async def save(self, snapshot: Snapshot) -> None:
        """Keep it; older ones are thinned out, the farther back the fewer."""
