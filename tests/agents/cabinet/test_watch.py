"""``tms cabinet watch`` and ``tms cabinet calibrate`` at a terminal: what a person sees."""

from __future__ import annotations

import asyncio
import os
import re
import sys

import pytest
from cabinet_rig import GAIN, MILK, OFFSET, Shelf, config_toml

from tms_agents.cabinet.calibration_file import read_calibration
from tms_agents.cabinet.screen import screen
from tms_agents.devices.emulation import PtyLine
from tms_agents.devices.loadboard.emulator import RosTmsBoardDevice
from tms_agents.devices.tr3.emulator import Tr3Device
from tms_client import cli

SPOT = re.compile(r"put (\d+) g .* x ([\d.]+), y ([\d.]+) m")


async def tms(*arguments: str, stdin: bytes | None = None, **env: str) -> tuple[int, str]:
    process = await asyncio.create_subprocess_exec(
        *(sys.executable, "-m", "tms_client", *arguments),
        stdin=asyncio.subprocess.PIPE,
        stdout=asyncio.subprocess.PIPE,
        stderr=asyncio.subprocess.STDOUT,
        env=os.environ | {"COLUMNS": "80", "LINES": "24"} | env,
    )
    out, _ = await asyncio.wait_for(process.communicate(stdin), 60)
    return process.returncode or 0, out.decode()


async def calibrate(shelf: Shelf, *arguments: str, keys: bool) -> tuple[int, str]:
    """Do what the command asks for, as a person would: put the weight there, press Enter."""
    process = await asyncio.create_subprocess_exec(
        *(sys.executable, "-m", "tms_client", "cabinet", "calibrate", "--seconds", "0.4", *arguments),
        stdin=asyncio.subprocess.PIPE,
        stdout=asyncio.subprocess.PIPE,
        stderr=asyncio.subprocess.STDOUT,
    )
    assert process.stdin is not None and process.stdout is not None
    said = ""
    while line := (await asyncio.wait_for(process.stdout.readline(), 60)).decode():
        said += line
        if "everything off" in line:
            shelf.things.clear()
        elif spot := SPOT.search(line):
            shelf.things.clear()
            shelf.put("weight", *map(float, spot.groups()))
        if keys and "Enter" in line:
            process.stdin.write(b"\n")
    return await process.wait(), said


@pytest.mark.parametrize("keys", [True, False])
async def test_calibrate_a_board(tmp_path, keys):
    shelf = Shelf(noise_g=1.0)
    async with PtyLine(RosTmsBoardDevice(shelf.counts)) as line:
        config = tmp_path / "cabinet.toml"
        config.write_text(config_toml("lab", "http://127.0.0.1:9", f'{{kind = "ros-tms", device = "{line.path}"}}'))
        arguments = ["--config", str(config), *(["--weight", "500"] if keys else ["--auto"])]
        if not keys:
            arguments += ["--weights", "800@0.1,0.06; 800@0.36,0.06; 800@0.1,0.25; 800@0.36,0.25"]
        status, said = await calibrate(shelf, *arguments, keys=keys)
    assert status == 0, said
    found = read_calibration(tmp_path / "cabinet.calibration.toml")["shelf"]
    assert found.gain == pytest.approx([GAIN] * 4, rel=0.02)
    assert found.offset == pytest.approx(OFFSET, abs=4)
    assert "RMSE: weight" in said and said.count("\n    ") >= 4


