"""A reader for tests and demos: speaks LLRP over TCP, byte for byte, to one client at a time.

``see`` puts tags before its antennas. While a ROSpec runs they are reported every ``period_s``; ``keepalive``,
``refuse``, ``silent`` and ``inject`` play the faults of real readers.
"""

from __future__ import annotations

import asyncio
import contextlib
import dataclasses
import time
from collections.abc import Callable
from datetime import UTC, datetime

from tms_agents.devices.llrp import messages
from tms_agents.devices.llrp.codec import FrameParser, Message, Parameter, Value, encode
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
        #: Names of the messages received, for tests.
        self.heard: list[str] = []
        self.acknowledged = 0
        self._period_s, self._clock = period_s, clock
        self._rospec, self._running, self._immediate = 0, False, False
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
        self._writer, self._rospec, self._running, self._keepalive_s = writer, 0, False, 0.0
        reports = asyncio.create_task(self._report(writer))
        keepalives = asyncio.create_task(self._keep_alive(writer))
        parser = FrameParser()
        try:
            with contextlib.suppress(ConnectionError):
                while data := await reader.read(1 << 16):
                    for message in parser.feed(data):
                        self._answer(message, writer)
        finally:
            reports.cancel()
            keepalives.cancel()
            await asyncio.gather(reports, keepalives, return_exceptions=True)
            self._writer = None
            writer.close()

    def _answer(self, message: Message, writer: asyncio.StreamWriter) -> None:
        self.heard.append(message.name)
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
            parts += _CAPABILITIES
        versions: dict[str, Value] = {"CurrentVersion": 1, "SupportedVersion": 1}
        values = versions if message.name == "GET_SUPPORTED_VERSION" else {}
        name = "CLOSE_CONNECTION_RESPONSE" if message.name == "CLOSE_CONNECTION" else f"{message.name}_RESPONSE"
        writer.write(encode(Message(name, values, parts, message.id)))
        if message.name == "CLOSE_CONNECTION":
            writer.close()

    def _obey(self, message: Message) -> bool:
        """Change what the reader does; False for a command that makes no sense now."""
        if message.name == "SET_READER_CONFIG" and (spec := message.find("KeepaliveSpec")):
            self._keepalive_s = spec.number("PeriodicTriggerValue") / 1000
        if message.name == "ADD_ROSPEC" and (rospec := message.find("ROSpec")):
            self._rospec = rospec.number("ROSpecID")
            boundary = rospec.find("ROBoundarySpec")
            trigger = boundary.find("ROSpecStartTrigger") if boundary else None
            self._immediate = trigger is not None and trigger.number("ROSpecStartTriggerType") == 1
        elif message.name in _ROSPEC_COMMANDS:
            wanted = message.number("ROSpecID")
            if wanted not in (0, self._rospec):
                return False
            if message.name == "START_ROSPEC" or (message.name == "ENABLE_ROSPEC" and self._immediate):
                self._running = True
            elif message.name != "ENABLE_ROSPEC":
                self._running = False
            if message.name == "DELETE_ROSPEC":
                self._rospec = 0
        return True

    async def _report(self, writer: asyncio.StreamWriter) -> None:
        while True:
            await asyncio.sleep(self._period_s)
            if self._running and self.tags and not self.silent:
                now = self._utc()
                reads = [dataclasses.replace(tag, first_seen=now, last_seen=now) for tag in self.tags.values()]
                writer.write(encode(messages.report(reads)))

    async def _keep_alive(self, writer: asyncio.StreamWriter) -> None:
        number = 0
        while True:
            await asyncio.sleep(self._keepalive_s or 0.05)
            if self._keepalive_s and not self.silent:
                number += 1
                writer.write(encode(Message("KEEPALIVE", id=number)))


_CAPABILITIES = (
    Parameter(
        "GeneralDeviceCapabilities",
        {
            "MaxNumberOfAntennaSupported": 4,
            "Flags": 0x4000,  # has a UTC clock
            "DeviceManufacturerName": 0,
            "ModelName": 0,
            "ReaderFirmwareVersion": "emulator",
        },
        (Parameter("GPIOCapabilities", {"NumGPIs": 0, "NumGPOs": 0}),),
    ),
    Parameter(
        "LLRPCapabilities",
        {
            "Flags": 0,
            "MaxNumPriorityLevelsSupported": 1,
            "ClientRequestOpSpecTimeout": 0,
            "MaxNumROSpecs": 1,
            "MaxNumSpecsPerROSpec": 1,
            "MaxNumInventoryParameterSpecsPerAISpec": 1,
            "MaxNumAccessSpecs": 1,
            "MaxNumOpSpecsPerAccessSpec": 1,
        },
    ),
    Parameter(
        "RegulatoryCapabilities",
        {"CountryCode": 392, "CommunicationsStandard": 0},
        (
            Parameter(
                "UHFBandCapabilities",
                {},
                (
                    Parameter("TransmitPowerLevelTableEntry", {"Index": 1, "TransmitPowerValue": 3000}),
                    Parameter(
                        "FrequencyInformation",
                        {"Hopping": 0},
                        (Parameter("FixedFrequencyTable", {"Frequency": (916800,)}),),
                    ),
                    Parameter(
                        "C1G2UHFRFModeTable",
                        {},
                        (
                            Parameter(
                                "C1G2UHFRFModeTableEntry",
                                {
                                    "ModeIdentifier": 0,
                                    "Flags": 0,
                                    "MValue": 0,
                                    "ForwardLinkModulation": 0,
                                    "SpectralMaskIndicator": 0,
                                    "BDRValue": 40000,
                                    "PIEValue": 1500,
                                    "MinTariValue": 6250,
                                    "MaxTariValue": 25000,
                                    "StepTariValue": 0,
                                },
                            ),
                        ),
                    ),
                ),
            ),
        ),
    ),
    Parameter("C1G2LLRPCapabilities", {"Flags": 0, "MaxNumSelectFiltersPerQuery": 1}),
)
