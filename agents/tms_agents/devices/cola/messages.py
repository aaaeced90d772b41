"""What is said beside the scans: logging in, setting up, states, refusals. Source: SICK 8014631, telegram listing."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

from tms_agents.devices.cola.framing import Dialect, Telegram
from tms_agents.devices.cola.scandata import NAME
from tms_agents.devices.cola.values import Reader, Writer

#: What the device answers to a verb.
ANSWERS = {"sRN": "sRA", "sWN": "sWA", "sMN": "sAN", "sEN": "sEA"}
#: Hashes of the password of the level "authorized client": of most models, and of the safety scanners.
PASSWORDS = (0xF4724744, 0x6FD62C05)
AUTHORIZED_CLIENT = 3
READY, DEVICE_ERROR = 1, 2
_REFUSALS = (
    "no error",
    "the login does not allow it",
    "unknown method",
    "unknown variable",
    "not possible now, or a value out of its limits",
    "invalid data",
    "unknown error",
    "buffer too small",
    "values are missing",
    "unknown type",
    "the variable cannot be written",
    "unknown command",
    "unknown kind of command",
    "busy with another command",
    "array out of its bounds",
    "unknown event",
    "value too large",
    "invalid character",
)
#: Nearest and farthest distance in metres by model. Sources: data sheets.
_LIMITS: tuple[tuple[str, tuple[float, float]], ...] = (
    ("TiM24|TiM25|TiM26", (0.05, 14.5)),
    ("TiM55|TiM56", (0.05, 10.0)),
    ("TiM5|TiM7|TiM8", (0.05, 25.0)),
    ("LMS1000", (0.2, 64.0)),
    ("LMS10|LMS11|LMS12|LMS13", (0.5, 20.0)),
    ("LMS14|LMS15", (0.5, 50.0)),
    ("LMS5", (0.2, 80.0)),
)
#: 16 bits in millimetres.
_UNKNOWN_LIMITS = (0.05, 65.535)

Ask = Callable[[Dialect], Telegram]


@dataclass(frozen=True, slots=True)
class Command:
    """One question: how it is sent in either dialect, and what it is called where it goes wrong."""

    verb: str
    name: str
    ask: Ask
    #: A refusal, or no answer, does no harm.
    optional: bool = False

    def answered_by(self, reader: Reader) -> bool:
        return reader.verb == ANSWERS[self.verb] and reader.name == self.name


def _command(verb: str, name: str, values: Callable[[Writer], Writer] = lambda w: w, *, optional: bool) -> Command:
    return Command(verb, name, lambda dialect: values(Writer(dialect, verb, name)).telegram(), optional)


def read(name: str, *, optional: bool = True) -> Command:
    return _command("sRN", name, optional=optional)


def method(name: str, *, optional: bool = False) -> Command:
    return _command("sMN", name, optional=optional)


def login(password: int) -> Command:
    return _command("sMN", "SetAccessMode", lambda w: w.put("B", AUTHORIZED_CLIENT).put("I", password), optional=False)


def content(intensities: bool, *, bits: int = 16) -> Command:
    """Send the first echo, with intensities of 8 or 16 bits, of every scan."""

    def values(writer: Writer) -> Writer:
        # first echo; unit of the intensities, encoders, position, name and comment: none; the time: yes
        writer.put("B", 1, 0, intensities, bits == 16, 0, 0, 0, 0, 0, 0, 1)
        return writer.put("H", 1)

    return _command("sWN", "LMDscandatacfg", values, optional=False)


class ScanConfig(NamedTuple):
    """Pace, resolution and field of view, in the units of the device: hundredths of a hertz, 1/10,000 degrees."""

    frequency: int
    resolution: int
    start: int
    stop: int

    @classmethod
    def of(cls, reader: Reader) -> ScanConfig:
        """Of an answer to ``LMPscancfg``. Raises: ValueError."""
        frequency, _, resolution = reader.integer("I"), reader.integer("H"), reader.integer("I")
        return cls(frequency, resolution, reader.integer("i"), reader.integer("i"))

    def scans(self, frequency_hz: float, resolution_deg: float) -> bool:
        """Whether it is that pace and resolution, of which thirds and sixths are cut off or rounded."""
        return self.frequency == round(100 * frequency_hz) and abs(self.resolution - 10_000 * resolution_deg) < 2

    @property
    def field_deg(self) -> tuple[float, float]:
        return self.start / 10_000, self.stop / 10_000


def scan_config(frequency_hz: float, resolution_deg: float, start_deg: float, stop_deg: float) -> Command:
    """Pace and resolution; models other than LMS1xx and LMS5xx do not know it."""

    def values(writer: Writer) -> Writer:
        writer.put("I", round(100 * frequency_hz)).put("H", 1).put("I", round(10_000 * resolution_deg))
        return writer.put("i", round(10_000 * start_deg), round(10_000 * stop_deg))

    return _command("sMN", "mLMPsetscancfg", values, optional=False)


def output_range(resolution_deg: float, start_deg: float, stop_deg: float) -> Command:
    """The part of the field of view that is sent."""

    def values(writer: Writer) -> Writer:
        writer.put("H", 1).put("I", round(10_000 * resolution_deg))
        return writer.put("i", round(10_000 * start_deg), round(10_000 * stop_deg))

    return _command("sWN", "LMPoutputRange", values, optional=False)


def stream(on: bool, *, optional: bool = False) -> Command:
    return _command("sEN", NAME, lambda w: w.put("B", int(on)), optional=optional)


def refusal(reader: Reader) -> str:
    """Why a command is refused, of an ``sFA``."""
    try:
        code = reader.integer("H")
    except ValueError:
        return "no reason given"
    return f"error {code}: {_REFUSALS[code]}" if code < len(_REFUSALS) else f"error {code}"


def trouble(status: tuple[int, int]) -> str:
    """What the status in a scan complains of; empty where all is well."""
    said = ["an error"] if is_error(status) else []
    said += ["the window is polluted"] if status[1] & 0x06 else []
    return ", ".join(said)


def is_error(status: tuple[int, int]) -> bool:
    return bool(status[1] & 0x01)


def limits_m(model: str) -> tuple[float, float]:
    """Nearest and farthest distance that a model measures."""
    return next((limits for pattern, limits in _LIMITS if re.match(pattern, model)), _UNKNOWN_LIMITS)
