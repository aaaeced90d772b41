"""``tms intake`` against a real server: a person at a terminal, scanners and readers on real lines."""

from __future__ import annotations

import asyncio
import os
import socket
import subprocess
import sys

import pytest
from server_process import ServerProcess

from tms_agents.devices.emulation import PtyLine, TcpLine
from tms_agents.devices.llrp.emulator import LlrpEmulator
from tms_agents.devices.text_reader_emulator import TextReaderDevice
from tms_agents.devices.thingmagic.emulator import ThingMagicDevice
from tms_agents.devices.tr3.emulator import Tr3Device
from tms_client import cli

TEA, CUP = "4901777018686", "4569951116117"
SGTIN = "30352B2E4401D3000000007B"  # carries TEA
TAG = "E00401004E17F9{:02X}"


class Scanner:
    """A barcode scanner: it hears nothing, and sends when its line is told to ``inject``."""

    def receive(self, data: bytes) -> bytes:
        return b""


# one call


def test_one_call(intake, town):
    done = intake("--jan", TEA, "--tag", TAG.format(1).lower(), "--room", "lab")
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout == f"Registered: お茶 500ml, 525 g, tag {TAG.format(1)}, room lab.\n"
    assert town.objects.get(TAG.format(1)).jan == TEA
    again = intake("--jan", TEA, "--tag", TAG.format(1), "--room", "lab")
    assert again.returncode == 0 and again.stdout.startswith("Registered already, nothing to do: お茶")
    alone = intake("--tag", SGTIN[:-1] + "1")
    assert alone.returncode == 0 and "お茶 500ml, 525 g" in alone.stdout and "no room yet" in alone.stdout
    named = intake("--tag", TAG.format(2), "--name", "remote control", "--room", "lab")
    assert named.stdout == f"Registered: remote control, tag {TAG.format(2)}, room lab.\n"


@pytest.mark.parametrize(
    ("arguments", "status", "line"),
    [
        (
            ["--tag", "E004000000000001", "--jan", TEA, "--name", "お茶"],
            1,
            "belongs to something else already: scissors",
        ),
        (["--tag", "A1", "--jan", "4902102072618"], 1, "4902102072618 is not in the catalogue: give its name"),
        (["--tag", "A1"], 1, "names no product by itself"),
        (["--tag", SGTIN, "--jan", CUP], 1, f"the tag itself names product {TEA}, not {CUP}"),
        (["--tag", "A1", "--jan", TEA, "--room", "nowhere"], 1, "nowhere"),
        (["--tag", "A1", "--name", "x" * 201], 1, "at most 200 characters"),
        (["--tag", "A1", "--jan", "4901777018687"], 2, "tms: 4901777018687 was read wrongly"),
        (["--tag", "no tag", "--jan", TEA], 2, "is no tag"),
        (["--jan", TEA], 2, "go with --tag"),
        (["--tag", "A1", "--room", "no room", "--name", "x"], 2, "room"),
        (["--config", "nowhere.toml"], 2, "nowhere.toml"),
        (["--url", "town.local"], 2, "town.local"),
    ],
)
def test_what_does_not_work_is_one_clear_line(intake, town, arguments, status, line):
    done = intake(*arguments)
    assert (done.returncode, done.stdout) in ((status, ""), (status, "0 things registered.\n"))
    assert line in done.stderr and done.stderr.count("\n") == 1
    assert town.objects.get("E004000000000001").name == "scissors"


def test_keys(intake, tmp_path, capsys):
    """A key of another room has no right, none at all is no key."""
    where = ["--data-dir", str(tmp_path)]
    assert cli.main(["keys", "create", "cook", "--scope", "observe:kitchen", *where]) == 0
    key = next(word for word in capsys.readouterr().out.split() if word.startswith("tms_"))
    with ServerProcess(tmp_path) as own:
        call = ["--url", own.url, "--tag", "A1", "--name", "x"]
        done = intake(*call, "--room", "lab", "--key", key)
        assert (done.returncode, done.stderr) == (
            1,
            "Not registered: this key has no right to register for room lab.\n",
        )
        done = intake(*call)
        assert (done.returncode, done.stdout) == (1, "") and "the server wants a key" in done.stderr


@pytest.mark.parametrize(
    ("text", "part"),
    [
        ('rooom = "lab"', "rooom"),
        ("expires_s = 0", "expires_s"),
        ('[reader]\nkind = "tr4"', "reader"),
        ('[scanner]\nkind = "tcp"\nhost = "x"\nport = 0', "scanner.tcp.port"),
        ("room", "intake.toml"),
    ],
)
def test_a_wrong_configuration_is_one_clear_line(intake, configure, text, part):
    done = intake("--config", configure(text))
    assert done.returncode == 2 and part in done.stderr and done.stderr.count("\n") == 1, done.stderr


def test_a_device_that_can_never_work_ends_it(piped, configure):
    done = piped("--config", configure('[reader]\nkind = "capture"\nformat = "tr3"\npath = "nowhere.bin"'))
    assert done.returncode == 2 and "nowhere.bin" in done.stderr and done.stderr.count("\n") == 1, done.stderr


