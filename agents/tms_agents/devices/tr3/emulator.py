"""A TR3 for tests and demos, byte for byte; ``devices.emulation`` puts it behind a terminal or a TCP port."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterable

from tms_agents.devices.tr3.codec import (
    ACK,
    FORMAT_ERROR,
    INVENTORY,
    INVENTORY_OPTIONS,
    MODE,
    NACK,
    RDLOOP,
    READ,
    SUM_ERROR,
    UID,
    Frame,
    FrameParser,
)

_RDLOOP_MODE = 0x58


class Tr3Device:
    """The reader without its line: bytes in, bytes out.

    A UID is reported once until the antenna is switched, as the real one does. With the field off nothing is read.
    ``tick`` sends what a reader in RDLOOP mode sends by itself. ``silent``, ``nack_next`` (with ``nack_code``) and
    ``power_cycle_after`` play faults; ``inventory_options``, ``switches_antennas`` and ``forgets_without_field`` are
    differences between models.
    """

    def __init__(self, antennas: int = 2) -> None:
        self.tags: dict[int, list[str]] = {antenna: [] for antenna in range(antennas)}
        #: For a simulation: asked at every round what stands before the antenna, instead of ``tags``.
        self.look: Callable[[int], Iterable[str]] | None = None
        self.inventory_options: tuple[int, ...] = INVENTORY_OPTIONS
        self.switches_antennas = True
        #: Whether switching the field off makes tags answer again.
        self.forgets_without_field = False
        self.silent = False
        self.nack_next = 0
        self.nack_code = FORMAT_ERROR
        #: So many bytes of the next answers still get out, then the supply fails and returns; while the reader starts,
        #: it hears nothing.
        self.power_cycle_after: int | None = None
        self.power_cycles = 0
        #: Commands received, for tests; the last thousand.
        self.heard: list[Frame] = []
        self.antenna, self.rf_on = 0, True
        self._starting, self._rdloop = False, False
        self._reported: set[str] = set()
        self._parser = FrameParser()

    @property
    def radiating(self) -> int | None:
        """The antenna that radiates now: what disturbs load cells beside it."""
        return self.antenna if self.rf_on else None

    def see(self, uid: str, antenna: int = 0) -> None:
        """A tag (UID in hex, as printed) comes before an antenna."""
        self.tags[antenna].append(uid.upper())

    def lose(self, uid: str) -> None:
        for tags in self.tags.values():
            with contextlib.suppress(ValueError):
                tags.remove(uid.upper())

    def receive(self, data: bytes) -> bytes:
        """The answer to what the host sent."""
        if self._starting:
            self._starting = False
            return b""
        skipped = self._parser.skipped
        answer = b"".join(reply.encode() for frame in self._parser.feed(data) for reply in self._answer(frame))
        if self._parser.skipped > skipped:
            answer += Frame(NACK, bytes([SUM_ERROR])).encode()
        return self._out(answer)

    def tick(self) -> bytes:
        if not self._rdloop or not self.rf_on:
            return b""
        frames = (Frame(RDLOOP, bytes.fromhex(uid)[::-1] + bytes(16)) for uid in self._in_view())
        return self._out(b"".join(frame.encode() for frame in frames))

    def _restart(self) -> None:
        self.power_cycles += 1
        self.antenna, self.rf_on = 0, True
        self._starting, self._rdloop = True, False
        self._reported.clear()
        self._parser = FrameParser()

    def _out(self, answer: bytes) -> bytes:
        if self.power_cycle_after is not None and len(answer) >= self.power_cycle_after:
            answer, self.power_cycle_after = answer[: self.power_cycle_after], None
            self._restart()
        elif self.power_cycle_after is not None:
            self.power_cycle_after -= len(answer)
        return b"" if self.silent else answer

    def _answer(self, frame: Frame) -> list[Frame]:
        self.heard.append(frame)
        del self.heard[:-1000]
        if self.nack_next:
            self.nack_next -= 1
            return [Frame(NACK, bytes([self.nack_code]))]
        if frame.command == MODE:
            return self._mode(frame)
        if frame.command == READ and frame.data == b"\x90":
            return [Frame(ACK, b"\x90130060828")]
        if frame.command == INVENTORY and len(frame.data) == 3 and frame.data[0] == 0xF0:
            if frame.data[1] not in self.inventory_options:
                return [Frame(NACK, bytes([FORMAT_ERROR]))]
            return self._inventory()
        if frame.command == INVENTORY and frame.data[:1] == b"\xf2":
            return [Frame(ACK, b"\xf2")]
        return [Frame(NACK, bytes([FORMAT_ERROR]))]

    def _mode(self, frame: Frame) -> list[Frame]:
        what, *value = frame.data or b"\xff"
        if what == 0x9C and len(value) == 1 and self.switches_antennas and value[0] in self.tags:
            if value[0] != self.antenna:
                self.antenna = value[0]
                self._reported.clear()
            return [Frame(ACK, frame.data)]
        if what == 0x9E and len(value) == 1:
            self.rf_on = bool(value[0])
            if self.forgets_without_field and not self.rf_on:
                self._reported.clear()
            return [Frame(ACK, frame.data)]
        if what == 0x00 and len(value) == 3:
            self._rdloop = value[0] == _RDLOOP_MODE
            return [Frame(ACK)]
        return [Frame(NACK, bytes([FORMAT_ERROR]))]

    def _inventory(self) -> list[Frame]:
        new = [uid for uid in self._in_view() if uid not in self._reported and self.rf_on]
        self._reported.update(new)
        uids = [Frame(UID, b"\x00" + bytes.fromhex(uid)[::-1]) for uid in new]
        return [Frame(ACK, bytes([0xF0, len(new)])), *uids]

    def _in_view(self) -> list[str]:
        return self.tags[self.antenna] if self.look is None else [uid.upper() for uid in self.look(self.antenna)]
