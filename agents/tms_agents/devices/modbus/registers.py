"""Where a weighing module keeps its weights: there is no common map, so all of it is configuration."""

from __future__ import annotations

import math
import struct
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Literal

from tms_agents.devices.loads import LoadSample

Kind = Literal["int16", "uint16", "int32", "uint32", "float32"]
_FORMATS: Mapping[Kind, tuple[str, int]] = {
    "int16": (">h", 1),
    "uint16": (">H", 1),
    "int32": (">i", 2),
    "uint32": (">I", 2),
    "float32": (">f", 2),
}
#: Some modules answer no longer question than this (CAS CI-600D manual, page 83; Laumas TLU manual, page 34).
MOST_REGISTERS = 32


@dataclass(frozen=True, kw_only=True, slots=True)
class StatusRegister:
    """Bits about all cells, as masks. Where ``valid`` is given, all its bits must be set.

    ``stable`` and ``unstable``: what the module says of the motion, in whichever way it says it.
    """

    address: int
    stable: int = 0
    unstable: int = 0
    valid: int = 0
    faults: Mapping[int, str] = field(default_factory=dict)


@dataclass(frozen=True, kw_only=True, slots=True)
class WeighingMap:
    """Registers of one module, by their address in the request (register 40001 of a manual is address 0).

    ``cells``: address of the first register of each. ``function`` 3 reads holding registers, 4 input registers.
    ``scale``: grams per unit, or 1 for counts.

    Raises:
        ValueError: no cell, or an address or scale that cannot be.
    """

    cells: Sequence[int]
    device_id: int = 1
    function: Literal[3, 4] = 3
    kind: Kind = "int32"
    low_word_first: bool = False
    scale: float = 1.0
    status: StatusRegister | None = None

    def __post_init__(self) -> None:
        addresses = [*self.cells, *([self.status.address] if self.status else [])]
        if not self.cells:
            raise ValueError("a weighing module has at least one cell")
        if not all(0 <= address <= 65_534 for address in addresses):
            raise ValueError("register addresses are 0 to 65534")
        if not 0 <= self.device_id <= 247:
            raise ValueError(f"device id {self.device_id} is not 0 to 247")
        if not math.isfinite(self.scale) or not self.scale:
            raise ValueError(f"a scale of {self.scale} makes no weights")

    def blocks(self) -> list[tuple[int, int]]:
        """(first address, number of registers) of the questions to ask; registers side by side are asked at once."""
        width = _FORMATS[self.kind][1]
        wanted = {address + word for address in self.cells for word in range(width)}
        if self.status:
            wanted.add(self.status.address)
        blocks: list[tuple[int, int]] = []
        for address in sorted(wanted):
            if blocks and address == sum(blocks[-1]) and blocks[-1][1] < MOST_REGISTERS:
                blocks[-1] = (blocks[-1][0], blocks[-1][1] + 1)
            else:
                blocks.append((address, 1))
        return blocks

    def decode(self, registers: Mapping[int, int]) -> LoadSample:
        """A sample from the registers by address. Where the status says that something is wrong all values are NaN."""
        code, width = _FORMATS[self.kind]
        values = []
        for address in self.cells:
            words = [registers[address + word] for word in range(width)]
            raw = struct.pack(f">{width}H", *(reversed(words) if self.low_word_first else words))
            values.append(float(struct.unpack(code, raw)[0]) * self.scale)
        fault, stable = self._status(registers)
        usable = [math.isfinite(value) and not fault for value in values]
        if not fault and not all(usable):
            fault = "overload"
        values = [value if good else float("nan") for value, good in zip(values, usable, strict=True)]
        return LoadSample(values=tuple(values), stable=stable, fault=fault)

    def encode(self, values: Sequence[float]) -> dict[int, int]:
        """The registers by address that decode to these values, as nearly as their kind can say."""
        code, width = _FORMATS[self.kind]
        registers: dict[int, int] = {}
        for address, value in zip(self.cells, values, strict=True):
            number = value / self.scale
            raw = struct.pack(code, number if self.kind == "float32" else round(number))
            words = struct.unpack(f">{width}H", raw)
            registers |= {address + i: word for i, word in enumerate(reversed(words) if self.low_word_first else words)}
        return registers

    def _status(self, registers: Mapping[int, int]) -> tuple[str, bool | None]:
        if self.status is None:
            return "", None
        bits = registers[self.status.address]
        faults = [text for mask, text in self.status.faults.items() if bits & mask]
        if bits & self.status.valid != self.status.valid:
            faults.append("the module calls its data invalid")
        stable: bool | None = None
        if self.status.stable or self.status.unstable:
            stable = bits & self.status.stable == self.status.stable and not bits & self.status.unstable
        return ", ".join(faults), stable


def pavone_dat_400(scale: float, device_id: int = 1) -> WeighingMap:
    """Gross weight of a Pavone / Precise DAT 400 (manual, page 44, tables of registers and of status bits)."""
    status = StatusRegister(
        address=0, stable=1 << 1, faults={1 << 4: "underload", 1 << 5: "overload", 1 << 6: "cell out of range"}
    )
    return WeighingMap(cells=(1,), scale=scale, device_id=device_id, status=status)


def pt113(scale: float, device_id: int = 1) -> WeighingMap:
    """Weight shown by a PT113 transmitter (manual, page 38)."""
    status = StatusRegister(address=2, unstable=1 << 2, valid=1 << 1, faults={1 << 0: "busy"})
    return WeighingMap(cells=(0,), scale=scale, device_id=device_id, status=status)


def laumas_tlu(scale: float, device_id: int = 1) -> WeighingMap:
    """Gross weight at 40008/40009: Laumas TLU (manual, page 34) and CAS CI-600D (manual, page 83)."""
    return WeighingMap(cells=(7,), scale=scale, device_id=device_id)
