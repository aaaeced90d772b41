"""What an append transaction reads, and what it decides to write: pure, the same for both databases.

One transaction takes the batches of many agents. It reads the few facts it needs (``Known``), ``decide`` turns them
into rows and verdicts (``Plan``), and the store writes the rows. A refused batch leaves no trace.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

from tms_schemas.observation import Observation
from tms_schemas.problem import ProblemItem
from tms_server.db.times import to_us
from tms_server.errors import Conflict, NotFound, TmsError
from tms_server.log.blocks import Written, cut
from tms_server.log.bodies import Content
from tms_server.log.record import Appended, Batch, TagRead, Verdict


class RoomFacts(NamedTuple):
    """Newest offset and newest time of observation (None before the first) of a room."""

    head: int
    newest_at: int | None


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

    rooms: dict[str, RoomFacts]
    agents: dict[str, AgentFacts]
    #: (agent, seq) -> room and content of recorded observations that the batches name again
    stored: dict[tuple[str, int], tuple[str, Content]]
    #: (room, tag) of the tags read that are registered there
    registered: set[tuple[str, str]]


@dataclass(slots=True)
class Plan:
    verdicts: list[Verdict]
    blocks: list[Written] = field(default_factory=list)
    rooms: dict[str, RoomFacts] = field(default_factory=dict)
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
                known.stored |= {(batch.agent, o.seq): (batch.room, o) for o in batch.observations}
            plan.verdicts.append(appended)
        except TmsError as refusal:
            plan.verdicts.append(refusal)
    # Every batch of a room is answered with the room's newest offset, which they all reached together.
    plan.verdicts = [
        verdict._replace(head=known.rooms[batch.room].head) if isinstance(verdict, Appended) else verdict
        for batch, verdict in zip(batches, plan.verdicts, strict=True)
    ]
    return plan


def _append(batch: Batch, known: Known, plan: Plan, now: int, retention_us: int | None) -> Appended:
    room, agent = batch.room, batch.agent
    facts = known.rooms.get(room)
    if facts is None:
        raise NotFound(f"there is no room {room!r}", items=[ProblemItem(where="room", why="unknown room")])
    new = _new(batch, known)
    too_late: list[int] = []
    if new:
        blocks = cut(batch, new, facts.head, now, _horizon(facts, now, retention_us))
        plan.blocks += blocks
        too_late = [block.seq + i for block, _ in blocks if block.late for i in range(block.records)]
        newest_at = max(block.last_at for block, _ in blocks)
        newest_at = newest_at if facts.newest_at is None else max(newest_at, facts.newest_at)
        known.rooms[room] = plan.rooms[room] = RoomFacts(facts.head + len(new), newest_at)
    fresh = set(batch.seqs) if len(new) == len(batch.seqs) else {batch.seqs[i] for i in new}
    for read in batch.reads:
        if (room, read.tag) not in known.registered and read.seq in fresh:
            _count_unknown(plan, agent, room, read)
    known.agents[agent] = plan.agents[agent] = _seen(known.agents.get(agent), batch, fresh, now)
    return Appended(len(new), len(batch.seqs) - len(new), 0, too_late)


def _new(batch: Batch, known: Known) -> Sequence[int]:
    """Indices of what is not recorded yet. Raises ``Conflict`` naming what is recorded with another body."""
    agent, room, seqs = batch.agent, batch.room, batch.seqs
    facts = known.agents.get(agent)
    if (facts is None or min(seqs) >= facts.next_seq) and len(set(seqs)) == len(seqs):
        return range(len(seqs))  # nearly always
    new: dict[int, Observation] = {}
    chosen: list[int] = []
    conflicts: list[ProblemItem] = []
    for index, (seq, observation) in enumerate(zip(seqs, batch.observations, strict=True)):
        recorded = (room, new[seq]) if seq in new else known.stored.get((agent, seq))
        if recorded is None:
            new[seq] = observation
            chosen.append(index)
        elif recorded[0] != room or _said(recorded[1]) != _said(observation):
            why = "in another room" if recorded[0] != room else "with another body"
            where = f"observations/{index}"
            conflicts.append(ProblemItem(where=where, why=f"seq {seq} is recorded {why}", index=index, seq=seq))
    if conflicts:
        first = conflicts[0]
        raise Conflict(f"{agent}: {first.why}; nothing of the batch was recorded", items=conflicts[:100])
    return chosen


def _said(content: Content) -> str:
    """What was sent, no more: a tag that is null and a tag that is absent are different observations."""
    return content.model_dump_json(exclude_unset=True, by_alias=True)


def _horizon(room: RoomFacts, now: int, retention_us: int | None) -> int | None:
    """Observations before it come too late. The room's own time counts, so that old data can be played again."""
    return None if retention_us is None or room.newest_at is None else min(room.newest_at, now) - retention_us


def _seen(facts: AgentFacts | None, batch: Batch, fresh: Collection[int], now: int) -> AgentFacts:
    """``fresh``: the numbers of what was not recorded before."""
    facts = facts or AgentFacts(batch.agent, batch.room, 0, 0, now, now, batch.first_at, "connected", "")
    # A report of the device's state that comes after newer observations says nothing about now.
    states = [
        (at, reported.seq, reported.state, reported.why)
        for reported in batch.states
        if (at := to_us(reported.observed_at)) >= facts.last_observed_at and reported.seq in fresh
    ]
    _, _, state, why = max(states) if states else (0, 0, facts.state, facts.why)
    return facts._replace(
        room=batch.room,
        next_seq=max(facts.next_seq, max(batch.seqs) + 1),
        received=facts.received + len(fresh),
        last_seen=now,
        last_observed_at=max(facts.last_observed_at, batch.last_at),
        state=state,
        why=why.replace("\0", ""),
    )


def _count_unknown(plan: Plan, agent: str, room: str, read: TagRead) -> None:
    seen = UnknownRead(read.tag, room, agent, read.observed_at, read.observed_at, 1, read.label, read.x, read.y)
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
