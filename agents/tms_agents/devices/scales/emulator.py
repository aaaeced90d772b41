"""Scales for tests and demos: bytes in, bytes out; a line of ``devices.emulation`` puts them behind a terminal or port.

What lies on the pan is a function of time in grams. Scales that send by themselves need a line with ``tick_s``.
"""

from __future__ import annotations

import time
from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Callable

from tms_agents.devices.lines import LineParser
from tms_agents.devices.scales.dialects import GRAMS
from tms_agents.devices.scales.parity import add_even_parity, strip_even_parity

#: The pan has come to rest when what was weighed in this time differs by less than that.
_STILL_G, _STILL_S = 0.5, 0.3


class Scale(ABC):
    """The pan, tare, stability and faults; a dialect says how it is put.

    ``silent``: neither hears nor speaks. ``refuse_next``: so many commands are answered with an error.
    ``power_cycle``: forgets tare, what it was sending and half a command, and is silent for ``boot_s``.
    """

    def __init__(
        self,
        grams: Callable[[float], float],
        *,
        capacity_g: float = 3000.0,
        unit: str = "g",
        decimals: int = 1,
        period_s: float = 0.1,
        boot_s: float = 0.2,
        software_parity: bool = False,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self.silent = False
        self.refuse_next = 0
        #: Commands received, for tests; the last thousand.
        self.heard: deque[str] = deque(maxlen=1000)
        self.unit, self.decimals = unit, decimals
        self._grams, self._capacity_g, self._period_s, self._boot_s = grams, capacity_g, period_s, boot_s
        self._parity, self._clock = software_parity, clock
        self._lines = LineParser()
        self._tare_g = 0.0
        self._weighed: deque[tuple[float, float]] = deque(maxlen=1000)
        self._streaming = False
        self._next_at = self._booted_at = clock()

    def power_cycle(self) -> None:
        self._lines, self._tare_g, self._streaming = LineParser(), 0.0, False
        self._booted_at = self._clock() + self._boot_s

    def receive(self, data: bytes) -> bytes:
        if self.silent or self._clock() < self._booted_at:
            return b""
        if self._parity:
            data = strip_even_parity(data)
        return self._wire("".join(f"{line}\r\n" for line in self._hear(data)))

    def tick(self) -> bytes:
        now = self._clock()
        if self.silent or now < self._booted_at or not self._streaming or now < self._next_at:
            return b""
        self._next_at = now + self._period_s
        return self._wire(f"{self._weight()}\r\n")

    def _wire(self, text: str) -> bytes:
        return add_even_parity(text.encode()) if self._parity else text.encode()

    def _hear(self, data: bytes) -> list[str]:
        said = []
        for line in self._lines.feed(data):
            command = line.decode("ascii", "replace")
            self.heard.append(command)
            if self.refuse_next:
                self.refuse_next -= 1
                said.append(self._error())
            else:
                said += self._obey(command)
        return said

    @property
    def _gross_g(self) -> float:
        now = self._clock()
        self._weighed.append((now, self._grams(now)))
        while self._weighed[0][0] < now - _STILL_S:
            self._weighed.popleft()
        return self._weighed[-1][1]

    @property
    def _stable(self) -> bool:
        now = self._gross_g
        return all(abs(then - now) < _STILL_G for _, then in self._weighed)

    @property
    def _value(self) -> float:
        return (self._gross_g - self._tare_g) / GRAMS[self.unit]

    @property
    def _out_of_range(self) -> int:
        """1 above, -1 below, 0 within what the scale can weigh."""
        return int(self._gross_g > self._capacity_g) - int(self._gross_g < -self._capacity_g / 10)

    def _take_tare(self) -> None:
        self._tare_g = self._gross_g

    @abstractmethod
    def _weight(self) -> str: ...

    @abstractmethod
    def _obey(self, command: str) -> list[str]: ...

    @abstractmethod
    def _error(self) -> str: ...


class AndScale(Scale):
    """A&D: ``Q SI`` now, ``S`` when stable, ``SIR`` stream, ``C`` stop, ``Z`` re-zero, ``T`` tare."""

    #: Whether control commands are acknowledged: a setting of the real ones.
    acknowledge = True

    def _weight(self) -> str:
        if self._out_of_range:
            return f"OL,{'+' if self._out_of_range > 0 else '-'}9999999E+19"
        head = "ST" if self._stable else "US"
        return f"{head},{self._value:+0{9}.{self.decimals}f}{self.unit:>3}"

    def _obey(self, command: str) -> list[str]:
        done = ["\x06"] if self.acknowledge else []
        if command in ("Q", "SI"):
            return [self._weight()]
        if command == "S":
            return [self._weight()] if self._stable else []
        if command in ("SIR", "C"):
            self._streaming = command == "SIR"
            return []
        if command in ("Z", "T"):
            if not self._stable or self._out_of_range:
                return ["EC,E11"]
            self._take_tare()
            return done * 2
        return [self._error()]

    def _error(self) -> str:
        return "EC,E01"


class SicsScale(Scale):
    """MT-SICS: ``S`` stable, ``SI`` now, ``SIR`` stream, ``Z ZI`` zero, ``T TI`` tare, ``@`` restart."""

    def _weight(self) -> str:
        if self._out_of_range:
            return f"S {'+' if self._out_of_range > 0 else '-'}"
        return f"S {'S' if self._stable else 'D'} {self._value:10.{self.decimals}f} {self.unit}"

    def _obey(self, command: str) -> list[str]:
        if command in ("SI", "S", "SIR"):
            self._streaming = command == "SIR"
            return [self._weight() if self._stable or command != "S" else "S I"]
        if command in ("Z", "T", "ZI", "TI"):
            return [self._zero(command)]
        if command == "@":
            self._streaming, self._tare_g = False, 0.0
            return ['I4 A "0123456789"']
        return [self._error()]

    def _zero(self, command: str) -> str:
        if self._out_of_range:
            return f"{command} {'+' if self._out_of_range > 0 else '-'}"
        if not self._stable and command in ("Z", "T"):
            return f"{command} I"
        state = "S" if self._stable else "D"
        weight = f"{self._value:10.{self.decimals}f} {self.unit}"
        self._take_tare()
        return {"Z": "Z A", "ZI": f"ZI {state}", "T": f"T S {weight}", "TI": f"TI {state} {weight}"}[command]

    def _error(self) -> str:
        return "ES"


class OpenScale(Scale):
    """SparkFun OpenScale: sends by itself unless ``trigger`` is set, then once per trigger character.

    The columns are settings of the real one; ``firmware`` 1.0 prints them in another order than 1.2. The menu behind
    ``x`` is not played; the scale says nothing while a host is in it.
    """

    timestamp, raw, local_c, remote_c = True, False, True, True
    firmware = "1.2"
    trigger = ""
    _booting = False

    def power_cycle(self) -> None:
        super().power_cycle()
        self._booting = True

    def tick(self) -> bytes:
        self._streaming = not self.trigger
        if self._booting and self._clock() >= self._booted_at:
            self._booting = False
            return self._wire(_BANNER)
        return super().tick()

    def _hear(self, data: bytes) -> list[str]:
        heard = data.decode("latin-1")
        self.heard.extend(heard)
        return [self._weight() for character in heard if character == self.trigger]

    def _weight(self) -> str:
        millis = [f"{(self._clock() - self._booted_at) * 1000:.0f}"] if self.timestamp else []
        weight = [f"{self._value:.{self.decimals}f}", self.unit]
        raw = [f"{8_388_607 if self._out_of_range else 8000 + self._gross_g * 421:.0f}"] if self.raw else []
        temperatures = ["25.81"] * self.local_c + ["0"] * self.remote_c
        if self.firmware == "1.0":
            return ",".join([*millis, *temperatures, *weight])
        return ",".join([*millis, *weight, *raw, *temperatures, ""])

    def _obey(self, command: str) -> list[str]:
        return []

    def _error(self) -> str:
        return ""


_BANNER = (
    "\r\nSerial Load Cell Converter version 1.2\r\nBy SparkFun Electronics\r\nNo remote sensor found\r\n"
    "Minimum time between reports: 422\r\nPress x to bring up settings\r\nReadings:\r\n"
)
