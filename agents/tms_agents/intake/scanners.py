"""Barcode scanners in serial mode: sections of the configuration, and one way to open any of them."""

from __future__ import annotations

from collections.abc import AsyncGenerator, Sequence
from typing import Annotated, Literal

from pydantic import Field

from tms_agents.config import Section
from tms_agents.devices.scanner import Misread, Scan, ScannerSession
from tms_agents.devices.transport import DeviceState, Link, serial, tcp
from tms_agents.readers import Port


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
    return Link(opener, ScannerSession, name=name).listen()
