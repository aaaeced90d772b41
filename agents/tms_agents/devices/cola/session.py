"""The host side of CoLa: find out the dialect, log in, set up, subscribe to the scans and take them."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable, Iterable
from typing import Literal

from tms_agents.devices.cola import messages as m
from tms_agents.devices.cola.framing import Dialect, FrameParser, Telegram
from tms_agents.devices.cola.messages import Command
from tms_agents.devices.cola.scandata import NAME, ScanData, sweep
from tms_agents.devices.cola.values import Reader
from tms_agents.devices.outgoing import Outgoing
from tms_agents.devices.scans import Scan
from tms_agents.devices.sessions import DeviceFault

_REPLY_S, _METHOD_S, _REPEATS = 1.0, 3.0, 1
#: The first question, until there is an answer in one of the dialects: in each it is asked twice.
_FIRST_REPEATS = 3
#: So many starts, or damaged scans, in a row without a good scan between them are a fault.
_MAX_STARTS, _MAX_DAMAGED = 3, 5
_CLOCK_BITS = 32
#: Nothing within a telegram pauses so long.
_IDLE_S = 0.3
#: How long the mirror may take to come to another pace.
_NEW_PACE_S = 15.0
#: The session says what is missing before the link says that something is.
_MARGIN_S = 1.0
_SCAN_CONFIG_RESULTS = (
    "",
    "that pace is not possible",
    "that resolution is not possible",
    "that resolution is not possible with that field of view",
    "that field of view is not possible",
    "they do not go together",
)


class ColaSession(Outgoing):
    """Delivers a ``Scan`` per telegram; set-up, restarts of the device and damaged telegrams are its own business.

    ``dialect``: "auto" asks in CoLa B first, then in A. ``intensities`` has them sent with the scans, ``None`` leaves
    the device as it is set up. ``frequency_hz`` (LMS1xx, LMS5xx) and ``field_deg`` (start and stop, 90 is ahead) with
    ``resolution_deg`` change the scan; all that is changed is lost when the device is switched off. ``passwords`` are
    the hashes to log in with, tried in turn. ``forward_deg`` is the device's angle of straight ahead. Of the layers of
    a multi-layer scanner only ``layer`` is taken.

    ``model`` and ``serial`` are what the device tells; ``condition`` tells of pollution while it goes on measuring,
    empty where all is well. An error of the device is a ``DeviceFault``.
    """

    def __init__(
        self,
        *,
        dialect: Dialect | Literal["auto"] = "auto",
        intensities: bool | None = True,
        frequency_hz: float | None = None,
        resolution_deg: float | None = None,
        field_deg: tuple[float, float] | None = None,
        passwords: Iterable[int] = m.PASSWORDS,
        forward_deg: float = 90.0,
        layer: int = 0,
        silence_s: float = 3.0,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        super().__init__()
        if (frequency_hz is not None or field_deg is not None) and resolution_deg is None:
            raise ValueError("a pace or field of view is set together with a resolution")
        if resolution_deg is not None and frequency_hz is None and field_deg is None:
            raise ValueError("a resolution is set together with a pace or field of view")
        if field_deg is not None and not field_deg[0] < field_deg[1]:
            raise ValueError("a field of view goes from the smaller angle to the larger")
        self.frames = 0
        self.ready = False
        self.tick_s = 0.05
        self.model = self.serial = self.condition = ""
        self._dialects: deque[Dialect] = deque(["B", "A"] if dialect == "auto" else [dialect])
        self._intensities, self._frequency_hz = intensities, frequency_hz
        self._resolution_deg, self._field_deg = resolution_deg, field_deg
        self._passwords, self._forward_deg, self._layer = tuple(passwords), forward_deg, layer
        self._silence_s = silence_s
        self._clock, self._parser = clock, FrameParser()
        self._commands: deque[Command] = deque()
        self._current: Command | None = None
        self._since = self._heard_at = clock()
        self._tries = self._starts = self._damaged = self._login = 0
        #: Whether the mirror is on its way to another pace, for all that is known.
        self._new_pace = False
        self._found = False
        self._turns = _Unwrapped()

    @property
    def dialect(self) -> Dialect:
        """The dialect in use."""
        return self._dialects[0]

    @property
    def quiet_s(self) -> float:
        """An answer is waited for, and asked for again; a mirror that comes to another pace sends no scans."""
        if self._current is not None:
            return (1 + self._repeats) * _patience_s(self._current) + _MARGIN_S
        return _NEW_PACE_S + _MARGIN_S if self._new_pace else 0.0

    @property
    def note(self) -> str:
        return ", ".join(filter(None, (self.model, self.condition)))

    def opened(self) -> None:
        self._start()

    def receive(self, data: bytes) -> list[Scan]:
        if not data:
            return []
        self._heard_at = self._clock()
        return self._take(self._parser.feed(data))

    def tick(self) -> None:
        now = self._clock()
        if self._parser.pending and now - self._heard_at > _IDLE_S:
            self._take(self._parser.resume())
        if self._current is not None:
            if now - self._since > _patience_s(self._current):
                self._unanswered(self._current)
        elif now - self._since > (_NEW_PACE_S if self._new_pace else self._silence_s):
            self._start()

    def closing(self) -> bytes:
        return m.stream(False).ask(self.dialect).encode() if self._found else b""

    @property
    def pending(self) -> int:
        """Bytes of an incomplete telegram."""
        return self._parser.pending

    def _start(self) -> None:
        self._starts += 1
        if self._starts > _MAX_STARTS:
            raise DeviceFault(f"{self.model or 'the scanner'} answers, but sends no scans")
        self._current, self._login, self._new_pace = None, 0, False
        # what was subscribed to before would answer in between
        self._commands = deque([m.read("SCdevicestate"), m.stream(False, optional=True), m.read("DeviceIdent")])
        self._commands.append(m.read("SerialNumber"))
        if self._frequency_hz is None:
            self._set_up()
        else:  # the mirror would come to its pace again, whatever it was, each time that one is set
            self._commands.append(m.read("LMPscancfg", optional=False))
        self._advance()

    def _set_up(self, config: m.ScanConfig | None = None) -> None:
        """What is left to do to have scans, from the ``config`` that the device has now, where a pace is wanted."""
        self._commands += [*self._changes(config), m.stream(True)]

    def _changes(self, config: m.ScanConfig | None) -> list[Command]:
        changes: list[Command] = []
        pace_hz, step = self._frequency_hz, self._resolution_deg
        if config is not None and pace_hz is not None and step is not None and not config.scans(pace_hz, step):
            changes.append(m.scan_config(pace_hz, step, *(self._field_deg or config.field_deg)))
        if self._field_deg is not None and step is not None:
            changes.append(m.output_range(step, *self._field_deg))
        if self._intensities is not None:
            changes.append(m.content(self._intensities))
        if not changes:
            return []
        if not self._passwords:
            raise DeviceFault("what is to be changed needs a login")
        login = m.login(self._passwords[0])
        return [login, *changes, m.method("LMCstartmeas", optional=True), m.method("Run")]

    def _take(self, telegrams: list[Telegram]) -> list[Scan]:
        scans = []
        for telegram in telegrams:
            self.frames += 1
            try:
                reader = Reader(telegram)
            except ValueError:
                continue
            if reader.name == NAME and reader.verb in ("sSN", "sRA"):
                if (scan := self._scan(reader)) is not None:
                    scans.append(scan)
            elif self._current is not None:
                self._heard(reader, telegram.dialect, self._current)
        return scans

    def _heard(self, reader: Reader, dialect: Dialect, command: Command) -> None:
        if reader.verb == "sFA":
            if not command.optional:
                raise DeviceFault(f"{self._who()} refuses {command.verb} {command.name}: {m.refusal(reader)}")
        elif not command.answered_by(reader):
            return  # an event that nobody asked for, or a late answer
        if not self._found:
            self._found, self._dialects = True, deque([dialect])
        self._current = None
        if reader.verb != "sFA":
            try:
                self._answered(command, reader)
            except ValueError as error:
                if not command.optional:
                    raise DeviceFault(f"the answer to {command.name} cannot be understood: {error}") from error
        self._advance()

    def _answered(self, command: Command, reader: Reader) -> None:
        if command.name == "SCdevicestate" and reader.integer("B") == m.DEVICE_ERROR:
            raise DeviceFault(f"{self._who()} reports an error")
        if command.name == "DeviceIdent":
            self.model = f"{reader.text()} {reader.text()}".strip()
        elif command.name == "SerialNumber":
            self.serial = reader.text()
        elif command.name == "SetAccessMode" and reader.integer("B") != 1:
            self._login += 1
            if self._login >= len(self._passwords):
                raise DeviceFault(f"{self._who()} refuses the password")
            self._commands.appendleft(m.login(self._passwords[self._login]))
        elif command.name == NAME and not self._commands and reader.integer("B") != 1:
            raise DeviceFault(f"{self._who()} does not start to send scans")
        elif command.name == "LMPscancfg":
            self._set_up(m.ScanConfig.of(reader))
        elif command.name == "mLMPsetscancfg":
            if result := reader.integer("B"):
                why = _SCAN_CONFIG_RESULTS[min(result, len(_SCAN_CONFIG_RESULTS) - 1)]
                raise DeviceFault(f"{self._who()} refuses the scan: {why}")
            self._new_pace = True
        elif command.name == "Run" and reader.integer("B") != 1:
            raise DeviceFault(f"{self._who()} does not run")

    def _unanswered(self, command: Command) -> None:
        self._tries += 1
        if not self._found and len(self._dialects) > 1:
            self._dialects.rotate(-1)
        if self._tries <= self._repeats:
            self._since = self._clock()
            self._output += command.ask(self.dialect).encode()
        elif command.optional and self._found:
            self._current = None
            self._advance()
        else:
            tried = "" if self._found else f", in CoLa {' or '.join(sorted(self._dialects))}"
            raise DeviceFault(f"{self._who()} does not answer {command.verb} {command.name}{tried}")

    def _advance(self) -> None:
        if self._current is None and self._commands:
            self._current, self._tries = self._commands.popleft(), 0
            self._output += self._current.ask(self.dialect).encode()
        self._since = self._clock()

    def _scan(self, reader: Reader) -> Scan | None:
        try:
            data = ScanData.of(reader)
        except ValueError as error:
            self._damaged += 1
            if self._damaged >= _MAX_DAMAGED:
                raise DeviceFault(f"the scans of {self._who()} cannot be understood: {error}") from error
            return None
        self._damaged = 0
        if self._commands or (self._current is not None and self._current.name != NAME):
            return None  # of before it was set up
        if m.is_error(data.status):
            raise DeviceFault(f"{self._who()} reports: {m.trouble(data.status)}")
        self.condition = m.trouble(data.status)
        distances, strength = data.channel("DIST1"), data.channel("RSSI1")
        if distances is None:
            raise DeviceFault(f"{self._who()} sends no distances of a first echo")
        self._since, self._starts = self._clock(), 0
        self._new_pace, self.ready = False, True
        if data.layer != self._layer:
            return None
        count = len(distances.values)
        beams = sweep(
            distances.start_deg,
            distances.step_deg,
            count,
            data.scan_hz,
            data.measurement_hz,
            forward_deg=self._forward_deg,
            limits_m=m.limits_m(self.model),
            model=self.model,
        )
        fits = strength is not None and len(strength.values) == count
        intensities = strength.intensities() if strength is not None and fits else None
        return Scan(beams, distances.ranges(), intensities, self._turns.seconds(data.since_start_us))

    @property
    def _repeats(self) -> int:
        """How often the question under way is repeated."""
        return _REPEATS if self._found else _FIRST_REPEATS

    def _who(self) -> str:
        return self.model or "the scanner"


def _patience_s(command: Command) -> float:
    if command.name == "mLMPsetscancfg":
        return _NEW_PACE_S
    return _METHOD_S if command.verb == "sMN" else _REPLY_S


class _Unwrapped:
    """A clock of 32 bits in microseconds, which begins anew every 72 minutes, made to go on."""

    def __init__(self) -> None:
        self._last: int | None = None
        self._us = 0

    def seconds(self, reading: int) -> float:
        """Late telegrams, and scans of one turn, may go back a little."""
        if self._last is None:
            self._last = self._us = reading
        half = 1 << (_CLOCK_BITS - 1)
        self._us += (reading - self._last + half) % (1 << _CLOCK_BITS) - half
        self._last = reading
        return self._us / 1e6
