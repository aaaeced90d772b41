"""Barcode scanners in serial mode: sections of the configuration, and one way to open any of them."""

from __future__ import annotations

from collections.abc import AsyncGenerator, Sequence
from dataclasses import dataclass
from typing import Annotated, Literal

from pydantic import Field

from tms_agents.config import Section
from tms_agents.devices.lines import LineParser
from tms_agents.devices.transport import DeviceState, Link, serial, tcp
from tms_agents.readers import Port


@dataclass(frozen=True, slots=True)
class Scan:
    code: str


class SerialScanner(Section):
    """A scanner on a serial line, or on USB in COM mode."""

    kind: Literal["serial"]
    device: str
    baud: Annotated[int, Field(ge=300, le=4_000_000)] = 9600


class TcpScanner(Section):
    """A scanner on the network, or behind a serial device server."""

    kind: Literal["tcp"]
    host: str
    port: Port


ScannerSource = Annotated[SerialScanner | TcpScanner, Field(discriminator="kind")]


def open_scanner(source: SerialScanner | TcpScanner) -> AsyncGenerator[Sequence[Scan] | DeviceState, None]:
    if isinstance(source, SerialScanner):
        opener, name = serial(source.device, source.baud), f"scanner {source.device}"
    else:
        opener, name = tcp(source.host, source.port), f"scanner {source.host}:{source.port}"
    # Nothing comes until somebody scans: silence is no sign of a fault.
    return Link(opener, _Lines, name=name, silent_after_s=1e9, tick_s=0.05).listen()


class _Lines:
    def __init__(self) -> None:
        self.frames, self.ready = 0, True
        self._parser = LineParser()

    def opened(self) -> None:
        pass

    def receive(self, data: bytes) -> Sequence[Scan]:
        lines = self._parser.feed(data)
        self.frames += len(lines)
        return [Scan(line.decode("ascii", "replace")) for line in lines]

    def tick(self) -> None:
        pass

    def output(self) -> bytes:
        return b""

    def closing(self) -> bytes:
        return b""
