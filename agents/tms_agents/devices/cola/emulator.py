"""A TiM, LMS1xx or LMS5xx for tests and demos, byte for byte; ``devices.emulation`` puts it behind a TCP port."""

from __future__ import annotations

import math
import re
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np

from tms_agents.devices.cola import messages as m
from tms_agents.devices.cola.framing import Dialect, FrameParser, Telegram
from tms_agents.devices.cola.scandata import NAME, Channel, ScanData, degrees_of_step, to_values
from tms_agents.devices.cola.values import Reader, Writer
from tms_agents.devices.scans import Array

#: Gives the newest sweep: ranges (n,) m, +inf without echo, NaN for an error, and intensities (n,) or None.
ScanSource = Callable[[], tuple[Array, Array | None]]
_ACCESS_DENIED, _UNKNOWN_METHOD, _UNKNOWN_VARIABLE, _OUT_OF_LIMITS, _UNKNOWN_COMMAND = 1, 2, 3, 4, 12


@dataclass(frozen=True, slots=True)
class ColaModel:
    """What differs between models. ``configurable``: its pace and resolution can be set."""

    name: str
    version: str
    start_deg: float
    stop_deg: float
    step_deg: float
    scan_hz: float
    rssi_bits: Literal[8, 16]
    configurable: bool = False
    scale: float = 1.0
    password: int = m.PASSWORDS[0]


MODELS = {
    "TiM571": ColaModel("TiM571-2050101", "V3.13", -45, 225, 1 / 3, 15, 16),
    "TiM781S": ColaModel("TiM781S-2174104", "V3.13", -45, 225, 1 / 3, 15, 16, password=m.PASSWORDS[1]),
    "LMS111": ColaModel("LMS111-10100", "V1.80", -45, 225, 0.5, 50, 8, True),
    "LMS511": ColaModel("LMS511-10100", "V2.30", -5, 185, 1 / 6, 25, 8, True, 2.0),
}