async def test_a_cell_that_does_not_respond_is_named(tmp_path):
    shelf = Shelf(noise_g=1.0)
    device = RosTmsBoardDevice(shelf.counts)
    async with PtyLine(device) as line:
        config = tmp_path / "cabinet.toml"
        config.write_text(config_toml("lab", "http://127.0.0.1:9", f'{{kind = "ros-tms", device = "{line.path}"}}'))
        device.stuck[2] = 40
        status, said = await calibrate(shelf, "--config", str(config), "--weight", "500", keys=True)
        assert (status, "cell 2 does not respond to the weight" in said) == (2, True)
        line.hang_up()
        status, said = await tms(
            *("cabinet", "calibrate", "--config", str(config), "--weight", "500", "--timeout", "1.5"), stdin=b"\n"
        )
        assert status == 2 and "tms: no load at rest within 1.5 s: board" in said
    assert list(tmp_path.glob("*.calibration.toml")) == []


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        ([], "which weight?"),
        (["--weights", "500@0.1"], "'500@0.1' is no weight at a place"),
        (["--weights", "500@0.1,0.9"], "beside the board"),
        (["--weights", "heavy@0.1,0.1"], "is no weight at a place"),
        (["--weight", "500", "--board", "shelve"], "--board must be one of: shelf"),
        (["--weight", "500", "--seconds", "0"], "--seconds is"),
    ],
)
def test_what_calibrate_refuses(tmp_path, capsys, arguments, says):
    config = tmp_path / "cabinet.toml"
    config.write_text(config_toml("lab", "http://127.0.0.1:9", '{kind = "ros-tms", device = "/dev/null"}'))
    assert cli.main(["cabinet", "calibrate", "--config", str(config), *arguments]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert says in line


async def test_watch_the_agent_and_the_devices(rig):
    """The same picture from a running agent, which goes on undisturbed, and from the devices after it ended."""
    shelf, reader = Shelf(), Tr3Device()
    async with PtyLine(RosTmsBoardDevice(shelf.counts)) as board, PtyLine(reader) as line:
        source = f'{{kind = "tr3-serial", device = "{line.path}", poll_s = 0.1}}'
        cabinet = rig(f'{{kind = "ros-tms", device = "{board.path}"}}', reader=source)
        once = ("cabinet", "watch", "--once", "--config", str(cabinet.config))
        async with cabinet.agent():
            await cabinet.ready("shelf", "reader")
            reader.see(MILK)
            shelf.put("milk", 500, 0.1, 0.2)
            await cabinet.count(1)
            await asyncio.sleep(0.5)
            status, picture = await tms(*once)
            assert status == 0 and "from the running agent" in picture
            assert re.search(r"1 +\d+ g +0\.1\d +0\.2\d +\S*97A", picture) and "put    #1" in picture
            status, said = await tms("cabinet", "calibrate", "--weight", "500", "--config", str(cabinet.config))
            assert status == 2 and "is running and has the devices" in said
            assert (await cabinet.view()).state == "connected"
        status, picture = await tms(*once)
    assert status == 0 and "from the devices" in picture
    assert re.search(r"1 +\d+ g +0\.1\d +0\.2\d +\S*97A", picture)
    lines = picture.splitlines()
    assert len(lines) <= 24 and max(map(len, lines)) <= 80


def view(boards: int = 1, stays: int = 2, events: int = 40) -> dict[str, object]:
    on_board = [
        {"id": n, "label": f"a/{n}", "xy": (0.1 * (n % 4), 0.2), "sd": 0.01, "weight_g": 100.0 * n}
        | {"weight_sd_g": 1.0, "tag": "E00401004E17F97A" if n % 2 else None, "age_s": 3.0}
        for n in range(1, stays + 1)
    ]
    cells = [
        {"xy": xy, "grams": grams} for xy, grams in zip([(0, 0), (0.4, 0), (0, 0.3)], [10.0, -5.0, None], strict=True)
    ]
    state = {"state": "faulty", "why": "shelf: board /dev/serial/by-id/usb-with-a-very-long-name-that-goes-on-and-on"}
    board = {"name": "shelf", "width": 0.4, "depth": 0.3, "state": state, "cells": cells, "stays": on_board}
    board["knows_load"] = True
    reader = {"name": "r", "state": {"state": "connected", "why": ""}, "zones": {"shelf": ["E00401004E17F97A"] * 9}}
    at = "2026-11-21T10:00:00.000+00:00"
    return {"agent": "a", "room": "居間", "source": "agent", "at": at} | {
        "boards": [board | {"name": f"shelf{n}"} for n in range(boards)],
        "readers": [reader],
        "story": [(at, f"event {n}") for n in range(events)],
    }


@pytest.mark.parametrize("boards", [1, 2, 3, 9])
@pytest.mark.parametrize("stays", [0, 2, 30])
@pytest.mark.parametrize(("columns", "rows"), [(80, 24), (40, 10), (200, 60), (20, 3)])
def test_a_screen_fits(boards, stays, columns, rows):
    lines = screen(view(boards, stays), columns=columns, rows=rows)
    assert len(lines) <= rows and max(map(len, lines)) <= columns


def test_a_screen_shows_what_matters():
    picture = "\n".join(screen(view()))
    for wanted in ("faulty", "#1", "#2", "100 g", "97A", "event 39", "居間", "?"):
        assert wanted in picture
    assert "\x1b[31mfaulty" in "\n".join(screen(view(), colour=True))


def test_a_screen_says_that_a_board_is_learning():
    learning = view()
    board = learning["boards"][0]
    board |= {"knows_load": False, "state": {"state": "connected", "why": ""}}
    board["cells"] = [{"xy": (0, 0), "grams": 10.0}]
    assert "connected  10 g, learning what rests on it" in "\n".join(screen(learning))
