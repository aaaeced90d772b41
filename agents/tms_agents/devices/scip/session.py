"""The host side of SCIP: make the sensor quiet, learn what it is, measure, and begin again where scans stop."""

from __future__ import annotations

import time
from collections.abc import Callable, Generator
from dataclasses import dataclass, replace
from typing import Literal

from tms_agents.devices.outgoing import Outgoing
from tms_agents.devices.scans import Scan, Sweep
from tms_agents.devices.scip import status as st
from tms_agents.devices.scip.clock import DeviceClock
from tms_agents.devices.scip.frames import Reply, ReplyParser
from tms_agents.devices.scip.measurements import Measurement, measurement
from tms_agents.devices.scip.models import URG_PARAMETERS, coding
from tms_agents.devices.scip.parameters import Parameters, fields, first_beam_s, motor_speed, sweep
from tms_agents.devices.scip.ranges import ranges
from tms_agents.devices.scip.requests import Measure, OldMeasure
from tms_agents.devices.sessions import DeviceFault

#: So often scans may stop without one between, and so often a question is repeated.
_MOST_RESTARTS, _MOST_TRIES = 3, 3
_BETWEEN_RESTARTS_S = 0.5
#: The session says what is missing before the link says that something is.
_MARGIN_S = 1.0


@dataclass(frozen=True, slots=True)
class ScipSettings:
    """``intensity`` "auto": where the model has it; "required": a fault where it has not.

    Angles (rad) bound what is measured, None to the end of the sensor's reach. ``cluster`` steps give one range, their
    nearest; ``skip`` scans are left out after each. ``short`` ranges take a third less of a slow line and end
    at 4.09 m. ``polled``: every scan is asked for, so that a slow line carries none that nobody waits for.
    """

    intensity: Literal["auto", "required", "off"] = "auto"
    angle_min: float | None = None
    angle_max: float | None = None
    cluster: int = 1
    skip: int = 0
    short: bool = False
    polled: bool = False

    def __post_init__(self) -> None:
        if not 1 <= self.cluster <= 99 or not 0 <= self.skip <= 9:
            raise ValueError("cluster must be 1 to 99, skip 0 to 9")
        if self.short and self.intensity == "required":
            raise ValueError("short ranges come without intensity")
        if self.angle_min is not None and self.angle_max is not None and self.angle_min >= self.angle_max:
            raise ValueError("angle_min must be less than angle_max")


@dataclass(frozen=True, slots=True)
class _Ask:
    """A command whose reply is awaited; None: whatever the sensor says instead of scans, or ``patience_s``."""

    command: str | None
    patience_s: float


_Course = Generator[_Ask, Reply | None, None]


