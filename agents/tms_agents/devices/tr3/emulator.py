"""A TR3 for tests and demos, byte for byte; ``devices.emulation`` puts it behind a terminal or a TCP port."""

from __future__ import annotations

import contextlib

from tms_agents.devices.tr3.codec import ACK, INVENTORY, MODE, NACK, READ, UID, Frame, FrameParser


class Tr3Device:
    """The reader without its line: bytes in, bytes out.

    A UID is reported once per antenna until the antenna is switched, as the real one does. ``silent`` and
    ``nack_next`` play faults.
    """

    def __init__(self, antennas: int = 2) -> None:
        self.tags: dict[int, list[str]] = {antenna: [] for antenna in range(antennas)}
        self.antenna = 0
        self.rf_on = True
        self.silent = False
        self.nack_next = 0
        self.heard: list[Frame] = []
        self._reported: set[str] = set()
        self._parser = FrameParser()

    def see(self, uid: str, antenna: int = 0) -> None:
        """A tag (UID in hex, as printed) comes before an antenna."""
        self.tags[antenna].append(uid.upper())

    def lose(self, uid: str) -> None:
        for tags in self.tags.values():
            with contextlib.suppress(ValueError):
                tags.remove(uid.upper())

    def receive(self, data: bytes) -> bytes:
        """The answer to what the host sent."""
        answer = b"".join(reply.encode() for frame in self._parser.feed(data) for reply in self._answer(frame))
        return b"" if self.silent else answer

    def _answer(self, frame: Frame) -> list[Frame]:
        self.heard.append(frame)
        if self.nack_next:
            self.nack_next -= 1
            return [Frame(NACK, b"\x44")]
        if frame.command == MODE and frame.data[:1] == b"\x9c" and len(frame.data) == 2:
            if frame.data[1] not in self.tags:
                return [Frame(NACK, b"\x44")]
            if frame.data[1] != self.antenna:
                self.antenna = frame.data[1]
                self._reported.clear()
            return [Frame(ACK, frame.data)]
        if frame.command == MODE and frame.data[:1] == b"\x9e" and len(frame.data) == 2:
            self.rf_on = bool(frame.data[1])
            return [Frame(ACK, frame.data)]
        if frame.command == MODE and len(frame.data) == 4:
            return [Frame(ACK)]
        if frame.command == READ and frame.data == b"\x90":
            return [Frame(ACK, b"\x90130060828")]
        if frame.command == INVENTORY and frame.data[:1] == b"\xf0":
            new = [uid for uid in self.tags[self.antenna] if uid not in self._reported and self.rf_on]
            self._reported.update(new)
            return [Frame(ACK, bytes([0xF0, len(new)]))] + [
                Frame(UID, b"\x00" + bytes.fromhex(uid)[::-1]) for uid in new
            ]
        return [Frame(NACK, b"\x44")]
