"""A weighing module for tests and demos: pymodbus' server behind a TCP port or a pseudo terminal."""

from __future__ import annotations

import asyncio
import time
from collections.abc import Callable, Sequence

from pymodbus.constants import ExcCodes
from pymodbus.server import ModbusSerialServer, ModbusTcpServer
from pymodbus.simulator import DataType, SimData, SimDevice

from tms_agents.devices.emulation import PtyLine
from tms_agents.devices.modbus.registers import WeighingMap


class WeighingModule:
    """Answers questions about the registers of a map; ``grams(t)`` gives the value of each cell.

    ``status`` is what the status register holds. ``refuse`` is the exception it answers with, ``silent`` none at all.
    """

    def __init__(
        self,
        registers: WeighingMap,
        grams: Callable[[float], Sequence[float]],
        *,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self.map = registers
        self.status = 0
        self.refuse: ExcCodes | None = None
        self.silent = False
        self._grams, self._clock = grams, clock

    def device(self) -> SimDevice:
        data = [
            SimData(address=address, values=[0] * count, datatype=DataType.REGISTERS)
            for address, count in self.map.blocks()
        ]
        return SimDevice(id=self.map.device_id, simdata=data, action=self._answer)

    def on_wire(self, sending: bool, data: bytes) -> bytes:
        return b"" if sending and self.silent else data

    async def _answer(
        self,
        function: int,
        start: int,
        address: int,
        count: int,
        registers: list[int],
        written: list[int] | list[bool] | None,
    ) -> ExcCodes | None:
        if self.refuse is not None:
            return self.refuse
        if function != self.map.function:
            return ExcCodes.ILLEGAL_FUNCTION
        now = self.map.encode(self._grams(self._clock()))
        if self.map.status:
            now[self.map.status.address] = self.status
        for at, value in now.items():
            registers[at - start] = value
        return None


class ModbusTcpPort:
    """Puts a module behind a TCP port."""

    def __init__(self, module: WeighingModule, host: str = "127.0.0.1", port: int = 0) -> None:
        self._module, self.host, self.port = module, host, port

    async def hang_up(self) -> None:
        """Close the port and all connections, as a pulled cable does; ``plug_in`` opens the same port again."""
        await self._server.shutdown()  # type: ignore[no-untyped-call]

    async def plug_in(self) -> None:
        self._server = ModbusTcpServer(
            self._module.device(), address=(self.host, self.port), trace_packet=self._module.on_wire
        )
        await self._server.serve_forever(background=True)
        assert isinstance(self._server.transport, asyncio.Server)
        self.port = self._server.transport.sockets[0].getsockname()[1]

    async def __aenter__(self) -> ModbusTcpPort:
        await self.plug_in()
        return self

    async def __aexit__(self, *_: object) -> None:
        await self.hang_up()


class ModbusRtuLine:
    """Puts a module behind a pseudo terminal; ``path`` is what the driver opens.

    The server wants a terminal of its own: two of them, each passing on to the other what it hears, are the cable.
    """

    def __init__(self, module: WeighingModule, baud: int = 9600) -> None:
        self._module, self._baud = module, baud
        self._server_end, self._host_end = PtyLine(_PassOn(self._to_host)), PtyLine(_PassOn(self._to_server))
        self.path = ""

    async def hang_up(self) -> None:
        """Pull the host's end out: the terminal and its name go away until ``plug_in``."""
        self._host_end.hang_up()

    async def plug_in(self) -> None:
        self._host_end.plug_in()

    async def __aenter__(self) -> ModbusRtuLine:
        await self._server_end.__aenter__()
        await self._host_end.__aenter__()
        self.path = self._host_end.path
        self._server = ModbusSerialServer(
            self._module.device(),
            port=self._server_end.path,
            baudrate=self._baud,
            trace_packet=self._module.on_wire,
        )
        await self._server.serve_forever(background=True)
        return self

    async def __aexit__(self, *_: object) -> None:
        await self._server.shutdown()  # type: ignore[no-untyped-call]
        await self._host_end.__aexit__()
        await self._server_end.__aexit__()

    def _to_host(self, data: bytes) -> None:
        self._host_end.inject(data)

    def _to_server(self, data: bytes) -> None:
        self._server_end.inject(data)


class _PassOn:
    def __init__(self, to: Callable[[bytes], None]) -> None:
        self._to = to

    def receive(self, data: bytes) -> bytes:
        self._to(data)
        return b""
