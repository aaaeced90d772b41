"""What an append transaction reads, and what it decides to write: pure, the same for both databases.

One transaction takes the batches of many agents. It reads the few facts it needs (``Known``), ``decide`` turns them
into rows and verdicts (``Plan``), and the store writes the rows. A refused batch leaves no trace.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

from tms_schemas.problem import ProblemItem
from tms_server.errors import Conflict, NotFound, TmsError
from tms_server.log.record import Appended, Batch, Item, Record, TagRead, Verdict


class AgentFacts(NamedTuple):
    """A row of ``agents``, in the order of its columns."""

    agent: str
    room: str
    next_seq: int
    received: int
    first_seen: int
    last_seen: int
    last_observed_at: int
    state: str
    why: str


class UnknownRead(NamedTuple):
    """A row of ``unknown_tags``, in the order of its columns; the count and the times are those of one append."""

    tag: str
    room: str
    agent: str
    first_seen: int
    last_seen: int
    reads: int
    label: str | None
    x: float | None
    y: float | None


@dataclass(slots=True)
class Known:
    """What the database knew before the append."""

    heads: dict[str, int]
    newest: dict[str, int]
    agents: dict[str, AgentFacts]
    #: (room, body) of recorded observations that the batches name again
    stored: dict[tuple[str, int], tuple[str, str]]
    #: (room, tag) of the tags read that are registered there
    registered: set[tuple[str, str]]


@dataclass(slots=True)
class Plan:
    verdicts: list[Verdict]
    records: list[Record] = field(default_factory=list)
    heads: dict[str, int] = field(default_factory=dict)
    agents: dict[str, AgentFacts] = field(default_factory=dict)
    unknown: dict[tuple[str, str], UnknownRead] = field(default_factory=dict)


def decide(batches: Sequence[Batch], known: Known, *, now: int, retention_us: int | None) -> Plan:
    """Rows to write and a verdict per batch. ``now`` is the time of receipt, microseconds UTC."""
    plan = Plan([])
    counts = Counter(batch.agent for batch in batches)
    for batch in batches:
        try:
            appended = _append(batch, known, plan, now, retention_us)
            if counts[batch.agent] > 1:  # its next batch may repeat what this one says
                known.stored.update({(batch.agent, item.seq): (batch.room, item.body) for item in batch.items})
            plan.verdicts.append(appended)
        except TmsError as refusal:
            plan.verdicts.append(refusal)
    # Every batch of a room is answered with the room's newest offset, which they all reached together.
    plan.verdicts = [
        verdict._replace(head=known.heads[batch.room]) if isinstance(verdict, Appended) else verdict
        for batch, verdict in zip(batches, plan.verdicts, strict=True)
    ]
    return plan


def _append(batch: Batch, known: Known, plan: Plan, now: int, retention_us: int | None) -> Appended:
    room, agent = batch.room, batch.agent
    if room not in known.heads:
        raise NotFound(f"there is no room {room!r}", items=[ProblemItem(where="room", why="unknown room")])
    new = _new_items(batch, known)
    head = known.heads[room]
    horizon = _horizon(known, room, now, retention_us)
    too_late: list[int] = []
    for offset, item in enumerate(new, head + 1):
        late = horizon is not None and item.observed_at < horizon
        if late:
            too_late.append(item.seq)
        record = Record(room, offset, agent, item.seq, item.observed_at, now, item.kind, item.body, late)
        plan.records.append(record)
        for read in item.reads:
            if (room, read.tag) not in known.registered:
                _count_unknown(plan, agent, room, item, read)
    if new:
        known.heads[room] = plan.heads[room] = head + len(new)
        known.newest[room] = max(known.newest.get(room, new[0].observed_at), *(i.observed_at for i in new))
    known.agents[agent] = plan.agents[agent] = _seen(known.agents.get(agent), batch, new, now)
    return Appended(len(new), len(batch.items) - len(new), 0, too_late)


def _new_items(batch: Batch, known: Known) -> list[Item]:
    """The items that are not recorded yet. Raises ``Conflict`` naming those recorded with another body."""
    agent, room = batch.agent, batch.room
    new: dict[int, Item] = {}
    conflicts: list[ProblemItem] = []
    for index, item in enumerate(batch.items):
        earlier = new.get(item.seq)
        recorded = known.stored.get((agent, item.seq)) if earlier is None else (room, earlier.body)
        if recorded is None:
            new[item.seq] = item
        elif recorded != (room, item.body):
            why = "in another room" if recorded[0] != room else "with another body"
            where = f"observations/{index}"
            conflicts.append(
                ProblemItem(where=where, why=f"seq {item.seq} is recorded {why}", index=index, seq=item.seq)
            )
    if conflicts:
        first = conflicts[0]
        raise Conflict(f"{agent}: {first.why}; nothing of the batch was recorded", items=conflicts[:100])
    return list(new.values())


def _horizon(known: Known, room: str, now: int, retention_us: int | None) -> int | None:
    """Observations before it come too late. The room's own time counts, so that old data can be played again."""
    newest = known.newest.get(room)
    return None if retention_us is None or newest is None else min(newest, now) - retention_us


def _seen(facts: AgentFacts | None, batch: Batch, new: list[Item], now: int) -> AgentFacts:
    first, last = min(i.observed_at for i in batch.items), max(i.observed_at for i in batch.items)
    facts = facts or AgentFacts(batch.agent, batch.room, 0, 0, now, now, first, "connected", "")
    # A report of the device's state that comes after newer observations says nothing about now.
    states = [
        (item.observed_at, item.seq, item.state)
        for item in new
        if item.state is not None and item.observed_at >= facts.last_observed_at
    ]
    state, why = max(states)[2] if states else (facts.state, facts.why)
    return facts._replace(
        room=batch.room,
        next_seq=max(facts.next_seq, *(item.seq + 1 for item in batch.items)),
        received=facts.received + len(new),
        last_seen=now,
        last_observed_at=max(facts.last_observed_at, last),
        state=state,
        why=why,
    )


def _count_unknown(plan: Plan, agent: str, room: str, item: Item, read: TagRead) -> None:
    seen = UnknownRead(read.tag, room, agent, item.observed_at, item.observed_at, 1, read.label, read.x, read.y)
    earlier = plan.unknown.get((room, read.tag))
    plan.unknown[room, read.tag] = seen if earlier is None else merge(earlier, seen)


def merge(earlier: UnknownRead, later: UnknownRead) -> UnknownRead:
    """Both together; the place is that of the newer read, whatever the order of arrival."""
    newer = later if later.last_seen >= earlier.last_seen else earlier
    return newer._replace(
        first_seen=min(earlier.first_seen, later.first_seen),
        last_seen=newer.last_seen,
        reads=earlier.reads + later.reads,
    )
