"""``tms agent hand`` from reader bytes to the unknown-tag list of a real server."""

from __future__ import annotations

import asyncio
import dataclasses
import json
import signal
import subprocess
import sys
import time
from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest

import tms_agents.hand
from tms_agents.config import read_config
from tms_agents.devices.emulation import PtyLine
from tms_agents.devices.llrp import messages
from tms_agents.devices.llrp.codec import Parameter, encode
from tms_agents.devices.llrp.emulator import LlrpEmulator
from tms_agents.devices.tags import TagRead
from tms_agents.devices.tr3.codec import Frame
from tms_agents.devices.tr3.emulator import Tr3Device
from tms_agents.hand.config import HandConfig
from tms_agents.hand.setup import make_arm, make_robot
from tms_client import Spool, cli

EPC, OTHER = "30352B2E4401D3000000007B", "300833B2DDD9CAFEBABE8001"
UID = "E00401004E17F97A"
ZERO = datetime(2026, 1, 1, tzinfo=UTC)


def capture(*reports: tuple[str, int, float, float]) -> bytes:
    """An LLRP conversation: greeting, then one report per (tag, antenna, first second, last second)."""
    hello = messages.event(ZERO, Parameter("ConnectionAttemptEvent", {"Status": 0}))
    reads = [
        TagRead(tag=tag, antenna=antenna, first_seen=ZERO + timedelta(seconds=a), last_seen=ZERO + timedelta(seconds=b))
        for tag, antenna, a, b in reports
    ]
    bodies = [hello, *(messages.report([read]) for read in reads)]
    return b"".join(encode(dataclasses.replace(body, id=n)) for n, body in enumerate(bodies))


def counts(town, room) -> dict[str, int]:
    return {one.tag: one.count for one in town.unknown_tags(room)}


REPORTS = [(EPC, 1, 0, 1), (EPC, 1, 2, 3), (EPC, 1, 60, 61), (OTHER, 2, 5, 5)]


@pytest.mark.parametrize(("mode", "expected"), [("visits", {EPC: 2, OTHER: 1}), ("reports", {EPC: 3, OTHER: 1})])
def test_an_llrp_capture_once(town, room, configure, tmp_path, capsys, mode, expected):
    (tmp_path / "x.bin").write_bytes(b"\xff\xff" + capture(*REPORTS) + b"\x04")
    source = {"kind": "capture", "format": "llrp", "path": "x.bin"}
    config = configure(source, visits={"count": mode})
    assert cli.main(["agent", "hand", "--config", str(config), "--once"]) == 0
    assert counts(town, room) == expected
    view = next(one for one in town.unknown_tags(room) if one.tag == EPC)
    assert (view.first_seen, view.agent) == (ZERO, f"{room}-hand")
    assert "4 reports of 2 tags" in capsys.readouterr().out
    agent = town.agents.get(f"{room}-hand")
    assert (agent.state, agent.missing, agent.next_seq) == ("silent", 0, sum(expected.values()) + 2)


def test_running_again_is_a_new_observation_not_a_conflict(town, room, configure, tmp_path):
    """The numbering continues, with the spool kept and with the spool lost."""
    (tmp_path / "x.bin").write_bytes(capture(*REPORTS))
    config = configure({"kind": "capture", "format": "llrp", "path": "x.bin"})
    for expected in (3, 6, 9):
        assert cli.main(["agent", "hand", "--config", str(config), "--once"]) == 0
        assert counts(town, room)[EPC] == expected
        if expected == 6:
            for file in tmp_path.glob("hand.spool*"):
                file.unlink()


def test_a_tr3_capture_once(town, room, configure, tmp_path):
    frame = Frame(0x4C, bytes.fromhex(UID)[::-1] + bytes(16)).encode()
    (tmp_path / "x.bin").write_bytes(frame[9:] + frame * 5 + frame[:20])
    config = configure({"kind": "capture", "format": "tr3", "path": "x.bin"})
    assert cli.main(["agent", "hand", "--config", str(config), "--once"]) == 0
    assert counts(town, room) == {UID: 5}


