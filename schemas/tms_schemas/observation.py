"""What an agent posts: one observation is an envelope (seq, observed_at) around a core event or an agent report."""

from __future__ import annotations

from typing import Annotated, Literal, get_args

from pydantic import Field, model_validator

from tms_schemas import events
from tms_schemas.base import AgentId, LabelId, Model, Name, Pose, RoomId, Tag, UtcTime
from tms_schemas.events import Kind, Placed

#: Largest sequence number: it and its successor fit the signed 64 bit integers of both databases.
MAX_SEQ = 2**63 - 2
MAX_BATCH = 1000


class Envelope(Model):
    """``seq`` is the agent's own running number; ``observed_at`` the time of the sensor."""

    seq: Annotated[int, Field(ge=0, le=MAX_SEQ, strict=True)]
    observed_at: UtcTime


class LabelAppeared(Envelope, events.LabelAppeared):
    pass


class LabelVanished(Envelope, events.LabelVanished):
    pass


class LabelMoved(Envelope, events.LabelMoved):
    pass


class MoverEntered(Envelope, events.MoverEntered):
    pass


class MoverLeft(Envelope, events.MoverLeft):
    pass


class TagObserved(Envelope, events.TagObserved):
    pass


class TagMissed(Envelope, events.TagMissed):
    pass


class Handover(Envelope, events.Handover):
    pass


class HandoverPossible(Envelope, events.HandoverPossible):
    pass


class MoverSwap(Envelope, events.MoverSwap):
    pass


class Transfer(Envelope, events.Transfer):
    pass


class LoadChange(Envelope, events.LoadChange):
    pass


class Correction(Envelope, events.Correction):
    pass


class InventoryLabel(Placed):
    """One label the agent has now; ``tag`` where its reader knows it."""

    label: LabelId
    kind: Kind
    tag: Tag | None = None


class Inventory(Envelope):
    """All labels the agent has now, sent when it (re)connects: the server adds, moves and drops to match."""

    type: Literal["inventory"] = "inventory"
    labels: Annotated[list[InventoryLabel], Field(max_length=10_000)]

    @model_validator(mode="after")
    def _unique(self) -> Inventory:
        if len({item.label for item in self.labels}) != len(self.labels):
            raise ValueError("a label is listed twice")
        return self


class RawRead(Envelope):
    """A reader that covers several labels saw ``tag`` in its zone, or nothing (null). Once per visit and outcome."""

    type: Literal["raw_read"] = "raw_read"
    zone: Name
    tag: Tag | None


class PoseReport(Envelope):
    """Where the agent's own mover (a robot's body) is."""

    type: Literal["pose"] = "pose"
    label: LabelId
    pose: Pose


class AgentState(Envelope):
    """The state of the agent's device; changes no belief."""

    type: Literal["agent_state"] = "agent_state"
    state: Literal["connected", "silent", "faulty"]
    why: Annotated[str, Field(max_length=500)] = ""


Observation = (
    LabelAppeared
    | LabelVanished
    | LabelMoved
    | MoverEntered
    | MoverLeft
    | TagObserved
    | TagMissed
    | Handover
    | HandoverPossible
    | MoverSwap
    | Transfer
    | LoadChange
    | Correction
    | Inventory
    | RawRead
    | PoseReport
    | AgentState
)
AnyObservation = Annotated[Observation, Field(discriminator="type")]


def labels_named(observation: Observation) -> list[str]:
    """Every label that the observation names; on the wire all of them must be the agent's own."""
    fields = _LABEL_FIELDS[type(observation)]
    if fields == ("label",):  # most observations
        return [observation.label]  # type: ignore[union-attr,list-item]
    if isinstance(observation, Inventory):
        return [item.label for item in observation.labels]
    names: list[str] = []
    for field in fields:
        value = getattr(observation, field)
        if isinstance(value, str):
            names.append(value)
        elif isinstance(value, list):
            names.extend(value)
    return names


#: Fields of each type that name labels; a mover may also be given as ``Near``, which names none.
_LABEL_FIELDS: dict[type[Model], tuple[str, ...]] = {
    kind: tuple(f for f in ("label", "labels", "source", "dest", "from_", "to", "a", "b") if f in kind.model_fields)
    for kind in get_args(Observation)
}


class ObservationBatch(Model):
    """One agent, one room; accepted whole or not at all."""

    agent: AgentId
    room: RoomId
    observations: Annotated[list[AnyObservation], Field(min_length=1, max_length=MAX_BATCH)]


class BatchAccepted(Model):
    """Answer to a batch, sent only after it is durable. ``head`` is the room log's newest offset."""

    accepted: int
    duplicates: int
    head: int
    #: seq of items older than the room's retention window: recorded, but they change no belief.
    too_late: list[int] = []
