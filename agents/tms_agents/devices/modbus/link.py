"""Weighing modules over Modbus RTU and TCP. pymodbus does the bytes; this asks, and says how the device is.

``ModbusLink`` listens like ``transport.Link``. pymodbus comes with the extra ``modbus``, imported where a device is
opened.
"""

from __future__ import annotations

import asyncio
from collections.abc import AsyncGenerator, Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from tms_agents.devices.beat import next_moment
from tms_agents.devices.loads import LoadSample
from tms_agents.devices.modbus.registers import WeighingMap
from tms_agents.devices.transport import DeviceFault, DeviceLink, DeviceState
from tms_client.cli import CommandError
from tms_client.flows import Retry

if TYPE_CHECKING:
    from pymodbus.client import AsyncModbusSerialClient, AsyncModbusTcpClient

    Client = AsyncModbusSerialClient | AsyncModbusTcpClient

#: Makes a client that is not connected yet, given the time to wait for an answer in seconds.
ClientOpener = Callable[[float], "Client"]

_BUSY = (5, 6)
_REFUSALS = {
    1: "illegal function",
    2: "illegal data address",
    3: "illegal data value",
    4: "device failure",
    10: "gateway path unavailable",
    11: "no answer behind the gateway",
}


def modbus_tcp(host: str, port: int = 502) -> ClientOpener:
    def open_(reply_s: float) -> Client:
        _need_pymodbus()
        from pymodbus.client import AsyncModbusTcpClient

        return AsyncModbusTcpClient(host, port=port, timeout=reply_s, retries=0, reconnect_delay=0)

    return open_


def modbus_rtu(device: str, baud: int = 9600, *, parity: str = "N", bits: int = 8, stop_bits: int = 1) -> ClientOpener:
    def open_(reply_s: float) -> Client:
        _need_pymodbus()
        from pymodbus.client import AsyncModbusSerialClient

        Path(device).stat()  # pymodbus does not say why it cannot open a port
        return AsyncModbusSerialClient(
            device,
            baudrate=baud,
            parity=parity,
            bytesize=bits,
            stopbits=stop_bits,
            timeout=reply_s,
            retries=0,
            reconnect_delay=0,
        )

    return open_


class ModbusLink(DeviceLink[LoadSample]):
    """Asks one module on every beat of ``period_s`` (``devices.beat``); a ``LoadSample`` for each complete answer.

    After an answer that did not come within ``reply_s`` it waits as long again before it asks anew: a late answer of
    RTU says not what it answers. A refusal by the module is a fault, with the reason; "busy" is not. ``listen`` raises
    ``CommandError`` where pymodbus is not installed.
    """

    def __init__(
        self,
        opener: ClientOpener,
        registers: WeighingMap,
        *,
        name: str,
        period_s: float = 0.1,
        reply_s: float = 0.5,
        silent_after_s: float = 10.0,
        retry: Retry | None = None,
    ) -> None:
        super().__init__(name=name, silent_after_s=silent_after_s, retry=retry)
        self._open, self._map, self._period_s, self._reply_s = opener, registers, period_s, reply_s

    async def _connection(self) -> AsyncGenerator[Sequence[LoadSample] | DeviceState, None]:
        client = self._open(self._reply_s)
        client.set_max_no_responses(1 << 30)  # silence is judged here
        clock = asyncio.get_running_loop().time
        alive = clock()
        try:
            connected = await client.connect()
            _stop_if_cancelled()
            if not connected:
                raise DeviceFault("cannot be reached")
            while True:
                registers = await self._ask(client)
                if registers is None and not client.connected:
                    return
                if registers is not None:
                    alive = clock()
                    states = self._alive()
                else:
                    states = self._silence(clock() - alive)
                for state in states:
                    yield state
                if registers:
                    yield [self._map.decode(registers)]
                now = clock()
                await asyncio.sleep(self._reply_s if registers is None else next_moment(now, self._period_s) - now)
        finally:
            client.close()

    async def _ask(self, client: Client) -> dict[int, int] | None:
        """Registers by address; empty where the module is busy, None where an answer is missing."""
        from pymodbus import ModbusException

        read = client.read_holding_registers if self._map.function == 3 else client.read_input_registers
        registers: dict[int, int] = {}
        for address, count in self._map.blocks():
            try:
                answer = await read(address, count=count, device_id=self._map.device_id)
            except ModbusException:
                return None
            finally:
                _stop_if_cancelled()
            if answer.isError():
                code = getattr(answer, "exception_code", 0)
                if code in _BUSY:
                    return {}
                why = _REFUSALS.get(code, f"exception {code}")
                raise DeviceFault(f"device {self._map.device_id} refuses register {address}: {why}")
            if len(answer.registers) != count:
                raise DeviceFault(f"{len(answer.registers)} registers at {address} instead of {count}")
            registers |= {address + i: value for i, value in enumerate(answer.registers)}
        return registers


def _stop_if_cancelled() -> None:
    """``asyncio.wait_for`` of Python 3.11, in pymodbus, forgets a cancellation in whose moment the answer comes."""
    task = asyncio.current_task()
    if task is not None and task.cancelling():
        raise asyncio.CancelledError


def _need_pymodbus() -> None:
    try:
        import pymodbus  # noqa: F401
    except ImportError as error:
        raise CommandError("Modbus devices need: pip install 'robot-town-tms[modbus]'") from error
