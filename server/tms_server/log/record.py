"""What the log holds and in which order it is folded."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from tms_schemas.observation import AgentState, Observation
from tms_server.errors import TmsError
from tms_server.log.bodies import Content

#: Registry records bear the agent ``@<room>``: no agent's name starts so.
REGISTRY_MARK = "@"
#: ``kind`` of registry records.
REGISTRY = "registry"


class Position(NamedTuple):
    """Place in fold order. ``observed_at`` is in microseconds since 1970, UTC; text compares by code point."""

    observed_at: int
    agent: str
    seq: int


#: Before every record.
ORIGIN = Position(-(2**63), "", -1)


class Record(NamedTuple):
    """One record. ``offset`` counts the room's records in order of commit, from 1, without gaps.

    A ``late`` record arrived after the retention window: no belief is folded from it.
    """

    room: str
    offset: int
    agent: str
    seq: int
    observed_at: int
    received_at: int
    content: Content
    late: bool = False

    @property
    def position(self) -> Position:
        return Position(self.observed_at, self.agent, self.seq)

    @property
    def kind(self) -> str:
        """The observation's type, or ``registry``."""
        return REGISTRY if self.agent.startswith(REGISTRY_MARK) else self.content.type


class TagRead(NamedTuple):
    """A tag that an observation read, and where, as far as the observation itself says."""

    seq: int
    observed_at: int
    tag: str
    label: str | None
    x: float | None
    y: float | None


class Batch(NamedTuple):
    """Observations of one agent in one room; recorded whole or not at all.

    ``seqs`` are theirs, in the same order; ``first_at`` and ``last_at`` their smallest and largest time (microseconds
    UTC); ``reads`` all tags they read; ``states`` those that report a device's state. ``body``: an
    ``ObservationBatch`` as JSON, with exactly these observations.
    """

    agent: str
    room: str
    observations: Sequence[Observation]
    seqs: list[int]
    first_at: int
    last_at: int
    reads: list[TagRead]
    states: list[AgentState]
    body: str


class Appended(NamedTuple):
    """What became of a batch: new records, records that were there already, newest offset of the room.

    ``too_late`` lists the seq of new records that arrived after the retention window.
    """

    accepted: int
    duplicates: int
    head: int
    too_late: list[int]


#: A batch is appended or refused; one refusal does not touch the batches beside it.
Verdict = Appended | TmsError
