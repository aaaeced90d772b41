"""Section of a device on a line of its own: where it is plugged in, and how that is opened."""

from __future__ import annotations

from typing import Annotated, ClassVar

from pydantic import Field, model_validator

from tms_agents.config import Section
from tms_agents.devices.transport import Opener, serial, tcp
from tms_agents.readers import Port

Baud = Annotated[int, Field(ge=300, le=4_000_000)]


class Line(Section):
    """A serial device (``device``, ``baud``) or the same behind a TCP converter (``host``, ``port``)."""

    device: str | None = None
    baud: Baud | None = None
    host: str | None = None
    port: Port | None = None

    default_port: ClassVar[int | None] = None

    @model_validator(mode="after")
    def _one_way(self) -> Line:
        if (self.device is None) == (self.host is None):
            raise ValueError("give either device (serial) or host and port (TCP)")
        if self.host is not None and self.port is None and self.default_port is None:
            raise ValueError("host needs port")
        if self.host is not None and self.baud is not None:
            raise ValueError("baud belongs to a serial device, not to host")
        return self

    @property
    def place(self) -> str:
        return self.device or f"{self.host}:{self.port or self.default_port}"

    def opener(self, baud: int, *, bits: int = 8, parity: str = "N") -> Opener:
        if self.device is not None:
            return serial(self.device, self.baud or baud, bits=bits, parity=parity)
        port = self.port or self.default_port
        assert self.host is not None and port is not None
        return tcp(self.host, port)