def test_no_server(intake):
    with socket.create_server(("127.0.0.1", 0)) as listener:
        port = listener.getsockname()[1]
    done = intake("--tag", "A1", "--jan", TEA, url=f"http://127.0.0.1:{port}")
    assert done.returncode == 1 and done.stdout == ""
    assert "the server does not answer" in done.stderr and done.stderr.count("\n") == 1


# a pipe


def test_lines_from_a_pipe(piped, town):
    lines = [TEA, TAG.format(3), TAG.format(4), CUP, SGTIN, "4902102072618", TAG.format(5), "hello"]
    done = piped("--room", "lab", typed="\n".join(lines))
    assert done.returncode == 1
    assert [town.objects.get(tag).name for tag in (TAG.format(3), TAG.format(4), SGTIN)] == [
        "お茶 500ml",
        "cup",
        "お茶 500ml",
    ]
    assert "4902102072618 is not in the catalogue: give its name" in done.stderr
    assert "'hello' is neither a barcode nor a tag" in done.stderr
    assert done.stdout.endswith("3 things registered, 1 not registered.\n")


def test_a_file_instead_of_a_keyboard(tmp_path, server):
    path = tmp_path / "things.txt"
    path.write_text(f"{TEA}\r\n{TAG.format(6)}")
    with path.open() as file:
        done = subprocess.run(
            [sys.executable, "-m", "tms_client", "intake"],
            stdin=file, capture_output=True, text=True, timeout=60, env=os.environ | {"TMS_URL": server.url},
        )  # fmt: skip
    assert done.returncode == 0 and done.stdout.endswith("1 thing registered.\n")


# a person


async def test_a_person_with_a_scanner_in_keyboard_mode(carer, town):
    screen = carer("--room", "lab")
    await screen.sees("Scan a barcode and hold the thing at the reader")
    screen.type(TEA)
    await screen.sees(rf"Scanned {TEA} \(お茶 500ml\). Now hold the thing")
    screen.type(TAG.format(0x11))
    await screen.sees(f"Registered: お茶 500ml, 525 g, tag {TAG.format(0x11)}, room lab")
    screen.type(TAG.format(0x12))  # the other way round
    await screen.sees("Now scan the barcode of this thing")
    screen.type(TEA)
    await screen.sees(f"Registered: .* tag {TAG.format(0x12)}")
    screen.type(TAG.format(0x11))
    await screen.sees("is known already")
    screen.type("E004000000000001")
    await screen.sees("This is registered: scissors, tag E004000000000001, room lab")
    screen.type("4901777018687")
    await screen.sees("was read wrongly")
    assert await screen.presses_ctrl_c() == (0, "2 things registered, 1 registered already.")
    assert town.objects.get(TAG.format(0x12)).name == "お茶 500ml"


async def test_a_name_is_asked_for_and_may_be_left_out(carer, town):
    screen = carer("--room", "lab")
    screen.type(TAG.format(0x21))
    await screen.sees("Now scan")
    screen.type("4902102072618")
    await screen.sees("4902102072618 is not in the catalogue. What is it\\?")
    screen.type("コーラ 500ml")
    await screen.sees(f"Registered: コーラ 500ml, tag {TAG.format(0x21)}")
    assert town.products.get("4902102072618").name == "コーラ 500ml"
    screen.type("4902102000024")
    await screen.sees("not in the catalogue yet")
    screen.type(TAG.format(0x22))
    await screen.sees("What is it")
    screen.type("")
    await screen.sees("Left out")
    screen.type("4902102000024")
    await screen.sees("Scanned")
    screen.type(TAG.format(0x23))
    await screen.sees("What is it")
    screen.type(TEA)  # the next thing instead of an answer: not for the tag before
    await screen.sees(f"it has no name: tag {TAG.format(0x23)}")
    await screen.sees("Scanned .* Now hold the thing")
    screen.type(TAG.format(0x24))
    await screen.sees(f"Registered: お茶 .* tag {TAG.format(0x24)}")
    assert await screen.presses_ctrl_c() == (1, "2 things registered, 2 not registered.")


