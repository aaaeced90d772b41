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


class Field:
    """The RF field of a reader as someone beside it needs it: load cells are disturbed by it, so weighing pauses it.

    One object is shared by all sessions of a link, so that a reader that reconnects does not radiate into a weighing.
    """

    def __init__(self) -> None:
        self.wanted = True
        #: What the session knows: True only after the reader confirmed that it does not radiate.
        self.is_off = False

    def pause(self) -> None:
        """Ask for silence; the round under way is broken off. ``is_off`` tells when it is reached."""
        self.wanted = False

    def resume(self) -> None:
        self.wanted, self.is_off = True, False