class ColaDevice:
    """The scanner without its line: bytes in, bytes out; ``tick`` sends the scans that are due.

    ``scan`` is asked for as many beams as ``beams`` tells; what has another number of them is taken as the same field
    of view and thinned out or repeated. It hears one ``dialect`` only.

    Faults: ``silent``; ``garble_next`` and ``cut_next`` count telegrams that arrive with a wrong byte, or without their
    second half; ``power_cycle()``; ``refuse`` holds names and the error number they are refused with; ``unknown`` are
    names that are not answered at all; ``status`` and ``state`` are what it tells of itself. For ``settle_s`` after a
    pace was set its mirror comes to it, and no scan is sent.
    """

    def __init__(
        self,
        scan: ScanSource,
        *,
        model: ColaModel = MODELS["TiM571"],
        dialect: Dialect = "B",
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self.model, self.dialect, self._scan, self._clock = model, dialect, scan, clock
        self.silent = False
        self.settle_s = 0.0
        self.garble_next = self.cut_next = 0
        self.refuse: dict[str, int] = {}
        self.unknown: set[str] = set()
        self.status = (0, 0)
        self.state = m.READY
        self.power_cycles = self.sent = 0
        #: Verbs and names of commands received, for tests; the last thousand.
        self.heard: list[str] = []
        self._power_on()

    def _power_on(self) -> None:
        model = self.model
        self.start_deg, self.stop_deg = model.start_deg, model.stop_deg
        self.step_deg, self.scan_hz = model.step_deg, model.scan_hz
        self.streaming = self._authorized = False
        self._rssi_bits: int = 0
        self._parser = FrameParser()
        self._started, self._due, self._scans = self._clock(), -math.inf, 0
        self._settled = -math.inf

    @property
    def beams(self) -> int:
        return round((self.stop_deg - self.start_deg) / self.step_deg) + 1

    def power_cycle(self) -> None:
        """Off and on: all that was set is forgotten, and its clock begins anew."""
        self.power_cycles += 1
        self._power_on()

    def receive(self, data: bytes) -> bytes:
        """The answer to what the host sent."""
        answer = b""
        for telegram in self._parser.feed(data):
            if telegram.dialect == self.dialect:
                answer += self._heard(telegram)
        return b"" if self.silent else answer

    def tick(self) -> bytes:
        """The scans that are due by its clock."""
        if not self.streaming or self._clock() < max(self._due, self._settled):
            return b""
        self._due = max(self._due + 1 / self.scan_hz, self._clock() - 1 / self.scan_hz)
        scan = self._send(self._measured().telegram(self.dialect))
        return b"" if self.silent else scan

    def _send(self, telegram: Telegram) -> bytes:
        self.sent += 1
        raw = bytearray(telegram.encode())
        if self.garble_next:
            self.garble_next -= 1
            raw[len(raw) // 2] ^= 0x80
        if self.cut_next:
            self.cut_next -= 1
            del raw[len(raw) // 2 :]
        return bytes(raw)

    def _heard(self, telegram: Telegram) -> bytes:
        try:
            reader = Reader(telegram)
            self.heard.append(f"{reader.verb} {reader.name}")
            del self.heard[:-1000]
            if reader.name in self.unknown:
                return b""
            answer = self._answer(reader)
        except ValueError:
            answer = _OUT_OF_LIMITS
        if isinstance(answer, int):
            answer = Writer(self.dialect, "sFA").put("H", answer)
        return self._send(answer.telegram())

    def _answer(self, reader: Reader) -> Writer | int:
        """What is answered, or the number of the error."""
        verb, name = reader.verb, reader.name
        if verb not in m.ANSWERS:
            return _UNKNOWN_COMMAND
        if name in self.refuse:
            return self.refuse[name]
        writer = Writer(self.dialect, m.ANSWERS[verb], name)
        if verb == "sRN":
            return self._read(name, writer)
        if verb == "sEN" and name == NAME:
            self.streaming = bool(reader.integer("B"))
            self._due = self._clock()
            return writer.put("B", self.streaming)
        if verb == "sMN":
            return self._called(name, reader, writer)
        if not self._authorized:
            return _ACCESS_DENIED
        return self._written(name, reader, writer) if verb == "sWN" else _UNKNOWN_VARIABLE

    def _read(self, name: str, writer: Writer) -> Writer | int:
        ticks = round(10_000 * self.start_deg), round(10_000 * self.stop_deg)
        if name == "SCdevicestate":
            return writer.put("B", self.state)
        if name == "DeviceIdent":
            return writer.text(self.model.name).text(self.model.version)
        if name == "FirmwareVersion":
            return writer.text(self.model.version)
        if name == "SerialNumber":
            return writer.text("21010042")
        if name == "LocationName":
            return writer.text("not defined")
        if name == "LMPscancfg":
            return writer.put("I", 100 * self.scan_hz).put("H", 1).put("I", round(1e4 * self.step_deg)).put("i", *ticks)
        if name == "LMPoutputRange":
            return writer.put("H", 1).put("I", round(1e4 * self.step_deg)).put("i", *ticks)
        if name == "LIDinputstate":
            return writer.put("B", *[0] * 12)
        if re.fullmatch("field[0-9]{3}", name):  # a protective field, empty; some hosts ask for all of them
            writer.put("f", 1.0, 0.0).put("I", round(1e4 * self.step_deg)).put("i", ticks[0]).put("B", 2, 1)
            return writer.put("H", 1, 0, 0, 0, 0, 1).text(name).put("H", 0)
        if name in ("ODoprh", "ODpwrc"):
            return writer.put("I", 1000)
        if name == "LMDscandatacfg":
            return writer.put("B", 1, 0, bool(self._rssi_bits), self._rssi_bits == 16, *[0] * 7).put("H", 1)
        if name == NAME:
            return self._measured().writer(self.dialect, "sRA")
        return _UNKNOWN_VARIABLE

    def _called(self, name: str, reader: Reader, writer: Writer) -> Writer | int:
        if name == "SetAccessMode":
            self._authorized = (reader.integer("B"), reader.integer("I")) == (m.AUTHORIZED_CLIENT, self.model.password)
            return writer.put("B", self._authorized)
        if name not in ("LMCstartmeas", "LMCstopmeas", "Run", "mLMPsetscancfg", "mEEwriteall"):
            return _UNKNOWN_METHOD
        if name == "mLMPsetscancfg" and not self.model.configurable:
            return _UNKNOWN_METHOD
        if name == "Run":
            self._authorized = False
            return writer.put("B", 1)
        if not self._authorized:
            return _ACCESS_DENIED
        if name != "mLMPsetscancfg":
            return writer.put("B", 0)
        hz, _, step = reader.integer("I") / 100, reader.integer("H"), reader.integer("I")
        result = 1 if hz not in (25, 35, 50, 75, 100) else 2 if step not in (1667, 2500, 3333, 5000, 6667, 10000) else 0
        if result == 0:
            self.scan_hz, self.step_deg = hz, degrees_of_step(step)
            self._settled = self._clock() + self.settle_s
        writer.put("B", result).put("I", round(100 * self.scan_hz)).put("H", 1).put("I", round(1e4 * self.step_deg))
        return writer.put("i", round(1e4 * self.start_deg), round(1e4 * self.stop_deg))

    def _written(self, name: str, reader: Reader, writer: Writer) -> Writer | int:
        if name == "LMDscandatacfg":
            _, _, intensities, wide = (reader.integer("B") for _ in range(4))
            self._rssi_bits = 0 if not intensities else 16 if wide else 8
            return writer
        if name == "LMPoutputRange":
            reader.integer("H"), reader.integer("I")
            start, stop = reader.integer("i") / 1e4, reader.integer("i") / 1e4
            if not self.model.start_deg - 0.01 <= start < stop <= self.model.stop_deg + 0.01:
                return _OUT_OF_LIMITS
            self.start_deg, self.stop_deg = start, stop
            return writer
        return writer if name == "EIHstCola" else _UNKNOWN_VARIABLE

    def _measured(self) -> ScanData:
        ranges, intensities = self._scan()
        nearest = np.round(np.linspace(0, len(ranges) - 1, self.beams)).astype(int)
        start, step = self.start_deg, self.step_deg
        values = to_values(np.asarray(ranges, float)[nearest], self.model.scale)
        channels = [Channel("DIST1", values, self.model.scale, 0.0, start, step)]
        if self._rssi_bits:
            bits: Literal[8, 16] = 8 if self._rssi_bits == 8 else 16
            strong = np.zeros(self.beams) if intensities is None else np.asarray(intensities, float)[nearest]
            strength = np.clip(np.nan_to_num(strong), 0, (1 << bits) - 1).astype(np.uint16)
            channels.append(Channel("RSSI1", strength, 1.0, 0.0, start, step, bits))
        self._scans += 1
        now_us = round((self._clock() - self._started) * 1e6) % (1 << 32)
        return ScanData(
            tuple(channels),
            serial=21010042,
            status=self.status,
            telegrams=self._scans & 0xFFFF,
            scans=self._scans & 0xFFFF,
            since_start_us=now_us,
            sent_us=now_us,
            scan_hz=self.scan_hz,
            measurement_hz=self.scan_hz * 360 / self.step_deg,
        )