def test_antennas_may_be_zones_of_their_own(town, room, configure, tmp_path):
    (tmp_path / "x.bin").write_bytes(capture((EPC, 1, 0, 0), (EPC, 2, 1, 1), (EPC, 7, 1, 1)))
    source = {"kind": "capture", "format": "llrp", "path": "x.bin"}
    config = configure(source, zone="hand", zones={"1": "left", "2": "right"})
    assert cli.main(["agent", "hand", "--config", str(config), "--once"]) == 0
    assert counts(town, room) == {EPC: 3}


def test_a_tag_too_long_for_the_wire_does_not_stop_the_others(town, room, configure, tmp_path, caplog):
    (tmp_path / "x.bin").write_bytes(capture(("AB" * 40, 1, 0, 0), (EPC, 1, 0, 0)))
    config = configure({"kind": "capture", "format": "llrp", "path": "x.bin"})
    assert cli.main(["agent", "hand", "--config", str(config), "--once"]) == 0
    assert counts(town, room) == {EPC: 1}
    assert "more than 64 digits" in caplog.text


def test_a_full_spool_is_said(town, room, configure, tmp_path, capsys):
    (tmp_path / "x.bin").write_bytes(capture(*REPORTS))
    source = {"kind": "capture", "format": "llrp", "path": "x.bin"}
    config = configure(source, url="http://127.0.0.1:9", spool={"path": "hand.spool", "max_items": 2})
    assert cli.main(["agent", "hand", "--config", str(config), "--once", "--timeout", "0.1"]) == 1
    assert "3 lost, 2 waiting in the spool" in capsys.readouterr().out


def test_a_second_agent_on_the_same_spool_is_told_so(configure, capsys):
    config = configure({"kind": "tr3-serial", "device": "/dev/null"})
    read = read_config(config, HandConfig)
    with Spool(read.spool.path, read.agent):
        assert cli.main(["agent", "hand", "--config", str(config)]) == 2
    assert capsys.readouterr().err == f"tms: spool {read.spool.path}: an agent with this spool is running already\n"


def test_the_agent_needs_no_numeric_libraries():
    """A sensor host with the light install has no numba and no scipy; reading tags needs no numpy either."""
    block = "import sys; sys.modules.update(dict.fromkeys(('numpy', 'numba', 'scipy', 'fastapi')))"
    command = f"{block}; from tms_agents.commands.agent import main; main(['hand', '--help'])"
    done = subprocess.run([sys.executable, "-c", command], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


def test_a_file_without_frames_makes_the_agent_faulty(town, room, configure, tmp_path):
    (tmp_path / "x.bin").write_bytes(b"nothing of the kind")
    config = configure({"kind": "capture", "format": "llrp", "path": "x.bin"})
    assert cli.main(["agent", "hand", "--config", str(config), "--once"]) == 0
    assert counts(town, room) == {}


def test_without_a_server_everything_waits_in_the_spool(town, room, configure, tmp_path, capsys):
    (tmp_path / "x.bin").write_bytes(capture(*REPORTS))
    source = {"kind": "capture", "format": "llrp", "path": "x.bin"}
    config = configure(source, url="http://127.0.0.1:9")
    assert cli.main(["agent", "hand", "--config", str(config), "--once", "--timeout", "0.3"]) == 1
    assert "6 waiting in the spool (http://127.0.0.1:9 does not answer" in capsys.readouterr().out
    config = configure(source | {"path": "empty.bin"})
    (tmp_path / "empty.bin").write_bytes(b"")
    assert cli.main(["agent", "hand", "--config", str(config), "--once"]) == 0
    assert counts(town, room) == {EPC: 3, OTHER: 1}


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"kind": "capture", "format": "llrp", "path": "absent.bin"}, "No such file"),
        ({"kind": "capture", "format": "llrp"}, "source.capture.path: Field required"),
        ({"kind": "laser"}, "source: Input tag 'laser'"),
        ({"kind": "capture", "format": "llrp", "path": "x", "colour": 1}, "colour: Extra inputs are not permitted"),
        ({"kind": "llrp", "host": "h"}, "--once needs a source of kind capture"),
    ],
)
def test_a_wrong_configuration_is_one_line(configure, capsys, change, says):
    assert cli.main(["agent", "hand", "--config", str(configure(change)), "--once"]) == 2
    error = capsys.readouterr().err.splitlines()
    assert says in error[-1] and error[-1].startswith("tms: ")