async def test_devices_on_real_lines(carer, configure, town):
    """A TR3 on a serial line and a scanner in serial mode, in both orders; several tags; a scan that expires."""
    tr3 = Tr3Device()
    async with PtyLine(tr3) as reader, PtyLine(Scanner()) as scanner:
        screen = carer(
            "--config",
            configure(
                f"""
                room = "lab"
                expires_s = 1.5
                settle_s = 0.3
                gone_s = 0.6
                [reader]
                kind = "tr3-serial"
                device = "{reader.path}"
                antennas = [0, 1]
                poll_s = 0.05
                [scanner]
                kind = "serial"
                device = "{scanner.path}"
                """
            ),
        )
        await screen.sees("The .* is ready")
        await screen.sees("The .* is ready")
        scanner.inject(TEA.encode() + b"\r\n")
        await screen.sees("Scanned")
        tr3.see(TAG.format(0x31))
        await screen.sees(f"Registered: お茶 .* tag {TAG.format(0x31)}")
        tr3.lose(TAG.format(0x31))
        tr3.see(TAG.format(0x32))
        await screen.sees(f"Tag {TAG.format(0x32)}. Now scan")
        scanner.inject(b"]E0" + CUP.encode() + b"\r")
        await screen.sees(f"Registered: cup, tag {TAG.format(0x32)}")
        tr3.lose(TAG.format(0x32))
        scanner.inject(CUP.encode() + b"\r")
        await screen.sees(f"The scan of {CUP} has waited too long")
        tr3.see(TAG.format(0x33))
        tr3.see(TAG.format(0x34), 1)
        await screen.sees(f"2 tags at the reader: {TAG.format(0x33)}, {TAG.format(0x34)}. Take all away")
        tr3.lose(TAG.format(0x33))
        tr3.lose(TAG.format(0x34))
        await asyncio.sleep(0.8)
        tr3.see(TAG.format(0x33))
        await screen.sees(f"Tag {TAG.format(0x33)}. Now scan")
        reader.hang_up()
        await screen.sees("The reader is not connected")
        assert await screen.presses_ctrl_c() == (0, "2 things registered.")
    assert town.objects.get(TAG.format(0x31)).room == "lab"


async def test_a_uhf_reader_and_a_scanner_on_the_network(carer, configure):
    async with LlrpEmulator(period_s=0.05) as llrp, TcpLine(Scanner()) as scanner:
        config = configure(
            f"""
            settle_s = 0.2
            [reader]
            kind = "llrp"
            host = "127.0.0.1"
            port = {llrp.port}
            [scanner]
            kind = "tcp"
            host = "127.0.0.1"
            port = {scanner.port}
            """
        )
        screen = carer("--config", config, "--room", "lab")
        await screen.sees("The .* is ready")
        await screen.sees("The .* is ready")
        llrp.see(SGTIN[:-1] + "5")  # needs no scan
        await screen.sees(f"Registered: お茶 500ml, 525 g, tag {SGTIN[:-1]}5, room lab")
        llrp.lose(SGTIN[:-1] + "5")
        llrp.see("E28011700000020A1B2C3D4E")
        await screen.sees("Tag E28011700000020A1B2C3D4E. Now scan")
        scanner.inject(b"not a code\r")
        await screen.sees("is no product barcode")
        scanner.inject(TEA.encode() + b"\r")
        await screen.sees("Registered: .* tag E28011700000020A1B2C3D4E")
        assert (await screen.presses_ctrl_c())[0] == 0


@pytest.mark.parametrize(
    ("section", "form", "tag"),
    [
        ('kind = "text-serial"', "lines", TAG.format(0x41)),
        ('kind = "text-serial"\nform = "rdm6300"', "rdm6300", "0A1B2C3D4E"),
        ('kind = "text-tcp"\norder = "reversed"', "lines", TAG.format(0x42)),
    ],
)
async def test_readers_that_print(carer, configure, town, section, form, tag):
    device = TextReaderDevice(form, before="UID: ")
    async with PtyLine(device, tick_s=0.05) if "serial" in section else TcpLine(device, tick_s=0.05) as line:
        where = f'device = "{line.path}"' if isinstance(line, PtyLine) else f'host = "{line.host}"\nport = {line.port}'
        screen = carer("--config", configure(f"settle_s = 0.2\n[reader]\n{section}\n{where}"), "--room", "lab")
        await screen.sees("The reader is ready")
        screen.type(TEA)
        await screen.sees("Now hold the thing")
        device.tags.append(bytes.fromhex(tag)[::-1].hex() if "reversed" in section else tag)
        await screen.sees(f"Registered: お茶 .* tag {tag}, room lab")
        assert await screen.presses_ctrl_c() == (0, "1 thing registered.")
    assert town.objects.get(tag).jan == TEA


@pytest.mark.parametrize("mode", ["multiple", "single"])
async def test_a_thingmagic_module(carer, configure, town, mode):
    device, tag = ThingMagicDevice(), f"E2801170000002{mode.encode().hex()[:10].upper()}"
    async with PtyLine(device) as line:
        reader = f'kind = "thingmagic"\ndevice = "{line.path}"\nmode = "{mode}"\nread_ms = 30\npoll_s = 0.05'
        screen = carer("--config", configure(f"settle_s = 0.2\ngone_s = 0.5\n[reader]\n{reader}"), "--room", "lab")
        await screen.sees("The reader is ready")
        device.see(tag)
        await screen.sees(f"Tag {tag}. Now scan")
        device.lose(tag)
        screen.type(CUP)
        await screen.sees(f"Registered: cup, tag {tag}, room lab")
        assert await screen.presses_ctrl_c() == (0, "1 thing registered.")
    assert town.objects.get(tag).jan == CUP
