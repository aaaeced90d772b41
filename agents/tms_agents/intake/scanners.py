"""Barcode scanners in serial mode: sections of the configuration, and one way to open any of them."""

from __future__ import annotations

from collections.abc import AsyncGenerator, Sequence
from dataclasses import dataclass
from typing import Annotated, Literal

from pydantic import Field

from tms_agents.config import Section
from tms_agents.devices.scanner import Scan, ScannerSession
from tms_agents.devices.transport import DeviceState, Link, serial, tcp
from tms_agents.readers import Port


@dataclass(frozen=True, slots=True)
class Misread:
    """A line that is no product code, or one that was read wrongly."""

    text: str


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


def open_scanner(
    source: SerialScanner | TcpScanner,
) -> AsyncGenerator[Sequence[Scan | Misread] | DeviceState, None]:
    """Listen to a scanner for ever, through every failure of it."""
    if isinstance(source, SerialScanner):
        opener, name = serial(source.device, source.baud), f"scanner {source.device}"
    else:
        opener, name = tcp(source.host, source.port), f"scanner {source.host}:{source.port}"
    return Link(opener, _Session, name=name, tick_s=0.05).listen()


class _Session:
    """``ScannerSession`` that tells what it refused: whoever scans wants to know."""

    ready = True

    def __init__(self) -> None:
        self._scanner = ScannerSession()

    @property
    def frames(self) -> int:
        return self._scanner.frames

    def opened(self) -> None:
        self._scanner.opened()

    def receive(self, data: bytes) -> list[Scan | Misread]:
        before = self._scanner.refusals
        scans: list[Scan | Misread] = [*self._scanner.receive(data)]
        # Behind the scans of the same bytes: whichever came first, then none of them is kept.
        return [*scans, Misread(self._scanner.refused)] if self._scanner.refusals > before else scans

    def tick(self) -> None:
        self._scanner.tick()

    def output(self) -> bytes:
        return b""

    def closing(self) -> bytes:
        return b""
