"""Tags in view as raw reads: each report, or each that begins a visit."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import dataclass, field

from pydantic import ValidationError

from tms_agents.hand.visits import Visits
from tms_agents.readers import Seen
from tms_agents.running import Posted
from tms_schemas.observation import RawRead

log = logging.getLogger(__name__)

#: Tags that a tally names; a reader that reads nonsense fills no memory.
_MOST_TAGS = 100_000


@dataclass(slots=True)
class Tally(Posted):
    """What a run did. ``unusable`` tags have ids that the wire cannot carry (longer than 64 hex digits)."""

    reports: int = 0
    tags: set[str] = field(default_factory=set)
    unusable: set[str] = field(default_factory=set)

    def in_words(self) -> str:
        return f"{self.reports} reports of {len(self.tags)} tags, {Posted.in_words(self)}"


class Sightings:
    """``each``: every report is told, not only the first of a visit."""

    def __init__(self, gap_s: float, tally: Tally, *, each: bool) -> None:
        self._visits, self._tally, self._each = Visits(gap_s), tally, each

    def see(self, seen: Seen, zone: str) -> Sequence[RawRead]:
        """What one report of a reader tells."""
        tag, tally = seen.read.tag, self._tally
        tally.reports += 1
        begins = self._visits.see(zone, tag, seen.first, seen.last)
        if not begins and not self._each:
            return ()
        try:
            read = RawRead(seq=0, observed_at=seen.first, zone=zone, tag=tag)
        except ValidationError:
            if tag not in tally.unusable and len(tally.unusable) < _MOST_TAGS:
                log.warning("tag %s cannot be posted: its id has more than 64 digits", tag)
                tally.unusable.add(tag)
            return ()
        if len(tally.tags) < _MOST_TAGS:
            tally.tags.add(tag)
        return (read,)
