"""What the log holds and in which order it is folded."""

from __future__ import annotations

from typing import NamedTuple

from tms_server.errors import TmsError

#: Registry records bear the agent ``@<room>``: no agent's name starts so.
REGISTRY_MARK = "@"


class Position(NamedTuple):
    """Place in fold order. ``observed_at`` is in microseconds since 1970, UTC; text compares by code point."""

    observed_at: int
    agent: str
    seq: int


#: Before every record.
ORIGIN = Position(-(2**63), "", -1)


class Record(NamedTuple):
    """One record. ``offset`` counts the room's records in order of commit, from 1, without gaps.

    ``kind`` is the observation's type, or ``registry``; ``body`` canonical JSON of the observation (or of the
    registry body). A ``late`` record arrived after the retention window: no belief is folded from it.
    """

    room: str
    offset: int
    agent: str
    seq: int
    observed_at: int
    received_at: int
    kind: str
    body: str
    late: bool = False

    @property
    def position(self) -> Position:
        return Position(self.observed_at, self.agent, self.seq)


class TagRead(NamedTuple):
    """A tag that an observation read, and where, as far as the observation itself says."""

    tag: str
    label: str | None
    x: float | None
    y: float | None


class Item(NamedTuple):
    """One observation on its way into the log."""

    seq: int
    observed_at: int
    kind: str
    body: str
    reads: tuple[TagRead, ...] = ()
    #: (state, why) of an ``agent_state`` observation.
    state: tuple[str, str] | None = None


class Batch(NamedTuple):
    """Observations of one agent in one room; recorded whole or not at all."""

    agent: str
    room: str
    items: list[Item]


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
