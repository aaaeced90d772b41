"""``tms floor`` on a live laser, which is emulated, in a process of its own: Ctrl-C, full disks, what is left."""

from __future__ import annotations

import asyncio
import math
import os
import pty
import resource
import signal
import subprocess
import sys

import pytest
from floor_rig import OUTLINE, Room, config_toml, laser_toml

from tms_agents.devices.emulation import TcpLine
from tms_agents.devices.scip import ScipDevice
from tms_agents.floor.recordings.formats import read_scans

POSE = (2.5, 0.05, math.pi / 2)
CORNERS = " ".join(f"{x},{y}" for x, y in OUTLINE)


@pytest.fixture
def floor(tmp_path):
    """``tms floor COMMAND`` with a laser that delivers; a signal comes when so much was said."""

    def run(*arguments, signalled=None, after="", limit=None, terminal=False, silent=False):
        async def work():
            room = Room()
            device = ScipDevice(lambda: (room.ranges(device.sweep, POSE), None), "UST-20LX")
            device.silent = silent
            async with TcpLine(device, tick_s=0.005) as line:
                config, source = tmp_path / "floor.toml", f'{{ kind = "scip", host = "127.0.0.1", port = {line.port} }}'
                config.write_text(config_toml("lab", "http://127.0.0.1:1", laser_toml(source, POSE)))
                return await asyncio.to_thread(play, str(config))

        def play(config):
            command = [sys.executable, "-m", "tms_client", "floor", *arguments, "--config", config]
            small = None if limit is None else lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit))
            master, slave = pty.openpty()
            errors = slave if terminal else subprocess.PIPE
            pipe = subprocess.PIPE
            with subprocess.Popen(command, stdout=pipe, stderr=errors, text=True, preexec_fn=small) as process:
                if signalled is not None:
                    assert after in process.stdout.readline()
                    process.send_signal(signalled)
                out, err = process.communicate(timeout=60)
            if terminal:
                err = os.read(master, 100_000).decode()
            os.close(slave)
            os.close(master)
            return process.returncode, out, err

        return asyncio.run(work())

    return run


def test_a_disk_that_becomes_full_is_one_line(floor, tmp_path):
    scans = tmp_path / "room.scans"
    code, _, err = floor("record", "--out", str(scans), "--seconds", "30", limit=60_000)
    kept = sum(map(len, read_scans(scans)))
    assert (code, err) == (2, f"tms: {scans}: File too large; {kept} scans were kept\n") and kept > 10
    assert scans.stat().st_size <= 60_000


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_calibrate_is_quiet_when_it_is_broken_off(floor, tmp_path, number):
    arguments = ["calibrate", "--outline", CORNERS, "--seconds", "50"]
    assert floor(*arguments, signalled=number, after="Looking for 50 s") == (130, "", "")
    assert not list(tmp_path.glob("*.calibration.toml*"))


def test_a_laser_that_delivers_nothing_leaves_no_file(floor, tmp_path):
    scans = tmp_path / "room.scans"
    code, out, err = floor("record", "--out", str(scans), "--seconds", "1", silent=True)
    assert (code, err) == (1, "") and out.endswith(f"{scans}: 0 scans\n")
    assert not scans.exists()


def test_calibrate_shows_how_far_it_is(floor):
    code, _, err = floor("calibrate", "--outline", CORNERS, "--seconds", "1", terminal=True)
    assert code == 0
    assert err.startswith("\r0 of 1 s, 0 scans ") and "scans \r\n" in err