def test_unknown_kind_and_missing_file(capsys, tmp_path):
    assert cli.main(["agent", "nose", "--config", "x"]) == 2
    assert cli.main(["agent", "hand", "--config", str(tmp_path / "absent.toml")]) == 2
    assert [line[:5] for line in capsys.readouterr().err.splitlines()] == ["tms: "] * 2


EXAMPLES = Path(tms_agents.hand.__file__).parent / "examples"


@pytest.mark.parametrize("path", sorted(EXAMPLES.glob("*.toml")), ids=lambda path: path.stem)
def test_the_examples_are_valid(path):
    config = read_config(path, HandConfig)
    assert config.room == "living-room"
    if config.hands:
        make_robot(config, lambda: "x/1")


def test_the_two_arms_of_the_example_mirror_each_other():
    """One comes from a URDF, the other from a DH table of the mirrored arm."""
    left, right = (make_arm(hand.arm) for hand in read_config(EXAMPLES / "two-arms.toml", HandConfig).hands)
    for pan, lift, elbow, wrist in ((0, 0, 0, 0), (0.3, -0.4, 0.8, 1.0), (-0.5, 0.6, -0.2, 0.3)):
        states = {"left_shoulder_pan": pan, "left_shoulder_lift": lift, "left_elbow": elbow, "left_wrist": wrist}
        x, y, z = left.gripper(states).xyz
        mirrored = {name.replace("left", "right"): -value if "pan" in name else value for name, value in states.items()}
        assert right.gripper(mirrored).xyz == pytest.approx((x, -y, z), abs=1e-6)


ROBOT = {"states": {"kind": "stdin"}}


@pytest.mark.parametrize(
    ("more", "says"),
    [
        ({}, "hand.toml: give a [source], or [[hands]]"),
        ({"hands": [{"name": "a"}]}, "[[hands]] and [robot] belong together"),
        ({"robot": ROBOT, "source": {"kind": "llrp", "host": "h"}}, "[[hands]] and [robot] belong together"),
        ({"robot": ROBOT, "hands": [{"name": "a"}, {"name": "a"}]}, "two hands have the same name"),
        ({"robot": ROBOT, "hands": [{"name": "a", "antennas": [1]}]}, "there is no reader"),
        ({"robot": ROBOT, "hands": [{"name": "a", "arm": {"urdf": "x.urdf"}}]}, "a urdf needs tip_link"),
        ({"robot": ROBOT, "hands": [{"name": "a", "arm": {}}]}, "give either urdf or dh"),
        ({"robot": ROBOT, "hands": [{"name": "a"}], "source": {"kind": "capture", "format": "tr3", "path": "x"}},
         "a capture has no robot"),
        ({"robot": ROBOT, "hands": [{"name": "a", "arm": {"urdf": "x.urdf", "tip_link": "t"}}]}, "x.urdf: [Errno 2]"),
    ],
)  # fmt: skip
def test_wrong_hands_are_one_line(tmp_path, capsys, more, says):
    path = tmp_path / "hand.toml"
    path.write_text('agent = "a"\nroom = "r"\nspool = {path = "s"}\n' + "".join(map(_toml, more.items())))
    assert cli.main(["agent", "hand", "--config", str(path)]) == 2
    error = capsys.readouterr().err.splitlines()
    assert says in error[-1] and error[-1].startswith("tms: ") and not (tmp_path / "s").exists()


