"""The host side of LMS2xx: stop it, ask what it is, set it up, then take the scans it streams or is asked for."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

from tms_agents.devices.lms200 import messages as m
from tms_agents.devices.lms200.codec import Frame, FrameParser, Mark
from tms_agents.devices.lms200.profiles import Profile, sweep
from tms_agents.devices.outgoing import Outgoing
from tms_agents.devices.scans import Scan
from tms_agents.devices.sessions import DeviceFault

Output = Literal["stream", "partial", "reflectivity", "request"]
#: How long the device may take by the manual, with some margin: to answer, to switch its mode, to write its memory.
_REPLY_S, _SWITCH_S, _WRITE_S = 1.0, 3.5, 8.0
_REPEATS = 2
#: Nothing within a telegram pauses so long.
_IDLE_S = 0.3
#: So many starts in a row without a scan between them are a fault.
_MAX_STARTS = 3
_SCAN_CODES = (m.RANGES, m.RANGES_AND_REFLECTIVITY)


@dataclass(frozen=True, slots=True)
class _Step:
    body: bytes
    name: str
    patience_s: float
    take: Callable[[Frame], None]


class Lms200Session(Outgoing):
    """Delivers a ``Scan`` per telegram; set-up, restarts of the device and damaged telegrams are its own business.

    ``output``: "stream" sends whole scans, "partial" every turn of the mirror by itself (interlaced: its beams lie one
    degree apart), "reflectivity" ranges with intensities (fast models, S14), "request" one scan at a time.
    ``angle_deg`` (100 or 180) and ``resolution_deg`` (0.25, 0.5 or 1; 0.25 with 100 only) are set, unless None: then
    they stay as they are, for models that do not know the command. ``measuring_mode`` and ``unit`` are written into
    the memory of the device where they differ from what is there. ``baud`` is the rate of the line, from which follows
    how often a scan comes.

    ``model`` is what the device calls itself; ``condition`` tells of pollution and the like while it goes on measuring,
    empty where all is well. An error of the device is a ``DeviceFault``.
    """

    def __init__(
        self,
        *,
        output: Output = "stream",
        angle_deg: int | None = 180,
        resolution_deg: float | None = 0.5,
        measuring_mode: int | None = None,
        unit: m.Unit | None = None,
        baud: int = 38400,
        address: int = 0,
        silence_s: float = 3.0,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        super().__init__()
        if (angle_deg is None) != (resolution_deg is None):
            raise ValueError("angle and resolution are set together or not at all")
        if angle_deg == 180 and resolution_deg == 0.25:
            raise ValueError("0.25 degrees go with an angle of 100 degrees only")
        if measuring_mode is not None and measuring_mode not in m.DISTANCE_BITS:
            raise ValueError(f"measuring mode {measuring_mode:02X} measures no distances")
        self.frames = 0
        self.ready = False
        self.tick_s = 0.05
        self.model = self.condition = ""
        self._output_kind, self._baud, self._address, self._silence_s = output, baud, address, silence_s
        self._variant = None if angle_deg is None or resolution_deg is None else (angle_deg, resolution_deg)
        self._wanted_mode, self._wanted_unit = measuring_mode, unit
        self._clock, self._parser = clock, FrameParser()
        self._steps: deque[_Step] = deque()
        self._current: _Step | None = None
        self._since = self._heard_at = clock()
        self._tries = self._starts = 0
        self._status: m.Status | None = None
        self._running = False

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
        if now - self._heard_at > _IDLE_S:
            self._take(self._parser.resume())
        if self._current is not None:
            if now - self._since > self._current.patience_s:
                self._repeat("does not answer")
        elif now - self._since > self._silence_s:
            self._start()

    def closing(self) -> bytes:
        return self._encode(m.switch_mode(m.ON_REQUEST))

    @property
    def pending(self) -> int:
        """Bytes of an incomplete telegram."""
        return self._parser.pending

    def _take(self, items: list[Frame | Mark]) -> list[Scan]:
        scans = []
        for item in items:
            if isinstance(item, Mark):
                if not item.heard and self._current is not None:
                    self._repeat("did not hear")
            elif (scan := self._heard(item)) is not None:
                scans.append(scan)
        return scans

    def _heard(self, frame: Frame) -> Scan | None:
        self.frames += 1
        if frame.code in _SCAN_CODES and (self._running or self._asks_scan()):
            return self._scan(frame)
        step = self._current
        if frame.code == m.POWER_ON:
            self._start()
        elif step is not None and frame.code == m.UNKNOWN_COMMAND:
            raise DeviceFault(f"the scanner does not know how to {step.name}")
        elif step is not None and frame.code == m.reply_to(step.body[0]):
            self._current = None
            step.take(frame)
            self._advance()
        return None

    def _asks_scan(self) -> bool:
        return self._current is not None and self._current.body[0] == m.REQUEST

    def _scan(self, frame: Frame) -> Scan | None:
        if m.is_error(frame.status):
            raise DeviceFault(f"the scanner reports: {m.trouble(frame.status)}")
        self.condition = m.trouble(frame.status)
        try:
            profile = Profile.of(frame.code, frame.data)
        except ValueError as error:
            raise DeviceFault(f"a scan cannot be understood: {error}") from error
        status = self._status
        assert status is not None
        beams = sweep(
            status.angle_deg,
            status.resolution_deg,
            quarter=profile.quarter,
            partial=profile.partial,
            measuring_mode=status.measuring_mode,
            unit=profile.unit,
            telegram_s=(2 * len(profile.values) + 10) * 10 / self._baud,
            model=self.model,
        )
        if len(beams.angles) != len(profile.values):  # its field of view was changed, or it was switched off and on
            self._start()
            return None
        self.ready, self._starts, self._since = True, 0, self._clock()
        if self._output_kind == "request":
            self._current = None
            self._advance()
        return Scan(beams, profile.ranges(status.measuring_mode), profile.intensities())

    def _start(self) -> None:
        self._starts += 1
        if self._starts > _MAX_STARTS:
            raise DeviceFault("the scanner answers, but does not scan")
        self._running, self._current = False, None
        stop = self._switch(m.switch_mode(m.ON_REQUEST), "stop")
        self._steps = deque(
            [
                stop,
                _Step(bytes([m.TYPE]), "tell its type", _REPLY_S, self._take_type),
                _Step(bytes([m.READ_CONFIG]), "tell its configuration", _REPLY_S, self._take_config),
            ]
        )
        if self._variant is not None:
            name = f"scan {self._variant[0]} degrees in steps of {self._variant[1]:g}"
            self._steps.append(_Step(m.variant(*self._variant), name, _SWITCH_S, self._took_variant))
        self._steps.append(_Step(bytes([m.STATUS]), "tell its status", _REPLY_S, self._take_status))
        self._advance()

    def _advance(self) -> None:
        if self._current is not None:
            return
        if not self._steps and self._output_kind == "request":
            self._steps.append(_Step(m.request_scan(), "scan", _REPLY_S, lambda _: None))
        if self._steps:
            self._current, self._tries = self._steps.popleft(), 0
            self._output += self._encode(self._current.body)
        self._since = self._clock()

    def _repeat(self, why: str) -> None:
        assert self._current is not None
        self._tries += 1
        if self._tries > _REPEATS:
            raise DeviceFault(f"the scanner {why} when told to {self._current.name}")
        self._since = self._clock()
        self._output += self._encode(self._current.body)

    def _encode(self, body: bytes) -> bytes:
        return Frame(body, self._address).encode()

    def _switch(self, body: bytes, name: str) -> _Step:
        def take(frame: Frame) -> None:
            if frame.data[:1] != b"\x00":
                why = " (wrong password?)" if frame.data[:1] == b"\x01" else ""
                raise DeviceFault(f"the scanner refuses to {name}{why}")

        return _Step(body, name, _SWITCH_S, take)

    def _take_type(self, frame: Frame) -> None:
        self.model = frame.data.decode("ascii", "replace").strip()

    def _take_config(self, frame: Frame) -> None:
        config = m.Config.of(frame.data)
        if config is None:
            raise DeviceFault(f"the scanner tells its configuration in {len(frame.data)} bytes")
        wanted = config.changed(self._wanted_mode, self._wanted_unit)
        if wanted != config:
            write = bytes([m.WRITE_CONFIG]) + wanted.raw
            self._steps.extendleft(
                [
                    self._switch(m.switch_mode(m.ON_REQUEST), "measure again"),
                    _Step(write, "change its configuration", _WRITE_S, self._wrote_config),
                    self._switch(m.installation(), "be configured"),
                ]
            )

    def _wrote_config(self, frame: Frame) -> None:
        if frame.data[:1] != b"\x01":
            raise DeviceFault("the scanner refuses the measuring mode or unit")

    def _took_variant(self, frame: Frame) -> None:
        if frame.data[:1] != b"\x01":
            raise DeviceFault("the scanner refuses the angle and resolution; does it have fixed ones?")

    def _take_status(self, frame: Frame) -> None:
        status = m.Status.of(frame.data)
        if status is None or status.resolution_deg not in (0.25, 0.5, 1.0) or not 0 < status.angle_deg <= 180:
            raise DeviceFault("the status of the scanner cannot be understood")
        if status.measuring_mode not in m.DISTANCE_BITS:
            raise DeviceFault(f"the scanner is in measuring mode {status.measuring_mode:02X}: no distances")
        self._status = status
        if self._output_kind == "request":
            return
        beams = round(status.angle_deg / status.resolution_deg) + 1
        start = {
            "stream": m.switch_mode(m.STREAM),
            "partial": m.switch_mode(m.STREAM_PARTIAL),
            "reflectivity": m.stream_reflectivity(1, beams),
        }[self._output_kind]
        step = self._switch(start, f"send scans ({self._output_kind})")
        self._steps.append(_Step(step.body, step.name, step.patience_s, lambda frame: self._started(step, frame)))

    def _started(self, step: _Step, frame: Frame) -> None:
        step.take(frame)
        self._running = True
