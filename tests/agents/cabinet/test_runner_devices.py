"""The same thing on the same board, weighed by every kind of device: position and weight come out alike."""

from __future__ import annotations

import asyncio
import contextlib

import pytest
from cabinet_rig import Shelf, config_toml

from tms_agents.cabinet.config import CabinetConfig
from tms_agents.cabinet.watching import watch_devices
from tms_agents.config import read_config
from tms_agents.devices.emulation import PtyLine, TcpLine
from tms_agents.devices.modbus import WeighingMap
from tms_agents.devices.modbus.emulator import ModbusTcpPort, WeighingModule
from tms_agents.devices.scales.emulator import AndScale, OpenScale, SicsScale


def cell(shelf: Shelf, number: int):
    """What the scale under one corner carries, with a noise that no scale is without."""
    return lambda t: float(shelf.grams()[number] + shelf.noise(0.3))


async def four_and(stack, shelf):
    lines = [await stack.enter_async_context(TcpLine(AndScale(cell(shelf, n), decimals=1))) for n in range(4)]
    scales = (f'{{kind = "and", host = "127.0.0.1", port = {line.port}, poll_s = 0.05}}' for line in lines)
    return f"[{', '.join(scales)}]"


async def four_sics(stack, shelf):
    lines = [await stack.enter_async_context(PtyLine(SicsScale(cell(shelf, n), decimals=1))) for n in range(4)]
    scales = (f'{{kind = "mt-sics", device = "{line.path}", poll_s = 0.05}}' for line in lines)
    return f"[{', '.join(scales)}]"


async def four_openscales(stack, shelf):
    devices = [OpenScale(cell(shelf, n), unit="kg", decimals=4, period_s=0.05) for n in range(4)]
    lines = [await stack.enter_async_context(PtyLine(device, tick_s=0.02)) for device in devices]
    scales = (f'{{kind = "openscale", device = "{line.path}"}}' for line in lines)
    return f"[{', '.join(scales)}]"


async def modbus(stack, shelf):
    registers = WeighingMap(cells=(0, 2, 4, 6), scale=0.1)
    module = WeighingModule(registers, lambda t: [cell(shelf, n)(t) for n in range(4)])
    port = await stack.enter_async_context(ModbusTcpPort(module))
    return f'{{kind = "modbus", host = "127.0.0.1", port = {port.port}, registers = [0, 2, 4, 6], scale = 0.1}}'


@pytest.mark.parametrize("devices", [four_and, four_sics, four_openscales, modbus])
async def test_a_thing_is_where_it_was_put(tmp_path, devices):
    shelf = Shelf()
    async with contextlib.AsyncExitStack() as stack:
        load = await devices(stack, shelf)
        path = tmp_path / "cabinet.toml"
        path.write_text(config_toml("lab", "http://127.0.0.1:9", load))
        config = read_config(path, CabinetConfig)
        async with asyncio.timeout(60), contextlib.aclosing(watch_devices(config, {})) as views:
            quiet = 0
            async for view in views:
                (board,) = view["boards"]
                quiet += board["knows_load"]
                if quiet == 4:
                    shelf.put("milk", 500, 0.1, 0.2)
                if board["stays"]:
                    break
    (stay,) = board["stays"]
    assert quiet > 4
    assert stay["weight_g"] == pytest.approx(500, abs=5)
    assert stay["xy"] == pytest.approx((0.1, 0.2), abs=0.01)
