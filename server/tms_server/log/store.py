"""One append transaction at driver level: what it asks of a database, and the statements both databases share.

An append is the hot path of the server, so it bypasses the ORM: a handful of bulk statements for all the batches
that waited, whatever their number.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import Any, NamedTuple, Protocol, Self

from tms_server.log.blocks import Block, records
from tms_server.log.bodies import Content
from tms_server.log.plan import Known, Plan
from tms_server.log.record import Batch


class Store(Protocol):
    async def append(self, batches: Sequence[Batch], decide: Callable[[Known], Plan]) -> Plan:
        """Read what ``decide`` needs, write what it decided, commit durably.

        Raises the driver's errors; the next call starts afresh.
        """

    async def close(self) -> None: ...


class Wanted(NamedTuple):
    """Keys of the facts to read."""

    rooms: list[str]
    agents: list[str]
    tags: list[str]

    @classmethod
    def by(cls, batches: Sequence[Batch]) -> Self:
        # Sorted: two transactions that lock the same rooms take them in the same order.
        return cls(
            sorted({batch.room for batch in batches}),
            sorted({batch.agent for batch in batches}),
            sorted({read.tag for batch in batches for read in batch.reads}),
        )


def repeated(batches: Sequence[Batch], next_seq: dict[str, int]) -> dict[str, list[int]]:
    """Numbers of each agent that may be in the log already. Those from ``next_seq`` on cannot."""
    found: dict[str, list[int]] = {}
    for batch in batches:
        bound = next_seq.get(batch.agent, 0)
        again = [seq for seq in batch.seqs if seq < bound]
        if again:
            found.setdefault(batch.agent, []).extend(again)
    return found


def contents(rows: Iterable[Sequence[Any]]) -> dict[tuple[str, int], tuple[str, Content]]:
    """(agent, seq) -> room and content of everything in some blocks."""
    found = [record for row in rows for record in records(Block(*row))]
    return {(record.agent, record.seq): (record.room, record.content) for record in found}


LOG_COLUMNS = 'room, "offset", agent, seq, records, first_at, last_at, received_at, late, body'
ROOM_COLUMNS = "room, head, newest_at"
AGENT_COLUMNS = "agent, room, next_seq, received, first_seen, last_seen, last_observed_at, state, why"
UNKNOWN_COLUMNS = "tag, room, agent, first_seen, last_seen, count, label, x, y"

ON_AGENT_CONFLICT = """
on conflict (agent) do update set room = excluded.room, next_seq = excluded.next_seq, received = excluded.received,
    last_seen = excluded.last_seen, last_observed_at = excluded.last_observed_at, state = excluded.state,
    why = excluded.why"""

#: As ``plan.merge``, between what is stored and what was just read.
ON_UNKNOWN_CONFLICT = """
on conflict (tag, room) do update set
    agent = case when excluded.last_seen >= u.last_seen then excluded.agent else u.agent end,
    label = case when excluded.last_seen >= u.last_seen then excluded.label else u.label end,
    x = case when excluded.last_seen >= u.last_seen then excluded.x else u.x end,
    y = case when excluded.last_seen >= u.last_seen then excluded.y else u.y end,
    first_seen = case when excluded.first_seen < u.first_seen then excluded.first_seen else u.first_seen end,
    last_seen = case when excluded.last_seen >= u.last_seen then excluded.last_seen else u.last_seen end,
    count = u.count + excluded.count"""
