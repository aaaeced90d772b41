"""What a configuration says of a laser reaches it: the link that a section opens, against emulated lasers."""

from __future__ import annotations

import inspect
from dataclasses import fields, replace

import numpy as np
import pytest
from floor_rig import config_toml, laser_toml
from link_listening import on_a_line, until

from tms_agents.config import read_config
from tms_agents.devices.cola import MODELS, ColaDevice, ColaSession
from tms_agents.devices.emulation import PtyLine, TcpLine
from tms_agents.devices.lms200 import Lms200Device, Lms200Session
from tms_agents.devices.scans import Scan
from tms_agents.devices.scip import ScipDevice, ScipSettings
from tms_agents.floor.config import FloorConfig
from tms_agents.floor.sources import ColaLaser, LaserSource, LmsLaser, ScipLaser

RANGES, LIGHT = 1.5 + 0.01 * np.arange(181), np.arange(181) % 250.0


def section(folder, source: str) -> LaserSource:
    path = folder / "floor.toml"
    path.write_text(config_toml("lab", "http://127.0.0.1:1", laser_toml(source)))
    return read_config(path, FloorConfig).lasers[0].source


async def first_scan(folder, line: TcpLine | PtyLine, options: str) -> Scan:
    where = f'device = "{line.path}"' if isinstance(line, PtyLine) else f'host = "127.0.0.1", port = {line.port}'
    link = section(folder, f"{{ {where}, {options} }}").link(5.0)
    return (await until(link, lambda seen: isinstance(seen[-1], Scan), timeout_s=20.0))[-1]


async def test_a_hokuyo_that_is_asked_for_every_scan(tmp_path):
    device = ScipDevice(lambda: (np.full(682, 2.0), None), "URG-04LX", boot_s=0.05)
    async with on_a_line("tcp", device, tick_s=0.005) as (line, _):
        await first_scan(tmp_path, line, 'kind = "scip", polled = true, short = true')
    assert "GS0044072501" in device.heard and "BM" in device.heard


@pytest.mark.parametrize("output", ["reflectivity", "request"])
async def test_a_fast_lms_with_fixed_field_of_view(tmp_path, output):
    device = Lms200Device(lambda: (RANGES, LIGHT), fast=True)
    device.baud = 38400
    async with on_a_line("pty", device, tick_s=0.01) as (line, _):
        scan = await first_scan(tmp_path, line, f'kind = "lms200", fixed = true, output = "{output}"')
    np.testing.assert_allclose(scan.ranges, RANGES, atol=0.0006)
    assert (scan.intensities is not None) == (output == "reflectivity")
    if scan.intensities is not None:
        np.testing.assert_array_equal(scan.intensities, LIGHT)


async def test_unit_and_measuring_mode_of_an_lms(tmp_path):
    device = Lms200Device(lambda: (RANGES, None))
    device.baud = 38400
    async with on_a_line("pty", device, tick_s=0.01) as (line, _):
        scan = await first_scan(tmp_path, line, 'kind = "lms200", unit = "cm", measuring_mode = 0x06')
    assert (device.config.unit, device.config.measuring_mode, device.writes) == ("cm", 6, 1)
    assert scan.sweep.range_max_m == 80.0


async def test_password_and_field_of_view_of_a_cola_laser(tmp_path):
    device = ColaDevice(lambda: (RANGES, LIGHT), model=replace(MODELS["TiM571"], password=0x1234ABCD))
    options = 'kind = "cola", passwords = [0xF4724744, 0x1234ABCD], field_deg = [0, 180], resolution_deg = 0.3333'
    async with on_a_line("tcp", device, tick_s=0.01) as (line, _):
        scan = await first_scan(tmp_path, line, options)
    assert np.rad2deg(scan.sweep.angles[[0, -1]]) == pytest.approx([-90, 90], abs=0.01)
    assert device.heard.count("sMN SetAccessMode") == 2 and scan.intensities is not None


def test_what_is_not_said_is_as_the_driver_has_it():
    drivers = {
        ScipLaser: {one.name: one.default for one in fields(ScipSettings)},
        LmsLaser: {name: one.default for name, one in inspect.signature(Lms200Session).parameters.items()},
        ColaLaser: {name: one.default for name, one in inspect.signature(ColaSession).parameters.items()},
    }
    for kind, driver in drivers.items():
        for name in kind.model_fields.keys() & driver.keys() - {"intensity"}:
            assert kind.model_fields[name].default == driver[name], f"{kind.__name__}.{name}"
