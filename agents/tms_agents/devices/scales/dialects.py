"""What ASCII scales say: one table per dialect, one parser for all.

Sources: SparkFun OpenScale firmware 1.0 and 1.2 (``OpenScale.ino``); A&D manuals of the EK-L, GC, HC-i and FX-i series,
chapters on the data format and on acknowledge and error codes; Mettler Toledo MT-SICS in the manuals of the JS, AT and
AL-IC series and the reference manual 11780711.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

from tms_agents.devices.loads import LoadSample

DialectName = Literal["openscale", "and", "mt-sics"]
Mode = Literal["poll", "stream"]

#: Grams in a unit, by the letters the scales print.
GRAMS: Mapping[str, float] = {
    "g": 1.0,
    "kg": 1000.0,
    "mg": 0.001,
    "t": 1e6,
    "lb": 453.59237,
    "lbs": 453.59237,
    "oz": 28.349523125,
    "ozt": 31.1034768,
    "ct": 0.2,
}


@dataclass(frozen=True, slots=True)
class Reading:
    """A weight line. ``shape`` is what two lines of one scale have in common: see ``ScaleLineSession``."""

    sample: LoadSample
    shape: tuple[object, ...] = ()


@dataclass(frozen=True, slots=True)
class Answer:
    """The answer to a command; ``refusal`` says why it was not obeyed, "" where it was."""

    refusal: str = ""


@dataclass(frozen=True, kw_only=True, slots=True)
class Dialect:
    """How one family of scales is asked, and what its lines mean.

    ``weight`` has the groups ``value`` and ``unit``, and optionally ``status`` or ``trouble`` (a key of ``states``),
    ``error`` (a code), ``before`` and ``after`` (other columns). ``answers`` have a group ``code``, a key of their
    refusals. ``silent_commands``: a command may go without an answer.
    """

    weight: re.Pattern[str]
    states: Mapping[str, LoadSample] = field(default_factory=dict)
    answers: tuple[tuple[re.Pattern[str], Mapping[str, str]], ...] = ()
    ask: bytes
    stream: bytes = b""
    stop: bytes = b""
    zero: bytes = b""
    tare: bytes = b""
    silent_commands: bool = False
    #: Numbers are padded with zeros: all have the same number of digits.
    padded: bool = False
    baud: int = 9600
    bits: int = 8
    parity: str = "N"


def parse_line(dialect: Dialect, line: bytes) -> Reading | Answer | None:
    """What a line says; None if it says nothing in this dialect (a banner, a menu, half a line, noise)."""
    try:
        text = line.decode("ascii").strip(" \x00")
        text = text.lstrip(_ACK) or text  # sent without an end of line
    except UnicodeDecodeError:
        return None
    for pattern, refusals in dialect.answers:
        if match := pattern.fullmatch(text):
            code = match["code"] or ""
            return Answer(f"{refusals.get(code, 'error')} ({text})" if code not in _DONE else "")
    match = dialect.weight.fullmatch(text)
    return _reading(dialect, match.groupdict()) if match else None


def _reading(dialect: Dialect, found: Mapping[str, str | None]) -> Reading:
    value, unit = found["value"] or "", found["unit"] or ""
    state = dialect.states.get(found.get("status") or found.get("trouble") or "", LoadSample(values=()))
    grams = GRAMS.get(unit.lower())
    if state.fault:
        fault = state.fault
    elif found.get("error"):
        fault = f"error {found['error']}"
    elif value.lstrip("-") in _NO_NUMBER:
        fault = _NO_NUMBER[value.lstrip("-")]
    elif grams is None:
        fault = f"the scale shows {unit}, which is no unit of mass"
    else:
        fault = ""
    if fault or grams is None:
        return Reading(LoadSample(values=_NAN, stable=state.stable, fault=fault))
    number = value.replace(" ", "")
    digits = sum(character.isdigit() for character in number)
    shape = (
        unit,
        len(number.partition(".")[2]),
        (found.get("before") or "").count(","),
        (found.get("after") or "").count(","),
        digits if dialect.padded else 0,
    )
    return Reading(LoadSample(values=(float(number) * grams,), stable=state.stable), shape)


_ACK = "\x06"
_NAN = (float("nan"),)
#: What an Arduino prints for what is not a number.
_NO_NUMBER = {"nan": "no reading", "inf": "overload", "ovf": "overload"}
#: Answers that are none of a refusal: done, understood, acknowledged.
_DONE = ("", "A", "D", "S")

_AND_ERRORS = {
    "0": "communication error",
    "1": "undefined command",
    "2": "not ready",
    "3": "timeout",
    "4": "too many characters",
    "6": "format error",
    "7": "value out of range",
    "11": "not stable",
    "17": "out of range",
    "20": "calibration weight too heavy",
    "21": "calibration weight too light",
}
_SICS_ERRORS = {
    "ES": "syntax error",
    "ET": "transmission error",
    "EL": "logical error",
    "I": "not executable now",
    "L": "wrong parameter",
    "+": "upper limit exceeded",
    "-": "lower limit exceeded",
}

_DIGITS = r"(?:\d{1,12}\.?\d{0,9}|\.\d{1,9})"
OPENSCALE = Dialect(
    # 1.0: [milliseconds,][local temperature,][remote temperature,]reading,unit
    # 1.2: [milliseconds,]reading,unit,[raw,][local temperature,][remote temperature,]
    weight=re.compile(
        r"(?P<before>(?:-?\d+(?:\.\d+)?,){0,3})(?P<value>-?(?:\d{1,9}(?:\.\d{1,9})?|nan|inf|ovf)),(?P<unit>kg|lbs)"
        r"(?P<after>(?:,(?:-?(?:\d+(?:\.\d+)?|nan))?){0,4})"
    ),
    ask=b"!",
)
AND = Dialect(
    # header, [second header: gross, net, comparison,] sign and zero-padded number, unit right-aligned in three
    weight=re.compile(
        r"(?P<status>ST|US|OL|QT)(?:,(?:GS|NT|LO|OK|HI|--))?,"
        rf" ?(?P<value>[+-] *{_DIGITS})(?:E\+19| *(?P<unit>[A-Za-z%]+))"
    ),
    states={
        "ST": LoadSample(values=(), stable=True),
        "US": LoadSample(values=(), stable=False),
        "OL": LoadSample(values=_NAN, stable=False, fault="overload"),
        "QT": LoadSample(values=_NAN, stable=True, fault="the scale counts pieces"),
    },
    answers=((re.compile(r"EC,E0?(?P<code>\d{1,2})"), _AND_ERRORS), (re.compile(rf"{_ACK}+(?P<code>)"), {})),
    ask=b"Q\r\n",
    stream=b"SIR\r\n",
    stop=b"C\r\n",
    zero=b"Z\r\n",
    tare=b"T\r\n",
    silent_commands=True,
    padded=True,
    baud=2400,
    bits=7,
    parity="E",
)
MT_SICS = Dialect(
    weight=re.compile(
        rf"S (?:(?P<status>[SD]) +(?:(?P<value>[+-]?{_DIGITS}) +(?P<unit>[A-Za-z%]+)|Error (?P<error>\w+))"
        r"|(?P<trouble>[I+-]))"
    ),
    states={
        "S": LoadSample(values=(), stable=True),
        "D": LoadSample(values=(), stable=False),
        "I": LoadSample(values=_NAN, fault="busy"),
        "+": LoadSample(values=_NAN, stable=False, fault="overload"),
        "-": LoadSample(values=_NAN, stable=False, fault="underload"),
    },
    answers=(
        (re.compile(r"(?P<code>ES|ET|EL)"), _SICS_ERRORS),
        (re.compile(r"(?:Z|ZI|T|TI|TAC) (?P<code>[ASDIL+-])(?: .*)?"), _SICS_ERRORS),
        (re.compile(r"I4 A .*(?P<code>)"), {}),
    ),
    ask=b"SI\r\n",
    stream=b"SIR\r\n",
    stop=b"SI\r\n",
    zero=b"Z\r\n",
    tare=b"T\r\n",
)
DIALECTS: Mapping[DialectName, Dialect] = {"openscale": OPENSCALE, "and": AND, "mt-sics": MT_SICS}
