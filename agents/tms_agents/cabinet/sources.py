"""Sections that say what weighs a board, and how each kind is opened: a load source delivers samples for ever."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Annotated, ClassVar, Literal

from pydantic import Field

from tms_agents.config import Section
from tms_agents.devices.loadboard import RosTmsBoardBurst, RosTmsBoardSession
from tms_agents.devices.loads import LoadSample, LoadSource
from tms_agents.devices.modbus import (
    Kind as RegisterKind,
)
from tms_agents.devices.modbus import (
    ModbusLink,
    StatusRegister,
    WeighingMap,
    modbus_rtu,
    modbus_tcp,
)
from tms_agents.devices.scales import DIALECTS, DialectName, LoadGroup, Mode, ScaleLineSession
from tms_agents.devices.transport import Link, Opener, Session
from tms_agents.line_config import Line


class RosTmsBoard(Line):
    """The board of the ROS-TMS laboratory: a character per cell asks, a line with the counts answers."""

    kind: Literal["ros-tms"]
    cells: Annotated[int, Field(ge=1, le=36)] = 4
    period_s: Annotated[float, Field(ge=0.005, le=10)] = 0.02
    #: ``one`` cell after the other, safe with any firmware; or ``all`` at once, which costs less processor time.
    ask: Literal["one", "all"] = "one"

    @property
    def cell_count(self) -> int:
        return self.cells

    #: Raw values of the converter: calibrated here, zero and noise as they are.
    filtered: ClassVar[bool] = False
    zeroes_itself: ClassVar[bool] = False

    def link(self, silent_after_s: float) -> Link[LoadSample]:
        return _link(
            f"board {self.place}",
            self.opener(115200),
            lambda: self._session()(cells=self.cells, period_s=self.period_s),
            silent_after_s,
        )

    def _session(self) -> type[RosTmsBoardSession] | type[RosTmsBoardBurst]:
        return RosTmsBoardSession if self.ask == "one" else RosTmsBoardBurst


class Scale(Line):
    """A scale that prints lines: one cell, in grams."""

    kind: Literal["openscale", "and", "mt-sics"]
    #: ``poll`` asks every ``poll_s``, ``stream`` has the scale send by itself.
    mode: Mode | None = None
    poll_s: Annotated[float, Field(ge=0.01, le=10)] = 0.1
    #: 7E1 on a converter that only does 8N1.
    software_parity: bool = False

    cell_count: ClassVar[int] = 1
    filtered: ClassVar[bool] = True

    @property
    def zeroes_itself(self) -> bool:
        """OpenScale keeps its tare; the others begin at zero with whatever stands on them."""
        return self.kind != "openscale"

    def link(self, silent_after_s: float) -> Link[LoadSample]:
        name: DialectName = self.kind
        dialect = DIALECTS[name]
        mode = self.mode or ("stream" if name == "openscale" else "poll")
        bits, parity = (8, "N") if self.software_parity else (dialect.bits, dialect.parity)
        return _link(
            f"scale {self.place}",
            self.opener(dialect.baud, bits=bits, parity=parity),
            lambda: ScaleLineSession(name, mode=mode, poll_s=self.poll_s, software_parity=self.software_parity),
            silent_after_s,
        )


class StatusSection(Section):
    """A module's status register; masks of bits, ``faults`` by mask (as "0x20")."""

    address: Annotated[int, Field(ge=0, le=65_534)]
    stable: Annotated[int, Field(ge=0, le=0xFFFF)] = 0
    unstable: Annotated[int, Field(ge=0, le=0xFFFF)] = 0
    valid: Annotated[int, Field(ge=0, le=0xFFFF)] = 0
    faults: dict[Annotated[str, Field(pattern=r"^(0x[0-9a-fA-F]{1,4}|\d{1,5})$")], str] = {}

    def register(self) -> StatusRegister:
        values = self.model_dump(exclude={"faults"})
        return StatusRegister(**values, faults={int(mask, 0): text for mask, text in self.faults.items()})


class ModbusModule(Line):
    """A weighing module, RTU (``device``) or TCP (``host``, ``port`` 502); ``registers``: the first of each cell."""

    kind: Literal["modbus"]
    registers: Annotated[list[Annotated[int, Field(ge=0, le=65_534)]], Field(min_length=1, max_length=36)]
    #: Grams per unit; 1 with ``raw`` values, which are calibrated here.
    scale: Annotated[float, Field(gt=0, le=1e6)] = 1.0
    raw: bool = False
    device_id: Annotated[int, Field(ge=0, le=247)] = 1
    function: Literal[3, 4] = 3
    number: RegisterKind = "int32"
    low_word_first: bool = False
    parity: Literal["N", "E", "O"] = "N"
    period_s: Annotated[float, Field(ge=0.01, le=10)] = 0.05
    status: StatusSection | None = None

    default_port: ClassVar[int | None] = 502
    zeroes_itself: ClassVar[bool] = False

    @property
    def cell_count(self) -> int:
        return len(self.registers)

    @property
    def filtered(self) -> bool:
        return not self.raw

    def link(self, silent_after_s: float) -> LoadSource:
        where = (
            modbus_rtu(self.device, self.baud or 9600, parity=self.parity)
            if self.device is not None
            else modbus_tcp(self.host or "", self.port or 502)
        )
        registers = WeighingMap(
            cells=self.registers,
            device_id=self.device_id,
            function=self.function,
            kind=self.number,
            low_word_first=self.low_word_first,
            scale=self.scale,
            status=None if self.status is None else self.status.register(),
        )
        return ModbusLink(
            where, registers, name=f"module {self.place}", period_s=self.period_s, silent_after_s=silent_after_s
        )


LoadSection = Annotated[RosTmsBoard | Scale | ModbusModule, Field(discriminator="kind")]


def open_loads(sections: Sequence[RosTmsBoard | Scale | ModbusModule], silent_after_s: float) -> LoadSource:
    """One source for all cells of a board."""
    links = [one.link(silent_after_s) for one in sections]
    if len(links) == 1:
        return links[0]
    return LoadGroup(links, cells=[one.cell_count for one in sections], stale_s=silent_after_s)


def _link(
    name: str, opener: Opener, session: Callable[[], Session[LoadSample]], silent_after_s: float
) -> Link[LoadSample]:
    return Link(opener, session, name=name, silent_after_s=silent_after_s)
