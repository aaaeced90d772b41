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
    written = []
    for some, late in _runs(batch, chosen, horizon):
        after += len(some)
        whole = len(some) == len(batch.observations)
        contents = batch.observations if whole else [batch.observations[i] for i in some]
        body = batch.body if whole and len(batch.body) <= _ROOMY * len(some) else _body(batch, contents)
        times = batch.times if whole else [batch.times[i] for i in some]
        seq, first_at, last_at = batch.seqs[some[0]], min(times), max(times)
        block = Block(
            batch.room, after, batch.agent, seq, len(some), first_at, last_at, received_at, late, body
        )  # fmt: skip
        written.append(Written(block, contents))
    return written


def records(block: Block, contents: Sequence[Content] | None = None) -> list[Record]:
    """The records of a block, in order of offset."""
    room, agent, received_at, late = block.room, block.agent, block.received_at, block.late
    found = []
    for i, content in enumerate(contents if contents is not None else _read(block)):
        observed_at = getattr(content, "observed_at", None)
        at = block.first_at if observed_at is None else to_us(observed_at)
        found.append(Record(room, block.before + 1 + i, agent, block.seq + i, at, received_at, content, late))
    return found


def _runs(batch: Batch, chosen: Sequence[int], horizon: int | None) -> list[tuple[Sequence[int], bool]]:
    seqs, times = batch.seqs, batch.times
    first, last = min(times), max(times)
    n = len(chosen)
    if (
        n == len(seqs)
        and last - first <= SPAN_US
        and (horizon is None or first >= horizon)
        and seqs == list(range(seqs[0], seqs[0] + n))
    ):
        return [(chosen, False)]  # nearly always
    runs: list[tuple[list[int], bool]] = []
    low = high = 0
    for i in chosen:
        late = horizon is not None and times[i] < horizon
        low, high = min(low, times[i]), max(high, times[i])
        if not runs or runs[-1][1] != late or seqs[i] != seqs[runs[-1][0][-1]] + 1 or high - low > SPAN_US:
            runs.append(([], late))
            low = high = times[i]
        runs[-1][0].append(i)
    return list(runs)


def _body(batch: Batch, observations: Sequence[Any]) -> str:
    some = ObservationBatch.model_construct(agent=batch.agent, room=batch.room, observations=list(observations))
    return some.model_dump_json(exclude_unset=True, by_alias=True)


def _read(block: Block) -> Sequence[Content]:
    try:
        if block.agent.startswith(REGISTRY_MARK):
            body: RegistryBody = registry_body.validate_json(block.body)
            return [body]
        return ObservationBatch.model_validate_json(block.body).observations
    except ValidationError as error:
        if block.agent.startswith(REGISTRY_MARK):
            return [_unreadable(from_json(block.body), error)]
        return [_lenient(item) for item in from_json(block.body)["observations"]]


def _lenient(item: dict[str, Any]) -> Content:
    """One observation of another version's block: unknown fields are left out."""
    try:
        return _observation.validate_json(to_json(item), extra="ignore")
    except ValidationError as error:
        return _unreadable(item, error)


def _unreadable(item: dict[str, Any], error: ValidationError) -> Unreadable:
    return Unreadable(kind=str(item.get("type", "?")), why=error.errors()[0]["msg"])
