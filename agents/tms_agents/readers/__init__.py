"""Tag readers as agents use them: sections of the configuration, and one way to open any of them."""

from tms_agents.readers.config import (
    CaptureSource,
    LlrpSource,
    Port,
    ReaderSource,
    TextSerialSource,
    TextTcpSource,
    ThingMagicSource,
    Tr3SerialSource,
    Tr3TcpSource,
)
from tms_agents.readers.opening import Arrival, Seen, can_pause, open_reader, tells_rounds

__all__ = [
    "Arrival",
    "CaptureSource",
    "LlrpSource",
    "Port",
    "ReaderSource",
    "Seen",
    "TextSerialSource",
    "TextTcpSource",
    "ThingMagicSource",
    "Tr3SerialSource",
    "Tr3TcpSource",
    "can_pause",
    "open_reader",
    "tells_rounds",
]
