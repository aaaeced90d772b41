"""From the bytes of a request to a batch that may enter the log."""

from __future__ import annotations

from typing import Any

from pydantic import ValidationError
from pydantic_core import from_json

from tms_schemas.observation import (
    Handover,
    Inventory,
    LabelAppeared,
    Observation,
    ObservationBatch,
    RawRead,
    TagObserved,
    labels_named,
)
from tms_schemas.problem import ProblemItem
from tms_server import problems
from tms_server.db.times import to_us
from tms_server.errors import Invalid, TmsError
from tms_server.log.record import Batch, TagRead

#: Problems reported of one batch.
_MOST_PROBLEMS = 100


def admit(body: bytes) -> Batch:
    """Parse, validate and reduce a batch to what the log stores.

    Raises:
        BadRequest: no JSON.
        Invalid: not a batch; the items are named by index and seq.
    """
    try:
        batch = ObservationBatch.model_validate_json(body)
    except ValidationError as error:
        raise _naming_seq(problems.from_pydantic(error), body) from None
    foreign = _foreign_labels(batch)
    if foreign:
        raise Invalid(f"{foreign[0].where}: {foreign[0].why}", items=foreign[:_MOST_PROBLEMS])
    observations = batch.observations
    times = [observation.observed_at for observation in observations]
    return Batch(
        batch.agent,
        batch.room,
        observations,
        [observation.seq for observation in observations],
        to_us(min(times)),
        to_us(max(times)),
        [read for o in observations if o.type in _READS for read in _tag_reads(o)],
        [o for o in observations if o.type == "agent_state"],
        body.decode(),
    )


def _tag_reads(observation: Observation) -> list[TagRead]:
    """The tags it read, each once."""
    found: list[tuple[str, str | None, tuple[float, float] | None]]
    match observation:
        case TagObserved(tag=tag, label=label):
            found = [(tag, label, None)]
        case LabelAppeared(tag=str(tag), label=label, xy=xy):
            found = [(tag, label, xy)]
        case RawRead(tag=str(tag)) | Handover(tag=str(tag)):
            found = [(tag, None, None)]
        case Inventory(labels=labels):
            found = list(
                {item.tag: (item.tag, item.label, item.xy) for item in labels if item.tag is not None}.values()
            )
        case _:
            return []
    seq, at = observation.seq, to_us(observation.observed_at)
    return [TagRead(seq, at, tag, label, *(xy or (None, None))) for tag, label, xy in found]


#: Types that may read a tag; asking for the class of every observation would cost more than all the rest.
_READS = frozenset({"label_appeared", "tag_observed", "raw_read", "handover", "inventory"})


def _foreign_labels(batch: ObservationBatch) -> list[ProblemItem]:
    """An agent names its own labels only; what it knows of others it gives as positions."""
    own = batch.agent + "/"
    found = []
    for index, observation in enumerate(batch.observations):
        for label in labels_named(observation):
            if not label.startswith(own) or label == own:
                why = f"label {label!r} is not one of agent {batch.agent} ({own}...)"
                where = f"observations/{index}"
                found.append(ProblemItem(where=where, why=why, index=index, seq=observation.seq))
    return found


def _naming_seq(error: TmsError, body: bytes) -> TmsError:
    """The same problem with the seq of each named item, where the item has a readable one."""
    if any(item.index is not None for item in error.items):
        document: Any = from_json(body)
        for item in error.items:
            if item.index is not None:
                observation = document["observations"][item.index]
                seq = observation.get("seq") if isinstance(observation, dict) else None
                item.seq = seq if isinstance(seq, int) and not isinstance(seq, bool) else None
    return error
