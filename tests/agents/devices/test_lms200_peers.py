"""Programs of other people measure with our emulated LMS2xx: the examples of sicktoolbox, where they are.

``TMS_SICKTOOLBOX`` is the folder of its built examples (github.com/ros-drivers/sicktoolbox).
"""

from __future__ import annotations

import asyncio
import os
import re
from pathlib import Path

import numpy as np
import pytest

from tms_agents.devices.emulation import PtyLine
from tms_agents.devices.lms200 import Lms200Device

PROGRAMS = Path(os.environ.get("TMS_SICKTOOLBOX", "/nonexistent"))
pytestmark = [
    pytest.mark.peer,
    pytest.mark.skipif(not (PROGRAMS / "lms2xx_simple_app").exists(), reason="TMS_SICKTOOLBOX has no examples"),
]


async def run(device: Lms200Device, program: str) -> str:
    """What a program prints that measures with the device over a terminal whose rate counts."""
    async with PtyLine(device, tick_s=0.005) as line:
        device.host_baud = lambda: line.baud
        process = await asyncio.create_subprocess_exec(
            PROGRAMS / program, line.path, "38400", stdout=asyncio.subprocess.PIPE, stderr=asyncio.subprocess.STDOUT
        )
        try:
            async with asyncio.timeout(60):
                said, _ = await process.communicate()
        except TimeoutError:
            process.kill()
            raise
    assert process.returncode == 0, said.decode()
    return said.decode()


def scanner(**options) -> Lms200Device:
    return Lms200Device(lambda: (1.5 + 0.01 * np.arange(361), np.arange(361) % 250.0), **options)


async def test_whole_scans_at_another_rate():
    device = scanner()
    said = await run(device, "lms2xx_simple_app")
    assert re.findall(r"Num\. Values: (\d+)", said) == ["181"] * 10 and device.baud == 9600  # it puts the rate back
    assert "LMS 200-30106" in said and "Millimeters" in said


async def test_partial_scans_with_indices():
    said = await run(scanner(indices=True), "lms2xx_partial_scan")  # sets 100 degrees in quarters
    counts = re.findall(r"Start angle: +([\d.]+), Num\. Values: (\d+)", said)
    assert set(counts) == {("0", "101"), ("0.25", "100"), ("0.5", "100"), ("0.75", "100")}


async def test_ranges_with_reflectivity():
    said = await run(scanner(fast=True), "lms2xx_stream_range_and_reflect")
    assert re.findall(r"Range Vals: (\d+) Num\. Reflect Vals: (\d+)", said) == [("181", "181")] * 10