class ScipSession(Outgoing):
    """Delivers a ``Scan`` per sweep. ``note`` tells in words what the sensor is and what it cannot do.

    A reply may take ``reply_s`` after the last byte heard. Without a scan for ``stall_s`` and five sweeps everything
    begins again, after three times in vain it is a fault.
    """

    def __init__(
        self,
        settings: ScipSettings | None = None,
        *,
        reply_s: float = 0.5,
        stall_s: float = 1.0,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        super().__init__()
        self.frames, self.ready = 0, False
        self.note = ""
        #: Replies to VV and II: maker, product, firmware, serial number, state.
        self.about: dict[str, str] = {}
        self._settings = settings or ScipSettings()
        self._reply_s, self._stall_s, self._clock = reply_s, stall_s, clock
        self._parser, self._device_clock = ReplyParser(), DeviceClock()
        self._parameters: Parameters | None = None
        self._speed: int | None = None
        self._request: Measure | OldMeasure | None = None
        self._sweep: Sweep | None = None
        self._swept: tuple[Parameters, Measure | OldMeasure, int | None] | None = None
        self._scans: list[Scan] = []
        self._restarts = 0
        self._old = False
        self._course = self._life()
        self._ask: _Ask | None = None
        self._asked_at = self._heard_at = self._scan_at = clock()

    @property
    def tick_s(self) -> float:
        """While the sensor measures by itself there is nothing to do but to see whether it still does."""
        return 0.2 if self._request is not None and not (self._old or self._settings.polled) else 0.02

    @property
    def quiet_s(self) -> float:
        """Until the first answer: as long as it takes to ask for one in every version of SCIP."""
        return 0.0 if self.frames else (2 * _MOST_TRIES + 1) * self._reply_s + _MARGIN_S

    @property
    def pending(self) -> int:
        """Bytes of an incomplete reply."""
        return self._parser.pending

    def opened(self) -> None:
        self._output += b"\n"  # ends what another program may have begun to say
        self._advance(None)

    def receive(self, data: bytes) -> list[Scan]:
        self._heard_at = self._clock()
        for reply in self._parser.feed(data):
            self._take(reply)
        scans, self._scans = self._scans, []
        return scans

    def tick(self) -> None:
        """Give up what does not come."""
        if self._ask is None:
            return
        now, patience_s = self._clock(), self._ask.patience_s
        since = max(self._asked_at, self._scan_at)
        # a slow line needs its time, but a sensor can be heard all the time and never say what is waited for
        if now - max(since, self._heard_at) > patience_s or now - since > 3 * patience_s + 1:
            self._parser.expire()
            self._advance(None)

    def closing(self) -> bytes:
        """The laser goes off."""
        return b"L0\n" if self._old else b"QT\n"

    # What happens in the order in which it happens.

    def _life(self) -> _Course:
        while True:
            self._request = None
            yield from self._quieten()
            if self._old:
                yield from self._measure_old()
            else:
                yield from self._learn()
                yield from self._measure()
            self._restarts += 1
            if self._restarts > _MOST_RESTARTS:
                raise DeviceFault(f"the sensor answers but sends no scans{self._state()}")
            self._request = None
            yield _Ask(None, _BETWEEN_RESTARTS_S)

    def _quieten(self) -> _Course:
        """Stop whatever the sensor does, in SCIP 2 from then on; sets ``_old`` where it has no SCIP 2."""
        self._old = False
        for _ in range(_MOST_TRIES):
            reply = yield _Ask("QT", self._reply_s)
            if reply is not None and reply.status == st.OK:
                return
            if reply is None or len(reply.status) == 1:  # SCIP 1.1 answers E, or leaves what it does not know alone
                reply = yield _Ask("SCIP2.0", self._reply_s)
            elif reply.status == "0E":
                reply = yield _Ask("TM2", self._reply_s)  # it was adjusting its clock
            elif reply.status == "0L":
                reply = yield _Ask("RS", self._reply_s)
            else:
                raise DeviceFault(f"QT: {st.meaning('QT', reply.status)}")
        reply = yield _Ask("V", self._reply_s)
        if reply is None or len(reply.status) != 1 or not reply.lines:
            raise DeviceFault("no answer to QT, in no version of SCIP" if reply is None else "does not become quiet")
        self._old, self.about = True, fields(reply.lines)

    def _learn(self) -> _Course:
        why, self._parameters = "no answer", None
        refused: Reply | None = None
        for _ in range(_MOST_TRIES):
            reply = yield _Ask("PP", self._reply_s)
            if reply is None:
                continue
            refused = reply if reply.status != st.OK else None
            if refused is not None:
                continue
            try:
                self._parameters = Parameters.parse(reply.lines)
            except ValueError as error:
                why = str(error)
            if self._parameters is not None and self._parameters.modl:  # a damaged line is left out
                break
        if self._parameters is None and refused is not None:
            yield from self._refused(refused)
        if self._parameters is None:
            raise DeviceFault(f"the sensor does not tell its parameters (PP): {why}")
        if "PROD" not in self.about:  # only once: a URG-04LX that is asked often falls silent
            reply = yield _Ask("VV", self._reply_s)
            self.about |= fields(reply.lines if reply is not None else ())
        yield from self._ask_state()
        if not self._parameters.modl:
            self._parameters = replace(self._parameters, modl=self.about.get("MODL", ""))
        self._speed = motor_speed(self.about, self._parameters.scan)

    def _measure(self) -> _Course:
        """Returns when scans stop."""
        assert self._parameters is not None
        if self._settings.polled:
            reply = yield _Ask("BM", self._reply_s)
            if reply is not None and reply.status not in (st.OK, "02"):
                yield from self._refused(reply)
        for request in self._requests(self._parameters):
            reply = yield _Ask(request.encode(), self._reply_s)
            if reply is None or st.is_checking(reply.status):
                return
            if reply.status in (st.OK, st.SCAN):
                break
            if request.code[1] == "E" and self._settings.intensity == "auto" and not st.is_hardware(reply.status):
                self.note = f"{self._name()}, without intensity: {st.meaning(request.code, reply.status)}"
                continue
            yield from self._refused(reply)
        self._begin(request)
        if self._settings.polled:
            yield from self._poll(request)
            return
        while True:
            reply = yield _Ask(None, self._patience_s())
            if reply is None:
                return
            if not st.is_checking(reply.status):
                yield from self._refused(reply)

    def _measure_old(self) -> _Course:
        """SCIP 1.1 knows neither parameters nor streams: a URG-04LX with its first firmware."""
        self._parameters, self._speed = URG_PARAMETERS, None
        if self._settings.intensity == "required":
            raise DeviceFault("SCIP 1.1 has no intensity")
        self.note = f"{self._name()}, SCIP 1.1: ranges up to 4.09 m, no time stamps"
        reply = yield _Ask("L1", self._reply_s)
        if reply is not None and reply.status != "0":
            raise DeviceFault(f"the laser does not go on: L1 status {reply.status}")
        request = OldMeasure(*self._steps(URG_PARAMETERS), self._settings.cluster)
        self._begin(request)
        yield from self._poll(request)

    def _poll(self, request: Measure | OldMeasure) -> _Course:
        """One scan after the other, not more often than the sensor sweeps."""
        assert self._parameters is not None
        turn_s = 60 / (self._speed or self._parameters.scan) * (self._settings.skip + 1)
        while True:
            due = self._clock() + turn_s
            reply = yield _Ask(request.encode(), self._patience_s())
            found = measurement(reply) if reply is not None else None
            if found is None:
                return
            self._deliver(found)
            yield _Ask(None, max(due - self._clock(), 0.0))

    # Helpers.

    def _take(self, reply: Reply) -> None:
        request = self._request
        if isinstance(request, Measure) and request.code[0] == "M" and reply.command[:2] == request.code:
            found = measurement(reply) if reply.status == st.SCAN else None
            if found is not None and found.distances.size == request.beams:
                self.frames += 1
                self._deliver(found)
                return
            if reply.status in (st.OK, st.SCAN):  # the answer to the request that began it came late
                return
            if self._ask is not None and self._ask.command is None:
                self.frames += 1
                self._advance(reply)
                return
        if self._ask is not None and self._ask.command == reply.command:
            self.frames += 1
            self._advance(reply)

    def _advance(self, reply: Reply | None) -> None:
        """The course goes on to its next question."""
        now = self._clock()
        self._ask = self._course.send(reply) if self._ask is not None else next(self._course)
        self._asked_at = now
        if self._ask.command is not None:
            self._output += self._ask.command.encode() + b"\n"

    def _deliver(self, found: Measurement) -> None:
        assert self._parameters is not None and self._sweep is not None
        self._scan_at, self.ready = self._clock(), True
        seconds = None
        if found.stamp_ms is not None:
            seconds = self._device_clock.unwrap(found.stamp_ms, self._scan_at, doubtful=self._restarts > 0)
            seconds += first_beam_s(self._parameters, found.request, self._speed)
        intensities = None if found.intensities is None else found.intensities.astype(float)
        self._restarts = 0
        self._scans.append(Scan(self._sweep, ranges(found, self._parameters), intensities, seconds))

    def _begin(self, request: Measure | OldMeasure) -> None:
        assert self._parameters is not None
        swept = self._parameters, request, self._speed
        if self._sweep is None or self._swept != swept:
            self._sweep, self._swept = sweep(*swept, self._settings.skip), swept
        self._request, self._scan_at = request, self._clock()

    def _requests(self, parameters: Parameters) -> list[Measure]:
        """What to try, the best first."""
        steps, settings = self._steps(parameters), self._settings
        has, wanted = coding(parameters.modl).intensity, settings.intensity
        self.note = self._name()
        if wanted == "required" and not has:
            raise DeviceFault(f"{parameters.modl or 'this model'} has no intensity")
        if wanted == "auto" and not has:
            self.note += ", without intensity: the model has none"
        form = (*steps, settings.cluster, 0 if settings.polled else settings.skip)
        plain, rich = Measure("MS" if settings.short else "MD", *form), Measure("ME", *form)
        if settings.polled:
            plain, rich = Measure("GS" if settings.short else "GD", *form), Measure("GE", *form)
        if not has or wanted == "off" or settings.short:
            return [plain]
        return [rich] if wanted == "required" else [rich, plain]

    def _steps(self, parameters: Parameters) -> tuple[int, int]:
        low, high = self._settings.angle_min, self._settings.angle_max
        first = parameters.amin if low is None else parameters.step(low)
        last = parameters.amax if high is None else parameters.step(high)
        if first >= last:
            raise DeviceFault(f"the sensor does not measure between the angles {low} and {high} rad")
        return first, last

    def _patience_s(self) -> float:
        return self._stall_s + 5 * (self._sweep.period_s if self._sweep is not None else 0.1)

    def _ask_state(self) -> _Course:
        reply = yield _Ask("II", self._reply_s)
        self.about |= fields(reply.lines if reply is not None else ())

    def _name(self) -> str:
        product = self.about.get("PROD") or (self._parameters.modl if self._parameters is not None else "")
        return " ".join(word for word in (product, self.about.get("SERI", "")) if word)

    def _state(self) -> str:
        return f"; its state: {self.about['STAT']}" if self.about.get("STAT") else ""

    def _refused(self, reply: Reply) -> _Course:
        """Raises: DeviceFault."""
        yield from self._ask_state()
        raise DeviceFault(f"{reply.command[:2]}: {st.meaning(reply.command, reply.status)}{self._state()}")