def _toml(item: tuple[str, object]) -> str:
    return f"{item[0]} = {_value(item[1])}\n"


def _value(value: object) -> str:
    if isinstance(value, dict):
        return "{" + ", ".join(f"{name} = {_value(one)}" for name, one in value.items()) + "}"
    return f"[{', '.join(map(_value, value))}]" if isinstance(value, list) else json.dumps(value)


def test_the_key_comes_from_the_environment(configure, monkeypatch):
    monkeypatch.setenv("TMS_KEY", "from the environment")
    assert read_config(configure({"kind": "llrp", "host": "h"}), HandConfig).server.key == "from the environment"


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
async def test_a_live_reader_until_a_signal(town, room, configure, number):
    """Tags at an emulated reader reach the server; the agent ends in order and says so."""
    async with LlrpEmulator(period_s=0.02) as reader:
        reader.see(EPC)
        config = configure({"kind": "llrp", "host": "127.0.0.1", "port": reader.port, "keepalive_s": 0.2})
        agent = subprocess.Popen(
            [sys.executable, "-m", "tms_client", "agent", "hand", "--config", str(config)],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )
        await _until(lambda: counts(town, room) == {EPC: 1})
        assert town.agents.get(f"{room}-hand").state == "connected"
        reader.see(OTHER)
        await _until(lambda: counts(town, room) == {EPC: 1, OTHER: 1})
        agent.send_signal(number)
        out, err = await asyncio.to_thread(agent.communicate, timeout=10)
        assert agent.returncode == 0 and "0 waiting" in out and "Traceback" not in err
    assert town.agents.get(f"{room}-hand").state == "silent"
    assert town.agents.get(f"{room}-hand").missing == 0


async def test_a_quiet_agent_says_that_it_lives(town, room, configure):
    """A reader without tags in view: the agent repeats its state instead of falling silent."""
    async with LlrpEmulator(period_s=0.02) as reader:
        source = {"kind": "llrp", "host": "127.0.0.1", "port": reader.port, "keepalive_s": 0.2}
        config = configure(source, heartbeat_s=0.2)
        agent = subprocess.Popen(
            [sys.executable, "-m", "tms_client", "agent", "hand", "--config", str(config)],
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        try:
            await _until(lambda: town.agents.get(f"{room}-hand").next_seq >= 5)
            assert town.agents.get(f"{room}-hand").state == "connected"
        finally:
            agent.terminate()
            await asyncio.to_thread(agent.wait, 10)
    assert counts(town, room) == {}


async def test_a_reader_that_fails_is_shown_faulty_within_seconds(town, room, configure):
    device = Tr3Device()
    device.see(UID)
    async with PtyLine(device) as line:
        source = {"kind": "tr3-serial", "device": line.path, "poll_s": 0.05}
        config = configure(source, silent_after_s=0.5)
        agent = subprocess.Popen(
            [sys.executable, "-m", "tms_client", "agent", "hand", "--config", str(config)],
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        try:
            await _until(lambda: counts(town, room) == {UID: 1})
            device.silent = True
            began = time.monotonic()
            await _until(lambda: town.agents.get(f"{room}-hand").state != "connected")
            assert time.monotonic() - began < 5
            device.silent = False
            await _until(lambda: town.agents.get(f"{room}-hand").state == "connected")
        finally:
            agent.kill()
            agent.wait()
    # killed, not asked to stop: the spool opens again
    with Spool(config.parent / "hand.spool", f"{room}-hand") as spool:
        assert spool.next_seq is not None


async def _until(true, timeout_s: float = 20.0) -> None:
    async with asyncio.timeout(timeout_s):
        while not await asyncio.to_thread(true):
            await asyncio.sleep(0.05)
