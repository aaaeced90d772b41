"""Modbus modules over real ports and terminals; a second library of other people reads the emulator too."""

from __future__ import annotations

import asyncio
import contextlib
import math
import sys

import minimalmodbus
import pytest
from link_listening import QUICK, samples, states, until
from pymodbus.constants import ExcCodes
from pymodbus.server import ModbusTcpServer
from pymodbus.simulator import DataType, SimData, SimDevice

from tms_agents.devices.loads import LoadSample
from tms_agents.devices.modbus import (
    ModbusLink,
    StatusRegister,
    WeighingMap,
    modbus_rtu,
    modbus_tcp,
    pavone_dat_400,
)
from tms_agents.devices.modbus.emulator import ModbusRtuLine, ModbusTcpPort, WeighingModule
from tms_agents.devices.transport import DeviceState
from tms_client.cli import CommandError

#: Four cells in two places, negative numbers, tenths of a gram.
CELLS = WeighingMap(
    cells=(100, 102, 200, 202),
    device_id=7,
    function=4,
    scale=0.1,
    status=StatusRegister(address=104, stable=1, faults={2: "cell 3 broken"}),
)
GRAMS = (10.5, -20.0, 3000.1, 0.0)


def module_link(opener, registers=CELLS, **options) -> ModbusLink:
    options = {"period_s": 0.02, "reply_s": 0.1, "silent_after_s": 0.3, "retry": QUICK, **options}
    return ModbusLink(opener, registers, name="module", **options)


@contextlib.asynccontextmanager
async def line(kind, module):
    if kind == "tcp":
        async with ModbusTcpPort(module) as port:
            yield port, modbus_tcp("127.0.0.1", port.port)
    else:
        async with ModbusRtuLine(module) as rtu:
            yield rtu, modbus_rtu(rtu.path, 9600)


@pytest.mark.parametrize("kind", ["tcp", "rtu"])
async def test_weights_and_status_come_over_a_line(kind):
    module = WeighingModule(CELLS, lambda t: GRAMS)
    module.status = 1
    async with line(kind, module) as (_, opener):

        async def break_a_cell(item):
            if isinstance(item, LoadSample):
                module.status = 2

        seen = await until(module_link(opener), lambda seen: len(samples(seen)) == 2, break_a_cell)
    assert states(seen) == ["connected"]
    good, bad = samples(seen)
    assert good.values == pytest.approx(GRAMS) and good.stable is True and good.fault == ""
    assert all(map(math.isnan, bad.values)) and bad.stable is False and bad.fault == "cell 3 broken"


async def test_a_server_that_knows_nothing_of_ours_is_read():
    """Registers written down by hand in pymodbus' own server, as a manual would give them."""
    data = [SimData(address=0, values=[0b10, 0, 1234], datatype=DataType.REGISTERS)]
    server = ModbusTcpServer(SimDevice(id=1, simdata=data), address=("127.0.0.1", 0))
    await server.serve_forever(background=True)
    try:
        port = server.transport.sockets[0].getsockname()[1]
        seen = await until(module_link(modbus_tcp("127.0.0.1", port), pavone_dat_400(0.1)), samples)
        assert samples(seen)[0] == LoadSample(values=(pytest.approx(123.4),), stable=True)
    finally:
        await server.shutdown()


async def test_another_library_reads_the_emulator():
    module = WeighingModule(CELLS, lambda t: GRAMS)
    async with ModbusRtuLine(module) as rtu:

        def read():
            instrument = minimalmodbus.Instrument(rtu.path, 7)
            instrument.serial.baudrate = 9600
            instrument.serial.timeout = 1.0
            try:
                long = [instrument.read_long(address, functioncode=4, signed=True) for address in CELLS.cells]
                with pytest.raises(minimalmodbus.IllegalRequestError):
                    instrument.read_register(100, functioncode=3)
            finally:
                instrument.serial.close()
            return long

        assert await asyncio.to_thread(read) == [105, -200, 30_001, 0]


