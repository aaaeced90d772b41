"""Blocks: how records lie in the database. One row holds a run of records that one agent sent together.

A row per record, with an index entry for each of its keys, costs several times what all the rest of an append costs.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

from pydantic import TypeAdapter, ValidationError
from pydantic_core import from_json, to_json

from tms_schemas.observation import MAX_BATCH, AnyObservation, Observation, ObservationBatch
from tms_server.db.times import to_us
from tms_server.log.bodies import Content, RegistryBody, Unreadable, registry_body
from tms_server.log.record import REGISTRY_MARK, Batch, Record

#: Most records of a block.
MOST_RECORDS = MAX_BATCH
#: Longest time between the first and the last observation of a block: what bounds how far a search must look back.
SPAN_US = 60_000_000
#: Bytes per observation above which a body is written anew: what was sent may be all white space.
_ROOMY = 600

_observation: TypeAdapter[Observation] = TypeAdapter(AnyObservation)


class Block(NamedTuple):
    """A row of ``log``, in the order of its columns: offsets and seqs run on without gaps, all late or none.

    ``offset`` is that of the last record, ``seq`` that of the first; ``first_at`` and ``last_at`` the smallest and the
    largest time of observation. ``body``: an ``ObservationBatch`` (or one registry body) as JSON.
    """

    room: str
    offset: int
    agent: str
    seq: int
    records: int
    first_at: int
    last_at: int
    received_at: int
    late: bool
    body: str

    @property
    def before(self) -> int:
        """The offset before its first record."""
        return self.offset - self.records


class Written(NamedTuple):
    """A block and what it says, so that this process need not read its body again."""

    block: Block
    contents: Sequence[Content]


def cut(batch: Batch, chosen: Sequence[int], after: int, received_at: int, horizon: int | None) -> list[Written]:
    """Blocks of the ``chosen`` observations (indices, not empty), for offsets that follow ``after``.

    Those observed before ``horizon`` are late.
    """
    if _is_one_run(batch, chosen, horizon):
        body = batch.body if len(batch.body) <= _ROOMY * len(chosen) else _body(batch, batch.observations)
        return [Written(_block(batch, batch.observations, after, received_at, False, body), batch.observations)]
    written = []
    for said, late in _runs([batch.observations[i] for i in chosen], horizon):
        written.append(Written(_block(batch, said, after, received_at, late, _body(batch, said)), said))
        after += len(said)
    return written


def records(block: Block, said: Sequence[Content] | None = None) -> list[Record]:
    """The records of a block, in order of offset; ``said``: its contents where they are known."""
    room, agent, received_at, late = block.room, block.agent, block.received_at, block.late
    found = []
    for i, content in enumerate(said if said is not None else contents(block)):
        observed_at = getattr(content, "observed_at", None)
        at = block.first_at if observed_at is None else to_us(observed_at)
        found.append(Record(room, block.before + 1 + i, agent, block.seq + i, at, received_at, content, late))
    return found


def contents(block: Block) -> Sequence[Content]:
    """What the records of a block say, from its body."""
    try:
        if block.agent.startswith(REGISTRY_MARK):
            body: RegistryBody = registry_body.validate_json(block.body)
            return [body]
        return ObservationBatch.model_validate_json(block.body).observations
    except ValidationError as error:
        if block.agent.startswith(REGISTRY_MARK):
            return [_unreadable(from_json(block.body), error)]
        return [_lenient(item) for item in from_json(block.body)["observations"]]


def _is_one_run(batch: Batch, chosen: Sequence[int], horizon: int | None) -> bool:
    """Nearly always: all of a batch, in order, on time."""
    seqs, n = batch.seqs, len(chosen)
    return (
        n == len(seqs)
        and batch.last_at - batch.first_at <= SPAN_US
        and (horizon is None or batch.first_at >= horizon)
        and seqs == list(range(seqs[0], seqs[0] + n))
    )


def _runs(observations: Sequence[Observation], horizon: int | None) -> list[tuple[list[Observation], bool]]:
    """Cut wherever seqs jump, lateness changes, or the time would span too much."""
    runs: list[tuple[list[Observation], bool]] = []
    low = high = 0
    for observation in observations:
        at = to_us(observation.observed_at)
        late = horizon is not None and at < horizon
        low, high = min(low, at), max(high, at)
        some, were_late = runs[-1] if runs else ([], late)
        if not some or were_late != late or observation.seq != some[-1].seq + 1 or high - low > SPAN_US:
            runs.append(([], late))
            low = high = at
        runs[-1][0].append(observation)
    return runs


def _block(batch: Batch, said: Sequence[Observation], after: int, received_at: int, late: bool, body: str) -> Block:
    if said is batch.observations:
        first_at, last_at = batch.first_at, batch.last_at
    else:
        times = [observation.observed_at for observation in said]
        first_at, last_at = to_us(min(times)), to_us(max(times))
    n = len(said)
    return Block(
        batch.room, after + n, batch.agent, said[0].seq, n, first_at, last_at, received_at, late, body
    )  # fmt: skip


def _body(batch: Batch, observations: Sequence[Any]) -> str:
    some = ObservationBatch.model_construct(agent=batch.agent, room=batch.room, observations=list(observations))
    return some.model_dump_json(exclude_unset=True, by_alias=True)


def _lenient(item: dict[str, Any]) -> Content:
    """One observation of another version's block: unknown fields are left out."""
    try:
        return _observation.validate_json(to_json(item), extra="ignore")
    except ValidationError as error:
        return _unreadable(item, error)


def _unreadable(item: dict[str, Any], error: ValidationError) -> Unreadable:
    return Unreadable(kind=str(item.get("type", "?")), why=error.errors()[0]["msg"])
