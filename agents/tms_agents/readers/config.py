"""Sections that say which tag reader an agent uses; shared by the hand, the cabinet and the intake."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import AwareDatetime, Field

from tms_agents.config import LocalPath, Seconds, Section

Port = Annotated[int, Field(ge=1, le=65535)]


class LlrpSource(Section):
    """A UHF reader on the network."""

    kind: Literal["llrp"]
    host: str
    port: Port = 5084
    #: Antennas to read with; [0] means all.
    antennas: Annotated[list[Annotated[int, Field(ge=0, le=65535)]], Field(min_length=1, max_length=64)] = [0]
    keepalive_s: Seconds = 3.0
    #: Antennas take turns of this length, and the end of each is told; without it they read together, without rounds.
    round_s: Seconds | None = None
    #: Take the times of the reader's own clock instead of this computer's.
    reader_clock: bool = False


class _Tr3(Section):
    antennas: Annotated[list[Annotated[int, Field(ge=0, le=254)]], Field(min_length=1, max_length=64)] = [0]
    #: ``inventory`` polls; ``rdloop`` listens to a reader that was set to report by itself.
    mode: Literal["inventory", "rdloop"] = "inventory"
    poll_s: Seconds = 0.2
    #: Radiate only while reading; ``rest_antenna`` is one with nothing connected, selected meanwhile.
    rf_off_between_rounds: bool = False
    rest_antenna: Annotated[int, Field(ge=0, le=254)] | None = None


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


class ThingMagicSource(Section):
    """A ThingMagic M5e or M6e module (UHF) on a serial line."""

    kind: Literal["thingmagic"]
    device: str
    baud: Annotated[int, Field(ge=300, le=4_000_000)] = 115200
    antennas: Annotated[list[Annotated[int, Field(ge=1, le=255)]], Field(min_length=1, max_length=64)] = [1]
    #: Decides on the legal frequencies.
    region: Literal["NA", "EU", "KR", "IN", "JP", "PRC", "EU2", "EU3", "KR2", "OPEN"] = "JP"
    #: The reader's own where it is not given.
    power_dbm: Annotated[float, Field(ge=-20, le=40)] | None = None
    #: ``multiple`` collects all tags of a read; ``single`` reads one at a time.
    mode: Literal["multiple", "single"] = "multiple"
    read_ms: Annotated[int, Field(ge=10, le=10_000)] = 200
    poll_s: Seconds = 0.5


class _Text(Section):
    #: ``lines`` end with the hex digits of a tag; ``rdm6300`` frames are those of 125 kHz modules.
    form: Literal["lines", "rdm6300"] = "lines"
    #: Some readers print the UID with its bytes reversed.
    order: Literal["as printed", "reversed"] = "as printed"


class TextSerialSource(_Text):
    """A reader that prints what it reads, on a serial line or USB."""

    kind: Literal["text-serial"]
    device: str
    baud: Annotated[int, Field(ge=300, le=4_000_000)] = 9600


class TextTcpSource(_Text):
    """A reader that prints what it reads, on the network or behind a serial server."""

    kind: Literal["text-tcp"]
    host: str
    port: Port


class CaptureSource(Section):
    """Raw bytes of a reader in a file; an LLRP capture may hold both directions of the conversation."""

    kind: Literal["capture"]
    format: Literal["llrp", "tr3"]
    path: LocalPath
    #: Where the bytes carry no time: that of the first frame (default: when the file was written last), and the
    #: seconds from one frame to the next.
    start: AwareDatetime | None = None
    frame_s: Annotated[float, Field(ge=0, le=3600)] = 0.1


ReaderSource = Annotated[
    LlrpSource | Tr3SerialSource | Tr3TcpSource | ThingMagicSource | TextSerialSource | TextTcpSource | CaptureSource,
    Field(discriminator="kind"),
]
