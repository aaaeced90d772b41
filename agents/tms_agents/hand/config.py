"""Configuration of ``tms agent hand``; examples are in ``examples`` beside this file."""

from __future__ import annotations

from typing import Literal

from tms_agents.config import AgentConfig, Seconds, Section
from tms_agents.readers import ReaderSource
from tms_agents.running import Heartbeat
from tms_schemas.base import Name


class VisitSection(Section):
    """A visit is a tag in view without a gap longer than ``gap_s``.

    ``count = "visits"`` posts each visit once, when it begins: the count in the unknown-tag list is how often the
    tag came. ``count = "reports"`` posts every report of the reader: the count is how often the reader reported it,
    whatever number of single reads a report sums up. The default is visits for a reader, which would otherwise flood
    the log, and reports for a capture, whose counts one wants to check against its bytes.
    """

    gap_s: Seconds = 2.0
    count: Literal["visits", "reports"] | None = None


class HandConfig(AgentConfig):
    source: ReaderSource
    #: Name of the zone that the reader covers, and names for single antennas that cover another one.
    zone: Name = "hand"
    zones: dict[str, Name] = {}
    visits: VisitSection = VisitSection()
    #: The device is called silent when nothing valid came for this long.
    silent_after_s: Seconds = 10.0
    #: The state of the device is posted again this often, so that a quiet agent is not taken for a dead one.
    heartbeat_s: Heartbeat = 10.0

    @property
    def counts_visits(self) -> bool:
        """Post a tag once per visit; otherwise at every report."""
        default = "reports" if self.source.kind == "capture" else "visits"
        return (self.visits.count or default) == "visits"

    def zone_of(self, antenna: int) -> str:
        return self.zones.get(str(antenna), self.zone)
