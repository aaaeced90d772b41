"""The client side of LLRP: set the reader up, keep it alive, take its reports."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

from tms_agents.devices.llrp import messages
from tms_agents.devices.llrp.codec import FrameParser, Message, Parameter, encode
from tms_agents.devices.outgoing import Outgoing
from tms_agents.devices.tags import RoundEnd, TagItem
from tms_agents.devices.transport import DeviceFault


class LlrpSession(Outgoing):
    """Waits for the reader's greeting, then: configure, delete old ROSpecs, add one that reads for ever, enable it.

    Without ``round_s`` all ``antennas`` (0: every one) read together and each tag is reported at once. With it they
    read in turn, each for ``round_s`` seconds; tags are reported when the turn ends, then comes ``RoundEnd``. The first
    turn of each antenna ends without: should a reader announce the end before it reports, reads are always one
    turn late, and nothing would have been read in the first. Nor does one end whose reports were lost, or whose antenna
    is unplugged.
    """

    def __init__(
        self, *, antennas: Sequence[int] = (0,), keepalive_s: float = 3.0, round_s: float | None = None
    ) -> None:
        super().__init__()
        self.frames = 0
        self.ready = False
        self._antennas = tuple(antennas)
        self._parser = FrameParser()
        self._next_id = 1
        self._waiting_for: str | None = None
        self._unplugged: set[int] = set()
        self._had_a_turn: set[int] = set()
        self._commands = [
            *self._configuration(int(keepalive_s * 1000), round_s is not None),
            messages.rospec("DELETE", 0),
            messages.add_rospec(self._antennas)
            if round_s is None
            else messages.add_round_rospec(self._antennas, int(round_s * 1000)),
            messages.rospec("ENABLE"),
        ]

    def opened(self) -> None:
        """The reader speaks first."""

    def receive(self, data: bytes) -> list[TagItem]:
        items: list[TagItem] = []
        for message in self._parser.feed(data):
            self.frames += 1
            why = messages.failure(message)
            if why and message.name != "GET_READER_CONFIG_RESPONSE":
                raise DeviceFault(why)
            if message.name == "RO_ACCESS_REPORT":
                items += messages.tag_reads(message)
            elif message.name == "KEEPALIVE":
                self._send(Message("KEEPALIVE_ACK"), message.id)
            elif message.name == "READER_EVENT_NOTIFICATION":
                items += self._event(message)
            elif message.name == self._waiting_for:
                if message.name == "GET_READER_CONFIG_RESPONSE":
                    self._unplugged = messages.unplugged_antennas(message)
                self._step()
        return items

    def tick(self) -> None:
        """The reader keeps the connection alive."""

    def closing(self) -> bytes:
        self._send(Message("CLOSE_CONNECTION"))
        return self.output()

    @property
    def pending(self) -> int:
        """Bytes of an incomplete message."""
        return self._parser.pending

    def _configuration(self, keepalive_ms: int, rounds: bool) -> list[Message]:
        if not rounds:
            return [messages.set_config(keepalive_ms)]
        events = (
            messages.REPORT_BUFFER_EVENT,
            messages.READER_EXCEPTION,
            messages.AISPEC_EVENT,
            messages.ANTENNA_EVENT,
        )
        return [messages.set_config(keepalive_ms, events), messages.get_antenna_properties()]

    def _event(self, message: Message) -> list[RoundEnd]:
        event = message.find("ReaderEventNotificationData")
        if event is None:
            return []
        if event.find("ConnectionAttemptEvent"):
            self._step()
        elif event.find("ConnectionCloseEvent"):
            raise DeviceFault("the reader ends the connection")
        elif event.find("ReportBufferOverflowErrorEvent"):
            self._had_a_turn.clear()
        elif antenna := event.find("AntennaEvent"):
            plugged_in, number = bool(antenna.number("EventType")), antenna.number("AntennaID")
            (self._unplugged.discard if plugged_in else self._unplugged.add)(number)
            self._had_a_turn.discard(number)
        elif ended := event.find("AISpecEvent"):
            return self._turn_ended(ended)
        return []

    def _turn_ended(self, ended: Parameter) -> list[RoundEnd]:
        place = ended.number("SpecIndex") - 1
        if ended.number("ROSpecID") != messages.ROSPEC_ID or not 0 <= place < len(self._antennas):
            return []
        antenna = self._antennas[place]
        if antenna in self._unplugged or (antenna == 0 and self._unplugged):
            return []
        if antenna not in self._had_a_turn:
            self._had_a_turn.add(antenna)
            return []
        return [RoundEnd(antenna)]

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
