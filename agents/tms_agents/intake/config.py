"""Configuration of ``tms intake --config``: which reader, which scanner, which room."""

from __future__ import annotations

from tms_agents.config import Seconds, Section, Server
from tms_agents.intake.scanners import ScannerSource
from tms_agents.readers import ReaderSource
from tms_schemas.base import RoomId


class IntakeConfig(Section):
    server: Server = Server()
    #: Where the things go; without it, where the server saw their tags.
    room: RoomId | None = None
    #: Without a section the keyboard does it: a reader or scanner in keyboard mode, or a person who types.
    reader: ReaderSource | None = None
    scanner: ScannerSource | None = None
    #: A scan waits this long for its tag, and a tag for its scan.
    expires_s: Seconds = 60.0
    #: A tag counts when it was alone at the reader for this long.
    settle_s: Seconds = 0.5
    #: A tag that was not read for this long is no more at the reader.
    gone_s: Seconds = 2.0
    silent_after_s: Seconds = 10.0
