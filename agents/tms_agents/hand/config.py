"""Configuration of ``tms agent hand``; examples are in ``examples`` beside this file."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import AwareDatetime, Field

from tms_agents.config import AgentConfig, LocalPath, Seconds, Section
from tms_schemas.base import Name

Port = Annotated[int, Field(ge=1, le=65535)]


class LlrpSource(Section):
    """A UHF reader on the network."""

    kind: Literal["llrp"]
    host: str
    port: Port = 5084
    #: Antennas to read with; [0] means all.
    antennas: Annotated[list[Annotated[int, Field(ge=0, le=65535)]], Field(min_length=1, max_length=64)] = [0]
    keepalive_s: Seconds = 3.0
    #: Take the times of the reader's own clock instead of this computer's.
    reader_clock: bool = False


class _Tr3(Section):
    antennas: Annotated[list[Annotated[int, Field(ge=0, le=254)]], Field(min_length=1, max_length=64)] = [0]
    #: ``inventory`` polls; ``rdloop`` listens to a reader that was set to report by itself.
    mode: Literal["inventory", "rdloop"] = "inventory"
    poll_s: Seconds = 0.2


class Tr3SerialSource(_Tr3):
    """A Takaya TR3 on a serial line or USB."""

    kind: Literal["tr3-serial"]
    device: str
    baud: Annotated[int, Field(ge=300, le=4_000_000)] = 38400


class Tr3TcpSource(_Tr3):
    """A Takaya TR3 on the network."""

    kind: Literal["tr3-tcp"]
    host: str
    port: Port = 9004


class CaptureSource(Section):
    """Raw bytes of a reader in a file; an LLRP capture may hold both directions of the conversation."""

    kind: Literal["capture"]
    format: Literal["llrp", "tr3"]
    path: LocalPath
    #: Where the bytes carry no time: that of the first frame (default: when the file was written last), and the
    #: seconds from one frame to the next.
    start: AwareDatetime | None = None
    frame_s: Annotated[float, Field(ge=0, le=3600)] = 0.1


Source = Annotated[LlrpSource | Tr3SerialSource | Tr3TcpSource | CaptureSource, Field(discriminator="kind")]


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
    source: Source
    #: Name of the zone that the reader covers, and names for single antennas that cover another one.
    zone: Name = "hand"
    zones: dict[str, Name] = {}
    visits: VisitSection = VisitSection()
    #: The device is called silent when nothing valid came for this long.
    silent_after_s: Seconds = 10.0
    #: The state of the device is posted again this often, so that a quiet agent is not taken for a dead one.
    heartbeat_s: Annotated[float, Field(gt=0, le=3600)] = 10.0

    @property
    def counts_visits(self) -> bool:
        """Post a tag once per visit; otherwise at every report."""
        default = "reports" if self.source.kind == "capture" else "visits"
        return (self.visits.count or default) == "visits"

    def zone_of(self, antenna: int) -> str:
        return self.zones.get(str(antenna), self.zone)
