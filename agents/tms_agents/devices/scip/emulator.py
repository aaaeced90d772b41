"""A Hokuyo sensor for tests and demos, byte for byte; ``devices.emulation`` puts it behind a terminal or a port."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable

import numpy as np

from tms_agents.devices.lines import LineParser
from tms_agents.devices.scans import Array, Sweep
from tms_agents.devices.scip import wording
from tms_agents.devices.scip.encoding import encode
from tms_agents.devices.scip.measurements import STAMP_TURN_MS
from tms_agents.devices.scip.models import MODELS, Model
from tms_agents.devices.scip.parameters import sweep
from tms_agents.devices.scip.ranges import raw_ranges
from tms_agents.devices.scip.requests import Measure, OldMeasure

#: Speeds of a serial line, the first of which it has when it is switched on.
BAUDS = (19200, 38400, 57600, 115200, 250000, 500000, 750000)
_LONGEST_COMMAND = 64
_REBOOT_WITHIN_S = 1.0
_STATES = {"standby": "000", "time": "002", "single": "003", "multi": "004", "asleep": "005"}
#: What a sensor that adjusts its clock still answers.
_WHILE_ADJUSTING = ("TM", "VV", "II", "RS", "RT", "RB", "%S")


class ScipDevice:
    """The sensor without its line, which must tick a few times per sweep: then the sensor sends what it measures.

    ``scan()`` gives the newest sweep, asked for once per sweep that is sent: ranges (n,) in m in the directions of
    ``sweep``, +inf where nothing is, NaN for an error; intensities (n,) or None.

    Faults, each until it is taken back: ``silent`` (hears nothing either), ``refuse`` (status by command, such as
    {"ME": "0E"}), ``broken`` (status of a hardware fault such as "51"). ``garble_next`` and ``cut_next`` replies or
    scans are damaged, ``lose_next`` scans are not sent; ``stall`` forgets what is measured, ``power_cycle`` everything.
    ``line_baud`` tells the speed of the host's end of a serial line: at any other than the sensor's both hear noise.
    """

    def __init__(
        self,
        scan: Callable[[], tuple[Array, Array | None]],
        model: str | Model = "UST-20LX",
        *,
        boot_s: float = 0.2,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self.model = model if isinstance(model, Model) else MODELS[model]
        p = self.model.parameters
        #: All that the model measures.
        self.sweep: Sweep = sweep(p, Measure("MD", p.amin, p.amax))
        self.silent, self.broken = False, ""
        self.refuse: dict[str, str] = {}
        self.garble_next = self.cut_next = self.lose_next = 0
        self.line_baud: Callable[[], int] | None = None
        #: Odd firmware: VV of some URG-04LX has a line too many and a wrong sum, II of the first UTM-30LX sums without
        #: the remarks behind <-.
        self.stray_line = self.remarks_unsummed = False
        #: Of the motor, 1/min.
        self.motor_speed = p.scan
        #: Added to the sensor's own clock, to see it begin again.
        self.clock_ahead_ms = 0
        #: Commands received, for tests; the last thousand.
        self.heard: deque[str] = deque(maxlen=1000)
        self.power_cycles = 0
        self._scan, self._boot_s, self._clock = scan, boot_s, clock
        self._lines = LineParser(_LONGEST_COMMAND)
        self._began, self._reboot_at, self._dead = 0.0, -np.inf, False
        self._request: Measure | None = None
        self._command, self._left, self._passed, self._sweeps = "", 0, 0, 0
        self.state, self.old, self.baud = "standby", self.model.old, BAUDS[0]
        self._restart(clock())

    @property
    def laser_on(self) -> bool:
        return self.state in ("single", "multi")

    def power_cycle(self) -> None:
        self.power_cycles += 1
        self._restart(self._clock() + self._boot_s)

    def stall(self) -> None:
        """The sensor stops measuring and does not say so."""
        self.state, self._request = "standby", None

    def receive(self, data: bytes) -> bytes:
        """The answer to what the host sent."""
        answer = b""
        if self._hears():
            for line in self._lines.feed(data):
                command = line.decode("latin-1")
                self.heard.append(command)
                answer += self._out(self._answer(command))
        return answer

    def tick(self) -> bytes:
        """The scan of the sweep that has ended, if one is wanted."""
        sweeps = int((self._clock() - self._began) / self._turn_s)
        if sweeps <= self._sweeps or not self._hears(anyhow=True):
            return b""
        self._sweeps = sweeps
        request = self._request
        if request is None:
            return b""
        if self.broken:
            self.stall()
            return self._out(wording.reply(self._command, self.broken))
        self._passed += 1
        if self._passed <= request.skip:
            return b""
        self._passed = 0
        self._left = max(self._left - 1, 0)
        if request.count and not self._left:
            self.stall()
        frame = self._measured(request, f"{self._command[:13]}{self._left:02d}{self._command[15:]}", "99")
        if self.lose_next:
            self.lose_next -= 1
            return b""
        frame = self._out(frame)
        return frame if self._hears() else bytes(byte ^ 0xA5 for byte in frame)

    def _restart(self, now: float) -> None:
        self.stall()
        self.old, self.baud = self.model.old, BAUDS[0]
        self._began, self._sweeps, self._reboot_at = now, 0, -np.inf
        self._dead = False
        self._lines.expire()

    @property
    def _turn_s(self) -> float:
        return 60 / self.motor_speed

    def _hears(self, *, anyhow: bool = False) -> bool:
        """``anyhow``: whatever the speed of the line is."""
        same = anyhow or self.line_baud is None or self.line_baud() == self.baud
        return same and not self.silent and not self._dead and self._clock() >= self._began

    def _out(self, data: bytes) -> bytes:
        if self.garble_next and data:
            self.garble_next -= 1
            middle = len(data) // 2
            return data[:middle] + bytes(byte ^ 0x55 for byte in data[middle : middle + 3]) + data[middle + 3 :]
        if self.cut_next and data:
            self.cut_next -= 1
            return data[: len(data) // 2]
        return data

    def _answer(self, command: str) -> bytes:
        name, _, text = command.partition(";")
        if self.old:
            return self._answer_old(command)
        if len(text) > 16:
            return wording.reply(command, "0G")
        if status := self.refuse.get(name[:2]):
            return wording.reply(command, status)
        if self.state == "time" and not name.startswith(_WHILE_ADJUSTING):
            return wording.reply(command, "0E")
        if name[:2] in ("MD", "MS", "ME", "GD", "GS", "GE"):
            return self._measure(command, name)
        if name in ("VV", "PP", "II", "%ST"):
            return wording.reply(command, "00", self._told(name))
        if name[:2] in ("TM", "SS"):
            return self._adjust(command, name)
        return wording.reply(command, self._switch(name))

    def _answer_old(self, command: str) -> bytes:
        """SCIP 1.1: a status of one character, no sums."""
        head = command.encode("latin-1") + b"\n"
        request = OldMeasure.parse(command)
        if status := self.refuse.get(command[:2]):
            return head + status.encode() + b"\n\n"
        if command == "SCIP2.0":
            self.old = False
            return head + b"0\n\n"
        if command == "V":
            return head + b"0\n" + "".join(f"{line}\n" for line in wording.version(self.model)).encode() + b"\n"
        if command in ("L0", "L1"):
            self.state = "single" if command == "L1" else "standby"
            return head + b"0\n\n"
        if request is None or request.end > self.model.parameters.amax or not self.laser_on:
            return head + b"E\n\n"
        p = self.model.parameters
        raw = raw_ranges(self._newest()[0], p)[request.start - p.amin : request.end - p.amin + 1]
        picked = wording.nearest(raw, (raw >= p.dmin) & (raw <= p.dmax), request.cluster)
        chars = encode(raw[picked], 2)
        lines = (chars[at : at + 64] + b"\n" for at in range(0, len(chars), 64))
        return head + b"0\n" + b"".join(lines) + b"\n"

    def _switch(self, name: str) -> str:
        """The status of a command that only does something."""
        if name == "BM":
            if self.broken:
                return "01"
            status = "02" if self.laser_on else "00"
            self.state = "single" if status == "00" else self.state
            return status
        if name == "QT":
            self.stall()
            return "00"
        if name in ("RS", "RT"):
            speed = self.baud
            self._restart(self._clock())
            self.old, self.baud = False, BAUDS[0] if name == "RS" else speed
            return "00"
        if name == "RB":
            again = self._clock() - self._reboot_at < _REBOOT_WITHIN_S
            self._reboot_at = self._clock()
            if again:
                self._restart(self._clock() + self._boot_s)
            return "00" if again else "01"
        if name in ("HS0", "HS1"):
            return "00"
        if name == "%SL" and self.model.states:
            self.stall()
            self.state = "asleep"
            return "00"
        return "0E"

    def _adjust(self, command: str, name: str) -> bytes:
        what, value = name[:2], name[2:]
        if what == "SS":
            status = self._set_speed(value)
        elif value not in ("0", "1", "2"):
            status = "01"
        elif value == "1" and self.state == "time":
            return wording.reply(command, "00", wording.stamp(self._stamp_ms()))
        elif value == "1":
            status = "04"
        elif (self.state == "time") is (value == "0"):
            status = "02" if value == "0" else "03"
        else:
            self.stall()
            self.state, status = ("time" if value == "0" else "standby"), "00"
        return wording.reply(command, status)

    def _set_speed(self, value: str) -> str:
        if not self.model.serial_line:
            return "0F" if self.model.states else "04"
        if len(value) != 6 or not (value.isascii() and value.isdigit()):
            return "01"
        if int(value) not in BAUDS:
            return "02"
        if int(value) == self.baud:
            return "03"
        self.baud = int(value)
        return "00"

    def _told(self, name: str) -> bytes:
        model = self.model
        if name == "%ST":
            return wording.line("900" if self.broken else _STATES[self.state])
        if name == "PP":
            return wording.fields(model.parameters.lines())
        if name == "VV":
            said = wording.fields(wording.version(model))
            return said[:-2] + b"~\nstray line\n" if self.stray_line else said
        texts = wording.state(
            model,
            laser_on=self.laser_on,
            speed=self.motor_speed,
            baud=self.baud,
            stamp_ms=self._stamp_ms(),
            broken=bool(self.broken),
        )
        return wording.fields(texts, remarks_unsummed=self.remarks_unsummed)

    def _measure(self, command: str, name: str) -> bytes:
        if name[1] == "E" and self.model.dies_of_intensity:
            self._dead = True
            return b""
        request = Measure.parse(command)
        if request is None:
            return wording.reply(command, _what_is_wrong(name))
        p = self.model.parameters
        if not p.amin <= request.start or request.end > p.amax:
            return wording.reply(command, "04")
        if request.end < request.start:
            return wording.reply(command, "05")
        if self.broken:
            return wording.reply(command, self.broken)
        if request.code[0] == "G":
            return self._measured(request, command, "00") if self.laser_on else wording.reply(command, "10")
        self.state, self._request, self._command = "multi", request, command
        self._left, self._passed = request.count, 0
        self._sweeps = int((self._clock() - self._began) / self._turn_s)
        return wording.reply(command, "00")

    def _measured(self, request: Measure, echo: str, status: str) -> bytes:
        p = self.model.parameters
        metres, intensities = self._newest()
        wanted = slice(request.start - p.amin, request.end - p.amin + 1)
        raw = raw_ranges(metres, p)[wanted]
        picked = wording.nearest(raw, (raw >= p.dmin) & (raw <= p.dmax), request.cluster)
        light = None
        if request.code[1] == "E":
            found = np.zeros(len(metres)) if intensities is None else intensities
            light = np.rint(np.nan_to_num(found[wanted][picked])).astype(np.int32)
        began_s = max(int((self._clock() - self._began) / self._turn_s) - 1, 0) * self._turn_s
        body = wording.stamp(self._stamp_ms(began_s)) + wording.data(raw[picked], light, request.width)
        return wording.reply(echo, status, body)

    def _newest(self) -> tuple[Array, Array | None]:
        metres, intensities = self._scan()
        if len(metres) != self.model.parameters.steps:
            raise ValueError(f"{len(metres)} ranges for {self.model.parameters.steps} steps of {self.model.product}")
        return metres, intensities

    def _stamp_ms(self, at_s: float | None = None) -> int:
        since_s = self._clock() - self._began if at_s is None else at_s
        return (int(since_s * 1000) + self.clock_ahead_ms) % STAMP_TURN_MS


def _what_is_wrong(name: str) -> str:
    """The status of a request for scans that is not well formed."""
    if len(name) != (15 if name[0] == "M" else 12):
        return "0C" if len(name) < 15 else "0D"
    parts = {"01": name[2:6], "02": name[6:10], "03": name[10:12], "06": name[12:13], "07": name[13:15]}
    return next((status for status, digits in parts.items() if digits and not digits.isdigit()), "0E")
