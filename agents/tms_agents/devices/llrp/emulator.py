"""A reader for tests and demos: speaks LLRP over TCP, byte for byte, to one client at a time.

``see`` puts tags before its antennas. While a ROSpec runs they are looked for every ``period_s``. ``refuse``, ``fail``,
``silent``, ``unplug``, ``inject`` and ``power_cycle`` play the faults of real readers.
"""

from __future__ import annotations

import asyncio
import contextlib
import dataclasses
import time
from collections.abc import Callable
from datetime import UTC, datetime

from tms_agents.devices.llrp import messages
from tms_agents.devices.llrp.capabilities import ANTENNAS, CAPABILITIES
from tms_agents.devices.llrp.codec import FrameParser, Message, Parameter, Value, encode
from tms_agents.devices.llrp.rospec import RoSpec, run
from tms_agents.devices.tags import TagRead

_ROSPEC_COMMANDS = {"ADD_ROSPEC", "DELETE_ROSPEC", "ENABLE_ROSPEC", "DISABLE_ROSPEC", "START_ROSPEC", "STOP_ROSPEC"}


class LlrpEmulator:
    def __init__(
        self,
        *,
        host: str = "127.0.0.1",
        port: int = 0,
        period_s: float = 0.1,
        clock: Callable[[], float] = time.time,
    ) -> None:
        self.host, self.port = host, port
        #: Connection attempt status to greet with (0: welcome), ROSpec commands to fail, and "say nothing at all".
        self.refuse = 0
        self.fail: set[str] = set()
        self.silent = False
        self.tags: dict[str, TagRead] = {}
        #: Names of the messages received, for tests; the last thousand.
        self.heard: list[str] = []
        self.acknowledged = 0
        #: A reader that announces the end of an AISpec before it reports its tags.
        self.reports_late = False
        self.unplugged: set[int] = set()
        self._period_s, self._clock = period_s, clock
        self._rospec: RoSpec | None = None
        self._running: asyncio.Task[None] | None = None
        self._events: set[int] = set()
        self._keepalive_s = 0.0
        self._writer: asyncio.StreamWriter | None = None
        self._server: asyncio.Server | None = None
        self._tasks: set[asyncio.Task[None]] = set()

    def see(self, tag: str, *, antenna: int = 1, rssi_dbm: float = -50.0, count: int = 1) -> None:
        """A tag (hex) comes before an antenna."""
        self.tags[tag.upper()] = TagRead(tag=tag.upper(), antenna=antenna, rssi_dbm=rssi_dbm, count=count)

    def lose(self, tag: str) -> None:
        self.tags.pop(tag.upper(), None)

    def inject(self, data: bytes) -> None:
        """Send bytes as they are: garbage, half a frame."""
        if self._writer is not None:
            self._writer.write(data)

    def hang_up(self) -> None:
        """Cut the connection as a pulled cable does."""
        if self._writer is not None:
            self._writer.transport.abort()

    def power_cycle(self) -> None:
        """The supply fails in the middle of a message and returns; nothing that was set up is left."""
        if self._writer is not None:
            self.inject(encode(messages.report(list(self.tags.values()) or [TagRead(tag="00" * 12)]))[:17])
            self._writer.close()

    def unplug(self, antenna: int) -> None:
        self.unplugged.add(antenna)
        self._notify(messages.ANTENNA_EVENT, Parameter("AntennaEvent", {"EventType": 0, "AntennaID": antenna}))

    def plug_in(self, antenna: int) -> None:
        self.unplugged.discard(antenna)
        self._notify(messages.ANTENNA_EVENT, Parameter("AntennaEvent", {"EventType": 1, "AntennaID": antenna}))

    def lose_reports(self) -> None:
        """Its buffer for reports was full."""
        self._notify(messages.REPORT_BUFFER_EVENT, Parameter("ReportBufferOverflowErrorEvent"))

    def _notify(self, kind: int, event: Parameter) -> None:
        if kind in self._events and not self.silent:
            self.inject(encode(messages.event(self._utc(), event)))

    def _utc(self) -> datetime:
        return datetime.fromtimestamp(self._clock(), UTC)

    async def __aenter__(self) -> LlrpEmulator:
        self._server = await asyncio.start_server(self._serve, self.host, self.port)
        self.port = self._server.sockets[0].getsockname()[1]
        return self

    async def __aexit__(self, *_: object) -> None:
        assert self._server is not None
        self._server.close()
        self.hang_up()
        for task in self._tasks:
            task.cancel()
        await asyncio.gather(*self._tasks, return_exceptions=True)

    async def _serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        task = asyncio.current_task()
        assert task is not None
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)
        refuse = self.refuse or (2 if self._writer is not None else 0)
        attempt = Parameter("ConnectionAttemptEvent", {"Status": refuse})
        writer.write(encode(messages.event(self._utc(), attempt)))
        if refuse:
            writer.close()
            return
        self._writer, self._rospec, self._keepalive_s = writer, None, 0.0
        self._events = set()
        keepalives = asyncio.create_task(self._keep_alive(writer))
        parser = FrameParser()
        try:
            with contextlib.suppress(ConnectionError):
                while data := await reader.read(1 << 16):
                    for message in parser.feed(data):
                        self._answer(message, writer)
        finally:
            self._stop()
            keepalives.cancel()
            await asyncio.gather(keepalives, return_exceptions=True)
            self._writer = None
            writer.close()

    def _answer(self, message: Message, writer: asyncio.StreamWriter) -> None:
        self.heard.append(message.name)
        del self.heard[:-1000]
        if self.silent:
            return
        if message.name == "KEEPALIVE_ACK":
            self.acknowledged += 1
            return
        if message.name == "ENABLE_EVENTS_AND_REPORTS":
            return
        parts: tuple[Parameter, ...] = (messages.success(),)
        if message.name in self.fail or not self._obey(message):
            parts = (Parameter("LLRPStatus", {"StatusCode": 101, "ErrorDescription": f"{message.name} fails"}),)
        elif message.name == "GET_READER_CAPABILITIES":
            parts += CAPABILITIES
        elif message.name == "GET_READER_CONFIG":
            parts += self._antenna_properties()
        versions: dict[str, Value] = {"CurrentVersion": 1, "SupportedVersion": 1}
        values = versions if message.name == "GET_SUPPORTED_VERSION" else {}
        name = "CLOSE_CONNECTION_RESPONSE" if message.name == "CLOSE_CONNECTION" else f"{message.name}_RESPONSE"
        writer.write(encode(Message(name, values, parts, message.id)))
        if message.name == "CLOSE_CONNECTION":
            writer.close()

    def _obey(self, message: Message) -> bool:
        """Change what the reader does; False for a command that makes no sense now."""
        if message.name == "SET_READER_CONFIG":
            self._configure(message)
        elif message.name == "ADD_ROSPEC" and (rospec := message.find("ROSpec")):
            self._rospec = RoSpec.of(rospec)
        elif message.name in _ROSPEC_COMMANDS:
            wanted = message.number("ROSpecID")
            if wanted and (self._rospec is None or wanted != self._rospec.id):
                return False
            if self._rospec and (
                message.name == "START_ROSPEC" or (message.name == "ENABLE_ROSPEC" and self._rospec.starts_itself)
            ):
                self._start(self._rospec)
            elif message.name != "ENABLE_ROSPEC":
                self._stop()
            if message.name == "DELETE_ROSPEC":
                self._rospec = None
        return True

    def _configure(self, message: Message) -> None:
        if spec := message.find("KeepaliveSpec"):
            self._keepalive_s = spec.number("PeriodicTriggerValue") / 1000
        if told := message.find("ReaderEventNotificationSpec"):
            for state in told.all("EventNotificationState"):
                change = self._events.add if state.number("NotificationState") & 0x80 else self._events.discard
                change(state.number("EventType"))

    def _antenna_properties(self) -> tuple[Parameter, ...]:
        return tuple(
            Parameter(
                "AntennaProperties",
                {"AntennaConnected": 0 if one in self.unplugged else 0x80, "AntennaID": one, "AntennaGain": 0},
            )
            for one in range(1, ANTENNAS + 1)
        )

    def _start(self, rospec: RoSpec) -> None:
        self._stop()
        held: list[TagRead] = []

        def report(reads: list[TagRead]) -> None:
            if self.reports_late:
                held[:] = reads
            else:
                self._report(reads)

        def ended(turn: int) -> None:
            values: dict[str, Value] = {"EventType": 0, "ROSpecID": rospec.id, "SpecIndex": turn}
            self._notify(messages.AISPEC_EVENT, Parameter("AISpecEvent", values))
            self._report(held)
            held.clear()

        self._running = asyncio.create_task(
            run(rospec, look=self._look, report=report, ended=ended, step_s=self._period_s)
        )

    def _stop(self) -> None:
        if self._running is not None:
            self._running.cancel()
        self._running = None

    def _look(self, antennas: tuple[int, ...]) -> list[TagRead]:
        now = self._utc()
        return [
            dataclasses.replace(tag, first_seen=now, last_seen=now)
            for tag in self.tags.values()
            if (0 in antennas or tag.antenna in antennas) and tag.antenna not in self.unplugged
        ]

    def _report(self, reads: list[TagRead]) -> None:
        if reads and not self.silent:
            self.inject(encode(messages.report(reads)))

    async def _keep_alive(self, writer: asyncio.StreamWriter) -> None:
        number = 0
        while True:
            await asyncio.sleep(self._keepalive_s or 0.05)
            if self._keepalive_s and not self.silent:
                number += 1
                writer.write(encode(Message("KEEPALIVE", id=number)))
