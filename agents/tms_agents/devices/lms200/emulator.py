"""An LMS2xx for tests and demos, byte for byte; ``devices.emulation`` puts it behind a terminal or a TCP port."""

from __future__ import annotations

import math
import struct
import time
from collections.abc import Callable

import numpy as np

from tms_agents.devices.lms200 import messages as m
from tms_agents.devices.lms200.codec import ACK, NAK, Frame, FrameParser
from tms_agents.devices.lms200.profiles import Profile, sweep, to_values
from tms_agents.devices.scans import Array, Sweep

#: Gives the newest sweep: ranges (n,) m, +inf without echo, NaN for an error, and intensities (n,) or None.
ScanSource = Callable[[], tuple[Array, Array | None]]
_FACTORY = bytes([0x46, 0, 0, 0, 0, 0, 1, 0, 0, 2, 2]).ljust(m.CONFIG_BYTES, b"\x00")
_REPLY_ADDRESS = 0x80


class Lms200Device:
    """The scanner without its line: bytes in, bytes out; ``tick`` sends the scans that are due.

    ``scan`` is asked for as many beams as ``beams`` tells; what has another number of them is taken as the same field
    of view and thinned out or repeated. ``fast`` models scan 90 degrees, know reflectivity and keep their variant.
    ``host_baud`` tells the rate of the host's end of the line; where it is not ``baud``, all is noise.

    Faults: ``silent``; ``nak_next``, ``garble_next`` and ``cut_next`` count telegrams that are not heard, arrive with a
    wrong byte, or without their second half; ``power_cycle()``; ``refuse`` holds command codes that are refused;
    ``trouble`` is the status byte of all replies.
    """

    def __init__(
        self,
        scan: ScanSource,
        *,
        fast: bool = False,
        indices: bool = False,
        host_baud: Callable[[], int] | None = None,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._scan, self._fast, self.host_baud, self._clock = scan, fast, host_baud, clock
        self.name = "LMS291;S14;V02.10 " if fast else "LMS200;30106;V02.10 "
        self.config = m.Config(_FACTORY[:4] + bytes([2 * indices]) + _FACTORY[5:])
        self.silent = False
        self.nak_next = self.garble_next = self.cut_next = 0
        self.refuse: set[int] = set()
        self.trouble = 0
        self.power_cycles = self.writes = self.sent = 0
        #: Bodies of commands received, for tests; the last thousand.
        self.heard: list[bytes] = []
        self._power_on()
        self._started = b""

    def _power_on(self) -> None:
        self.baud = 9600
        self.mode = m.ON_REQUEST
        self.angle_deg, self.resolution_deg = (90, 0.5) if self._fast else (180, 1.0)
        self._parser = FrameParser(replies=False)
        self._due = -math.inf
        self._turn = 0
        self._reflectivity = (0, 0)

    @property
    def beams(self) -> int:
        return round(self.angle_deg / self.resolution_deg) + 1

    @property
    def streaming(self) -> bool:
        return self.mode in (m.STREAM, m.STREAM_PARTIAL, m.STREAM_REFLECTIVITY)

    def power_cycle(self) -> None:
        """Off and on: all that is not in its memory is forgotten, and it says that it is there."""
        self.power_cycles += 1
        self._power_on()
        self._started = self._reply(bytes([m.POWER_ON]) + self.name.encode("ascii"))

    def receive(self, data: bytes) -> bytes:
        """The answer to what the host sent."""
        if self._noise():
            return b""
        skipped = self._parser.skipped
        answer = b""
        for frame in self._parser.feed(data):
            if isinstance(frame, Frame) and frame.address == 0:
                answer += self._answer(frame.body)
        if self._parser.skipped > skipped:
            answer += NAK
        return self._out(answer)

    def tick(self) -> bytes:
        """The scans that are due by its clock."""
        answer, self._started = self._started, b""
        if self.streaming and self._clock() >= self._due:
            period_s = self._sweep(partial=self.mode == m.STREAM_PARTIAL).period_s
            self._due = max(self._due + period_s, self._clock() - period_s)
            answer += self._measured()
        return b"" if self._noise() else self._out(answer)

    def _noise(self) -> bool:
        return self.host_baud is not None and self.host_baud() != self.baud

    def _out(self, answer: bytes) -> bytes:
        return b"" if self.silent else answer

    def _reply(self, body: bytes) -> bytes:
        self.sent += 1
        raw = bytearray(Frame(body + bytes([self.trouble]), _REPLY_ADDRESS).encode())
        if self.garble_next:
            self.garble_next -= 1
            raw[len(raw) // 2] ^= 0x10
        if self.cut_next:
            self.cut_next -= 1
            del raw[len(raw) // 2 :]
        return bytes(raw)

    def _answer(self, body: bytes) -> bytes:
        self.heard.append(body)
        del self.heard[:-1000]
        if self.nak_next:
            self.nak_next -= 1
            return NAK
        code, data = body[0], body[1:]
        if code in self.refuse:
            return ACK + self._reply(bytes([m.reply_to(code), 0x02 if code == m.SWITCH_MODE else 0x00]))
        if code == m.SWITCH_MODE and data:
            return ACK + self._switched(data[0], data[1:])
        if code == m.REQUEST and data == b"\x01" and not self.streaming:
            return ACK + self._measured()
        if code == m.TYPE:
            return ACK + self._reply(bytes([m.reply_to(code)]) + self.name.encode("ascii"))
        if code == m.STATUS:
            status = m.Status(
                self.mode, self.config.measuring_mode, self.angle_deg, self.resolution_deg, self.config.unit
            )
            return ACK + self._reply(bytes([m.reply_to(code)]) + status.encode())
        if code == m.VARIANT and not self._fast:
            return ACK + self._reply(bytes([m.reply_to(code)]) + self._varied(data))
        if code == m.READ_CONFIG:
            return ACK + self._reply(bytes([m.reply_to(code)]) + self.config.raw)
        if code == m.WRITE_CONFIG:
            return ACK + self._reply(bytes([m.reply_to(code)]) + self._written(data))
        return ACK + self._reply(bytes([m.UNKNOWN_COMMAND]))

    def _switched(self, mode: int, data: bytes) -> bytes:
        bauds = {code: baud for baud, code in m.BAUD_CODES.items()}
        if mode in bauds:
            reply = self._reply(bytes([m.reply_to(m.SWITCH_MODE), 0]))
            self.baud = bauds[mode]
            return reply
        result = 0
        if mode == m.INSTALLATION:
            result = int(data != m.PASSWORD)
        elif mode == m.STREAM_REFLECTIVITY and self._fast and len(data) == 4:
            first, last = struct.unpack("<HH", data)
            result = 0 if 1 <= first <= last <= self.beams else 2
            self._reflectivity = (first, last)
        elif mode not in (m.STREAM, m.ON_REQUEST, m.STREAM_PARTIAL):
            result = 2
        if result == 0:
            self.mode, self._due, self._turn = mode, self._clock(), 0
        return self._reply(bytes([m.reply_to(m.SWITCH_MODE), result]))

    def _varied(self, data: bytes) -> bytes:
        angle, hundredths = struct.unpack("<HH", data) if len(data) == 4 else (0, 0)
        possible = angle in (100, 180) and hundredths in (25, 50, 100) and (angle, hundredths) != (180, 25)
        if possible:
            self.angle_deg, self.resolution_deg, self.mode = angle, hundredths / 100, m.ON_REQUEST
        return bytes([possible]) + struct.pack("<HH", self.angle_deg, round(100 * self.resolution_deg))

    def _written(self, data: bytes) -> bytes:
        config = m.Config.of(data)
        possible = self.mode == m.INSTALLATION and config is not None and config.measuring_mode in m.DISTANCE_BITS
        if possible and config is not None:
            self.config = config
            self.writes += 1
        return bytes([possible]) + self.config.raw

    def _sweep(self, *, partial: bool) -> Sweep:
        beams = self.beams * (self.resolution_deg if partial else 1)
        telegram_s = (2 * beams + 10) * 10 / self.baud
        return sweep(self.angle_deg, self.resolution_deg, partial=partial, telegram_s=telegram_s)

    def _measured(self) -> bytes:
        ranges, intensities = self._scan()
        nearest = np.round(np.linspace(0, len(ranges) - 1, self.beams)).astype(int)
        ranges = np.asarray(ranges, float)[nearest]
        profile = Profile(to_values(ranges, self.config.measuring_mode, self.config.unit), self.config.unit)
        if self.mode == m.STREAM_PARTIAL:
            turns = round(1 / self.resolution_deg)
            at, self._turn = self._turn, (self._turn + 1) % turns
            profile = Profile(profile.values[at::turns], profile.unit, 4 // turns * at, True)
        code = m.RANGES
        if self.mode == m.STREAM_REFLECTIVITY:
            code = m.RANGES_AND_REFLECTIVITY
            first, last = self._reflectivity
            strong = np.zeros(self.beams) if intensities is None else np.asarray(intensities, float)[nearest]
            strong = np.clip(np.nan_to_num(strong), 0, 255).astype(np.uint8)[first - 1 : last]
            profile = Profile(profile.values, profile.unit, reflectivity=strong, first=first - 1)
        indices = bytes([self.sent & 0xFF, self.sent >> 8 & 0xFF]) if self.config.sends_indices else b""
        return self._reply(bytes([code]) + profile.encode() + indices)
