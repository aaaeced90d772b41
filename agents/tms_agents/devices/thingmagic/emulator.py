"""A ThingMagic M5e for tests and demos, byte for byte; ``devices.emulation`` puts it behind a line."""

from __future__ import annotations

from tms_agents.devices.tags import TagRead
from tms_agents.devices.thingmagic import messages as m
from tms_agents.devices.thingmagic.codec import Command, CommandParser, Reply

#: Boot loader, hardware, date and version of the firmware, protocols: those of a real M5e.
_VERSION = bytes.fromhex("0710230001000003201410070107020900000010")
_MAX_POWER, _MIN_POWER = 2300, 1000
_FRAME_ROOM = 248


class ThingMagicDevice:
    """The module without its line: bytes in, bytes out.

    It starts in its boot loader and refuses all but ``boot`` there. ``silent``, ``fail`` (status by command code) and
    ``power_cycle_after`` play faults.
    """

    def __init__(self, antennas: int = 2) -> None:
        self.tags: dict[int, dict[str, TagRead]] = {antenna: {} for antenna in range(1, antennas + 1)}
        #: Ports with an antenna; reading with another one fails.
        self.connected = set(self.tags)
        self.silent = False
        self.fail: dict[int, int] = {}
        #: So many bytes of the next answers still get out, then the supply fails and returns; while the module starts,
        #: it hears nothing.
        self.power_cycle_after: int | None = None
        self.power_cycles = 0
        #: Commands received; the last thousand.
        self.heard: list[Command] = []
        #: Boot loaders of later modules start the firmware by themselves.
        self.boots_itself = False
        self._restart()
        self._starting = False

    def see(self, tag: str, antenna: int = 1, *, rssi_dbm: float = -50.0, count: int = 1) -> None:
        """A tag (EPC in hex) comes before an antenna."""
        self.tags[antenna][tag.upper()] = TagRead(tag=tag.upper(), antenna=antenna, rssi_dbm=rssi_dbm, count=count)

    def lose(self, tag: str) -> None:
        for tags in self.tags.values():
            tags.pop(tag.upper(), None)

    def receive(self, data: bytes) -> bytes:
        """The answer to what the host sent."""
        if self._starting:
            self._starting = False
            return b""
        answer = b"".join(self._answer(command).encode() for command in self._parser.feed(data))
        if self.power_cycle_after is not None and len(answer) >= self.power_cycle_after:
            answer, self.power_cycle_after = answer[: self.power_cycle_after], None
            self.power_cycles += 1
            self._restart()
        elif self.power_cycle_after is not None:
            self.power_cycle_after -= len(answer)
        return b"" if self.silent else answer

    def _restart(self) -> None:
        self._starting = True
        self._boot_loader = not self.boots_itself
        self._antenna, self._protocol, self._region, self._power_mode = 1, 0, 0, 0
        self._power = _MAX_POWER
        self._buffer: list[TagRead] = []
        self._parser = CommandParser()

    def _answer(self, command: Command) -> Reply:
        self.heard.append(command)
        del self.heard[:-1000]
        if status := self.fail.get(command.code):
            return Reply(command.code, b"", status)
        if command.code == m.VERSION:
            return Reply(m.VERSION, _VERSION)
        if self._boot_loader is not (command.code == m.BOOT):
            return Reply(command.code, b"", m.INVALID_COMMAND)
        if command.code == m.BOOT:
            self._boot_loader = False
            return Reply(m.BOOT, _VERSION)
        if command.code in (m.READ_SINGLE, m.READ_MULTIPLE, m.GET_BUFFER, m.CLEAR_BUFFER):
            status, data = self._read(command)
        else:
            status, data = self._setting(command)
        return Reply(command.code, data, status)

    def _read(self, command: Command) -> tuple[int, bytes]:
        if command.code == m.CLEAR_BUFFER:
            self._buffer.clear()
            return m.OK, b""
        if command.code == m.GET_BUFFER:
            return self._fetch()
        if self._protocol != m.GEN2:
            return 0x0401, b""
        if self._antenna not in self.connected:
            return 0x0503, b""
        found = list(self.tags[self._antenna].values())
        if not found:
            return m.NO_TAGS, b""
        if command.code == m.READ_SINGLE:
            return m.OK, bytes.fromhex(found[0].tag) + b"\xd1\x00"
        known = {(read.tag, read.antenna) for read in self._buffer}
        self._buffer += [read for read in found if (read.tag, read.antenna) not in known]
        return m.OK, command.data[:3] + bytes([len(found)])

    def _fetch(self) -> tuple[int, bytes]:
        if not self._buffer:
            return m.NO_TAGS, b""
        fits = 0
        while fits < len(self._buffer) and len(m.encode_buffered(self._buffer[: fits + 1])) <= _FRAME_ROOM:
            fits += 1
        out, self._buffer = self._buffer[:fits], self._buffer[fits:]
        return m.OK, m.encode_buffered(out)

    def _setting(self, command: Command) -> tuple[int, bytes]:
        value = int.from_bytes(command.data, "big")
        if command.code == m.SET_REGION:
            self._region = value
            return (m.OK if value in m.REGIONS.values() else 0x010B), b""
        if command.code == m.SET_PROTOCOL:
            self._protocol = value
            return m.OK, b""
        if command.code == m.SET_READ_POWER:
            if not _MIN_POWER <= value <= _MAX_POWER:
                return (0x0103 if value > _MAX_POWER else 0x0106), b""
            self._power = value
            return m.OK, b""
        if command.code == m.SET_POWER_MODE:
            self._power_mode = value
            return m.OK, b""
        if command.code == m.SET_ANTENNA:
            if len(command.data) != 2 or command.data[0] not in self.tags:
                return 0x0507, b""
            self._antenna = command.data[0]
            return m.OK, b""
        return self._getting(command)

    def _getting(self, command: Command) -> tuple[int, bytes]:
        if command.code == m.GET_PROTOCOL:
            return m.OK, self._protocol.to_bytes(2, "big")
        if command.code == m.GET_REGION:
            return m.OK, bytes([self._region])
        if command.code == m.GET_POWER_MODE:
            return m.OK, bytes([self._power_mode])
        if command.code == m.GET_READ_POWER:
            power = (self._power, _MAX_POWER, _MIN_POWER) if command.data == b"\x01" else (self._power,)
            return m.OK, command.data[:1] + b"".join(one.to_bytes(2, "big") for one in power)
        if command.code == m.GET_ANTENNA and command.data == b"\x01":
            return m.OK, b"\x01" + bytes(antenna in self.connected for antenna in self.tags)
        return 0x0102, b""