@pytest.mark.parametrize("kind", ["tcp", "rtu"])
async def test_a_refusal_says_why_and_busy_is_none(kind):
    module = WeighingModule(CELLS, lambda t: GRAMS)
    async with line(kind, module) as (_, opener):

        async def refuse(item):
            module.refuse = ExcCodes.DEVICE_BUSY if isinstance(item, LoadSample) else None
            if module.refuse:
                asyncio.get_running_loop().call_later(0.1, setattr, module, "refuse", ExcCodes.ILLEGAL_ADDRESS)

        seen = await until(module_link(opener), lambda seen: "faulty" in states(seen), refuse)
    assert states(seen) == ["connected", "faulty"]
    assert seen[-1].why == "module: device 7 refuses register 100: illegal data address"


@pytest.mark.parametrize("kind", ["tcp", "rtu"])
async def test_silence_a_pulled_cable_and_back_without_restart(kind):
    module = WeighingModule(CELLS, lambda t: GRAMS)
    async with line(kind, module) as (cable, opener):
        phase = "weighing"

        async def disturb(item):
            nonlocal phase
            weight = isinstance(item, LoadSample)
            if phase == "weighing" and weight:
                phase, module.silent = "silence", True
            elif phase == "silence" and not weight:
                phase, module.silent = "again", False
            elif phase == "again" and weight:
                phase = "pulled"
                await cable.hang_up()
            elif phase == "pulled" and not weight:
                phase = "plugged in"
                await cable.plug_in()

        seen = await until(
            module_link(opener), lambda seen: phase == "plugged in" and isinstance(seen[-1], LoadSample), disturb
        )
        assert states(seen)[:4] == ["connected", "silent", "connected", "faulty"]
        assert states(seen)[-1] == "connected"
        assert all(sample.values == pytest.approx(GRAMS) for sample in samples(seen))


async def test_it_ends_at_whatever_moment_it_is_stopped():
    """Stopped in the very step of the event loop in which an answer arrives, too."""
    async with line("tcp", WeighingModule(CELLS, lambda t: GRAMS)) as (_, opener):
        for steps in range(60):
            heard = asyncio.Event()

            async def listen(heard=heard):
                async with contextlib.aclosing(module_link(opener, period_s=1e-4).listen()) as items:
                    async for item in items:
                        if not isinstance(item, DeviceState):
                            heard.set()

            task = asyncio.create_task(listen())
            await heard.wait()
            for _ in range(steps):
                await asyncio.sleep(0)
            task.cancel()
            ended, _ = await asyncio.wait([task], timeout=2.0)
            assert ended, f"it goes on, stopped {steps} steps after an answer"


async def test_nobody_there(tmp_path):
    (state,) = await until(module_link(modbus_tcp("127.0.0.1", 9)), lambda seen: True)
    assert state == DeviceState("faulty", "module: cannot be reached")
    (state,) = await until(module_link(modbus_rtu(str(tmp_path / "tty"))), lambda seen: True)
    assert state.state == "faulty" and "No such file" in state.why


async def test_without_the_extra_one_line_names_it(monkeypatch):
    monkeypatch.setitem(sys.modules, "pymodbus", None)
    with pytest.raises(CommandError, match=r"robot-town-tms\[modbus\]"):
        await until(module_link(modbus_tcp("127.0.0.1", 9)), lambda seen: True)


async def test_a_late_answer_of_rtu_is_not_taken_for_the_next_question():
    """Two questions of the same length: what comes too late for the first must not answer the second."""
    two = WeighingMap(cells=(10, 20), function=3)
    module = WeighingModule(two, lambda t: (111, 222))
    held: list[tuple[float, bytes]] = []

    async with ModbusRtuLine(module) as rtu:
        loop = asyncio.get_running_loop()
        deliver = rtu._to_host
        count = 0

        def late(data):
            nonlocal count
            count += 1
            delay = 0.15 if count % 5 == 0 else 0.0
            held.append((delay, data))
            loop.call_later(delay, deliver, data)

        rtu._server_end.device._to = late
        link = module_link(modbus_rtu(rtu.path), two, reply_s=0.1, silent_after_s=5.0)
        seen = await until(link, lambda seen: len(samples(seen)) == 12)
        assert {sample.values for sample in samples(seen)} == {(111.0, 222.0)} and any(delay for delay, _ in held)
