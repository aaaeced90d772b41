"""What every tag reader delivers."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import datetime


@dataclass(frozen=True, kw_only=True, slots=True)
class TagRead:
    """One report of a reader about one tag.

    ``tag`` is upper-case hex; ``antenna`` counts as the reader does. ``first_seen`` and ``last_seen`` are the reader's
    own UTC clock, None where it has none; ``count`` is the number of single reads the report sums up.
    """

    tag: str
    antenna: int = 0
    rssi_dbm: float | None = None
    first_seen: datetime | None = None
    last_seen: datetime | None = None
    count: int = 1


@dataclass(frozen=True, slots=True)
class RoundEnd:
    """An antenna has been asked for all its tags: what was not read since its last round is not in its field.

    Delivered behind the reads of the round, and only for rounds that ran to their end: a round cut short by a fault, a
    lost reply or a field that is off is no statement about absence.
    """

    antenna: int


TagItem = TagRead | RoundEnd
