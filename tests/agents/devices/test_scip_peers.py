"""Clients of other people measure with our emulated sensor: hokuyolx, and Hokuyo's own C samples where they are.

The samples: ``make`` in ``current/src`` and ``current/samples/c`` of github.com/UrgNetwork/urg_library;
``TMS_URG_SAMPLES`` is the folder of the programs.
"""

from __future__ import annotations

import asyncio
import itertools
import os
from pathlib import Path

import numpy as np
import pytest
from scip_conversation import room

from tms_agents.devices.emulation import PtyLine, TcpLine
from tms_agents.devices.scip import MODELS, ScipDevice

SAMPLES = Path(os.environ.get("TMS_URG_SAMPLES", "/nonexistent"))
has_samples = pytest.mark.skipif(not (SAMPLES / "get_distance").exists(), reason="TMS_URG_SAMPLES has no get_distance")


def sensor(model: str = "UST-10LX") -> ScipDevice:
    seen = room(MODELS[model].parameters.steps)
    return ScipDevice(lambda: seen, model)


def millimetres(ranges: np.ndarray, far: int, error: int) -> list[int]:
    raw = np.where(np.isinf(ranges), far / 1000, np.where(np.isnan(ranges), error / 1000, ranges))
    return np.rint(raw * 1000).astype(int).tolist()


async def test_hokuyolx_measures_with_our_sensor():
    from hokuyolx import HokuyoLX

    device = sensor()
    device.motor_speed = 400  # it cannot cope with two scans in one piece
    ranges, light = room(1081)
    expected = millimetres(ranges, 65533, 0)

    def measure(port: int) -> None:
        laser = HokuyoLX(addr=("127.0.0.1", port), tsync=False, convert_time=False, timeout=20, buf=1 << 16)
        assert (laser.dmin, laser.dmax, laser.ares, laser.aforw, laser.scan_freq) == (20, 30000, 1440, 540, 40)
        assert laser.version()["PROD"] == "UST-10LX" and laser.model == "UST-10LX"
        assert laser.sensor_state()["STAT"] == "sensor is working normally"
        assert laser.laser_state()[0] == 3
        _, single = laser.get_dist()
        assert single.tolist() == expected
        _, both = laser.get_intens()
        assert both[:, 0].tolist() == expected and both[:, 1].tolist() == light.astype(int).tolist()
        _, part = laser.get_dist(start=100, end=199, grouping=5)
        assert len(part) == 20
        stamps = []
        for number, (scan, stamp, pending) in enumerate(laser.iter_dist(scans=5)):
            assert scan.tolist() == expected and pending == 4 - number
            stamps.append(stamp)
        assert len(stamps) == 5 and all(later - sooner >= 149 for sooner, later in itertools.pairwise(stamps))
        for scan, _, _ in laser.iter_intens(scans=3, skips=1):
            assert scan[:, 1].tolist() == light.astype(int).tolist()
        laser.reset()
        assert laser.laser_state()[0] == 0
        laser.close()

    async with TcpLine(device, tick_s=0.005) as line:
        await asyncio.to_thread(measure, line.port)
    assert {"GD0000108000", "GE0000108000", "MD0000108000005", "ME0000108000103"} <= set(device.heard)


async def test_hokuyolx_sets_its_clock_by_our_sensor():
    from hokuyolx import HokuyoLX

    device = sensor()

    def adjust(port: int) -> None:
        laser = HokuyoLX(addr=("127.0.0.1", port), activate=False, info=False, tsync=False, timeout=20)
        laser.time_sync(N=3, dt=0.01)
        assert laser.laser_state()[0] == 0
        laser.close()

    async with TcpLine(device, tick_s=0.005) as line:
        await asyncio.to_thread(adjust, line.port)
    assert [command for command in device.heard if command.startswith("TM")] == ["TM0", "TM1", "TM1", "TM1", "TM2"]


async def run(program: str, *arguments: str) -> str:
    process = await asyncio.create_subprocess_exec(
        str(SAMPLES / program),
        *arguments,
        stdout=asyncio.subprocess.PIPE,
        stderr=asyncio.subprocess.STDOUT,
    )
    try:
        said, _ = await asyncio.wait_for(process.communicate(), 20)
    finally:
        if process.returncode is None:
            process.kill()
    assert process.returncode == 0, said.decode()
    return said.decode()


@pytest.mark.peer
@has_samples
@pytest.mark.parametrize("model", ["URG-04LX", "URG-04LX-UG01", "UTM-30LX", "UST-20LX"])
async def test_the_makers_own_programs_on_a_serial_line(model):
    device = sensor(model)
    p = device.model.parameters
    front = room(p.steps)[0][p.afrt - p.amin]
    async with PtyLine(device, tick_s=0.005) as line:
        told = await run("sensor_parameter", "-s", line.path)
        measured = await run("get_distance", "-s", line.path)
    assert f"product type: {device.model.product}" in told and f"serial ID: {device.model.serial}" in told
    assert f"distance: [{p.dmin}, {p.dmax}" in told and "step: [-" in told
    assert "status: Sensor works well." in told or "status: sensor is working normally" in told
    assert measured.count(f"{front * 1000:.0f} [mm]") == 10


@pytest.mark.peer
@has_samples
async def test_the_makers_own_programs_over_tcp():
    device = sensor("UTM-30LX-EW")
    ranges, light = room(1081)
    front = f"{ranges[540] * 1000:.0f} [mm]"
    async with TcpLine(device, port=10940, tick_s=0.005):  # they know no other port
        assert (await run("get_distance", "-e", "127.0.0.1")).count(front) == 10
        assert (await run("get_distance_handshake", "-e", "127.0.0.1")).count(front) == 10
        assert (await run("get_distance_intensity", "-e", "127.0.0.1")).count(f"{front}, {light[540]:.0f} [1]") == 10
        assert "sensor" in await run("sync_time_stamp", "-e", "127.0.0.1")
    assert {"MD", "ME", "GD", "TM", "QT"} <= {command[:2] for command in device.heard}
