"""The client side of LLRP: set the reader up, keep it alive, take its reports."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

from tms_agents.devices.llrp import messages
from tms_agents.devices.llrp.codec import FrameParser, Message, encode
from tms_agents.devices.tags import TagRead
from tms_agents.devices.transport import DeviceFault


class LlrpSession:
    """Waits for the reader's greeting, then: keepalive, delete old ROSpecs, add one that reads for ever, enable it.

    The ROSpec starts by itself when enabled. Readings come from ``receive`` as soon as the reader reports.
    """

    def __init__(self, *, antennas: Sequence[int] = (0,), keepalive_s: float = 3.0) -> None:
        self.frames = 0
        self.ready = False
        self._parser = FrameParser()
        self._output = bytearray()
        self._next_id = 1
        self._waiting_for: str | None = None
        self._commands = [
            messages.set_keepalive(int(keepalive_s * 1000)),
            messages.rospec("DELETE", 0),
            messages.add_rospec(tuple(antennas)),
            messages.rospec("ENABLE"),
        ]

    def opened(self) -> None:
        """The reader speaks first."""

    def receive(self, data: bytes) -> list[TagRead]:
        reads: list[TagRead] = []
        for message in self._parser.feed(data):
            self.frames += 1
            if why := messages.failure(message):
                raise DeviceFault(why)
            if message.name == "RO_ACCESS_REPORT":
                reads += messages.tag_reads(message)
            elif message.name == "KEEPALIVE":
                self._send(Message("KEEPALIVE_ACK"), message.id)
            elif message.name == "READER_EVENT_NOTIFICATION":
                self._event(message)
            elif message.name == self._waiting_for:
                self._step()
        return reads

    def tick(self) -> None:
        """The reader keeps the connection alive."""

    def output(self) -> bytes:
        data = bytes(self._output)
        self._output.clear()
        return data

    def closing(self) -> bytes:
        self._send(Message("CLOSE_CONNECTION"))
        return self.output()

    def _event(self, message: Message) -> None:
        event = message.find("ReaderEventNotificationData")
        if event is None:
            return
        if event.find("ConnectionAttemptEvent"):
            self._step()
        elif event.find("ConnectionCloseEvent"):
            raise DeviceFault("the reader ends the connection")

    def _step(self) -> None:
        if not self._commands:
            self.ready = True
            return
        command = self._commands.pop(0)
        self._waiting_for = f"{command.name}_RESPONSE"
        self._send(command)

    def _send(self, message: Message, message_id: int | None = None) -> None:
        if message_id is None:
            message_id, self._next_id = self._next_id, self._next_id + 1
        self._output += encode(dataclasses.replace(message, id=message_id))
