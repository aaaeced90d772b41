"""Emulated readers, a robot that streams its state, the agent as a process, and what a real server believes."""

from __future__ import annotations

import asyncio
import contextlib
import json
import socket
import subprocess
import sys
from collections.abc import AsyncIterator
from pathlib import Path

import pytest

from tms_agents.devices.emulation import PtyLine
from tms_agents.devices.llrp.emulator import LlrpEmulator
from tms_agents.devices.tr3.emulator import Tr3Device
from tms_schemas.objects import ObjectFields
from tms_schemas.rooms import RoomIn

TEA = "E00401004E17F97A"
ROOM = {
    "name": "Lab",
    "outline": [[0, 0], [5, 0], [5, 4], [0, 4]],
    "furniture": [
        {
            "id": "table",
            "name": "Table",
            "polygon": [[2, 1], [3, 1], [3, 2], [2, 2]],
            "surfaces": [{"id": "top", "polygon": [[2, 1], [3, 1], [3, 2], [2, 2]], "z": 0.7}],
        },
        {
            "id": "shelf",
            "name": "Smart cabinet",
            "polygon": [[2, 3], [3, 3], [3, 4], [2, 4]],
            "surfaces": [{"id": "board", "polygon": [[2, 3], [3, 3], [3, 4], [2, 4]], "z": 0.8}],
            "agent": "shelf",
        },
    ],
    "sensors": [{"agent": "laser", "kind": "floor"}],
}
URDF = """<robot name="fetch">
  <link name="base"/> <link name="column"/> <link name="gripper"/>
  <joint name="lift" type="prismatic"><parent link="base"/><child link="column"/>
    <axis xyz="0 0 1"/><limit lower="0" upper="1" effort="1" velocity="1"/></joint>
  <joint name="reach" type="prismatic"><parent link="column"/><child link="gripper"/>
    <origin xyz="0.2 0 0.1"/><axis xyz="1 0 0"/><limit lower="0" upper="1" effort="1" velocity="1"/></joint>
</robot>"""
QUICK = "settle_s = 0.1\nrelease_s = 0.4\ntag_wait_s = 1.0\nstep_s = 0.1"


class FakeRobot:
    """Streams its state 25 times a second to whoever connects, or as datagrams."""

    def __init__(self) -> None:
        self.base, self.joints, self.gripper = [1.0, 1.5, 0.0], {"lift": 0.7, "reach": 0.4}, {}
        self.port, self.talks = 0, True

    def line(self) -> bytes:
        told = {"joints": self.joints, "base": self.base, "gripper": self.gripper}
        return json.dumps(told).encode() + b"\n"

    async def drive(self, x: float, y: float, seconds: float = 0.8) -> None:
        start, steps = list(self.base), round(seconds / 0.04)
        for n in range(1, steps + 1):
            self.base = [a + (b - a) * n / steps for a, b in zip(start, (x, y, start[2]), strict=True)]
            await asyncio.sleep(0.04)

    @contextlib.asynccontextmanager
    async def over_tcp(self) -> AsyncIterator[FakeRobot]:
        talks: set[asyncio.Task[None]] = set()

        async def talk(writer: asyncio.StreamWriter) -> None:
            try:
                writer.write(b'{"joints": "nonsense"}\n')
                while True:
                    if self.talks:
                        writer.write(self.line())
                        await writer.drain()
                    await asyncio.sleep(0.04)
            except ConnectionError:
                pass
            finally:
                writer.close()

        def serve(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
            talks.add(asyncio.create_task(talk(writer)))

        server = await asyncio.start_server(serve, "127.0.0.1", 0)
        self.port = server.sockets[0].getsockname()[1]
        try:
            yield self
        finally:
            server.close()
            for task in talks:
                task.cancel()
            await asyncio.gather(*talks, return_exceptions=True)
            await asyncio.sleep(0)

    @contextlib.asynccontextmanager
    async def over_udp(self) -> AsyncIterator[FakeRobot]:
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
            free.bind(("127.0.0.1", 0))
            self.port = free.getsockname()[1]

        async def send() -> None:
            with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as out:
                out.connect(("127.0.0.1", self.port))
                while True:
                    with contextlib.suppress(ConnectionError):
                        out.send(self.line().rstrip())
                    await asyncio.sleep(0.04)

        task = asyncio.create_task(send())
        try:
            yield self
        finally:
            task.cancel()
            await asyncio.gather(task, return_exceptions=True)


@pytest.fixture
def furnished(town, room) -> str:
    """The room of this test with a table, a smart cabinet, a floor sensor and the tea."""
    town.rooms.put(room, RoomIn.model_validate(ROOM))
    town.objects.put(TEA, ObjectFields(name="tea", room=room))
    yield room
    town.objects.delete(TEA)


@contextlib.contextmanager
def agent(config: Path):
    process = subprocess.Popen(
        [sys.executable, "-m", "tms_client", "agent", "hand", "--config", str(config)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    try:
        yield process
    finally:
        if process.poll() is None:
            process.terminate()
        _, err = process.communicate(timeout=15)
        assert "Traceback" not in err, err


def place(town) -> tuple[str, float]:
    top = town.where(TEA).top
    return top.kind, top.p


def kinds(town, room) -> list[str]:
    return sorted(label.kind for label in town.labels(room).labels if not label.ghost) + ["mover"] * len(
        town.movers(room).movers
    )


async def test_grasp_carry_pull_the_readers_cable_put_on_the_table(town, furnished, server, tmp_path):
    device = Tr3Device()
    (tmp_path / "robot.urdf").write_text(URDF)
    async with PtyLine(device) as line, FakeRobot().over_tcp() as robot:
        config = tmp_path / "hand.toml"
        config.write_text(f"""
            agent = "fetch"
            room = "{furnished}"
            silent_after_s = 2.0
            raw_reads = false
            server = {{url = "{server.url}"}}
            spool = {{path = "hand.spool"}}
            [robot]
            states = {{kind = "tcp", host = "127.0.0.1", port = {robot.port}}}
            [[hands]]
            name = "gripper"
            source = {{kind = "tr3-serial", device = "{line.path}", poll_s = 0.05}}
            arm = {{urdf = "robot.urdf", tip_link = "gripper"}}
            [hands.grasp]
            {QUICK}
        """)
        robot.gripper = {"gripper": {"opening_m": 0.1}}
        device.see(TEA)
        with agent(config):
            await _until(lambda: town.agents.get("fetch").state == "connected")
            robot.gripper = {"gripper": {"opening_m": 0.05}}
            await asyncio.sleep(0.4)
            await robot.drive(1.5, 1.5)
            await _until(lambda: place(town)[0] == "robot" and place(town)[1] > 0.9)
            held = town.where(TEA).top.label
            assert kinds(town, furnished) == ["robot", "mover"]

            line.hang_up()
            await _until(lambda: town.agents.get("fetch").state == "faulty")
            await robot.drive(1.9, 1.5)
            await _until(lambda: town.where(TEA).top.xy[0] > 2.4)
            assert town.where(TEA).top.label == held and place(town)[1] > 0.9
            line.plug_in()
            await _until(lambda: town.agents.get("fetch").state == "connected")
            assert town.where(TEA).top.label == held

            robot.gripper = {"gripper": {"opening_m": 0.1}}
            device.lose(TEA)
            await asyncio.sleep(0.1)
            await robot.drive(1.0, 1.5, 0.4)
            await _until(lambda: place(town)[0] == "table")
        answer = town.where(TEA)
    assert answer.top.p > 0.9 and (answer.top.furniture, answer.top.surface) == ("table", "top")
    assert answer.top.xy == pytest.approx((2.5, 1.5), abs=0.03)
    assert kinds(town, furnished) == ["table", "mover"]
    assert [one.kind for one in town.anomalies(furnished).anomalies] == []


async def test_from_hand_to_hand_across_a_restart_into_a_smart_cabinet(town, furnished, server, tmp_path):
    """Two arms from DH tables, one LLRP reader with an antenna in each hand, states by UDP."""
    async with LlrpEmulator(period_s=0.05) as reader, FakeRobot().over_udp() as robot:
        # Each arm slides forward from 0.8 m above the floor, to the left and right of the middle.
        arm = "arm = {base_rpy = [0, 1.5707963, 0], base_xyz = [0, %s, 0.8], dh = [{joint = 'reach', kind = 'slides'}]}"
        config = tmp_path / "hand.toml"
        config.write_text(f"""
            agent = "butler"
            room = "{furnished}"
            raw_reads = false
            server = {{url = "{server.url}"}}
            spool = {{path = "hand.spool"}}
            source = {{kind = "llrp", host = "127.0.0.1", port = {reader.port}, keepalive_s = 0.3}}
            [robot]
            states = {{kind = "udp", port = {robot.port}}}
            [[hands]]
            name = "left"
            antennas = [1]
            {arm % 0.1}
            [hands.grasp]
            {QUICK}
            look_s = 0.1
            [[hands]]
            name = "right"
            antennas = [2]
            {arm % -0.1}
            [hands.grasp]
            {QUICK}
            look_s = 0.1
        """)
        robot.base[1] = 2.5
        robot.gripper = {"left": {"opening_m": 0.1}, "right": {"opening_m": 0.1}}
        reader.see(TEA, antenna=1)
        with agent(config) as process:
            await _until(lambda: town.agents.get("butler").state == "connected")
            robot.gripper["left"] = {"opening_m": 0.05}
            await asyncio.sleep(0.4)
            await robot.drive(1.4, 2.5)
            await _until(lambda: place(town)[0] == "robot" and place(town)[1] > 0.9)
            first = town.where(TEA).top.label

            robot.gripper["right"] = {"opening_m": 0.05}
            await robot.drive(1.6, 2.5, 0.6)
            robot.gripper["left"] = {"opening_m": 0.1}
            reader.lose(TEA)
            reader.see(TEA, antenna=2)
            await _until(lambda: town.where(TEA).top.label != first)
            assert place(town)[0] == "robot" and place(town)[1] > 0.9
            assert kinds(town, furnished) == ["robot", "mover"]
            second = town.where(TEA).top.label
            process.kill()

        await robot.drive(1.9, 3.5, 0.2)
        with agent(config):
            await _until(lambda: town.where(TEA).top.xy[1] > 3.2)
            assert town.where(TEA).top.label == second and kinds(town, furnished) == ["robot", "mover"]
            robot.gripper["right"] = {"opening_m": 0.1}
            reader.lose(TEA)
            await _until(lambda: kinds(town, furnished) == ["mover"])
    # The cabinet's own agent would tell where it is now; until then it is with the robot.
    assert place(town)[0] == "mover" and place(town)[1] > 0.9


async def test_a_robot_that_falls_silent_is_shown(town, furnished, server, tmp_path):
    robot = FakeRobot()
    async with robot.over_tcp():
        config = tmp_path / "hand.toml"
        config.write_text(f"""
            agent = "mute"
            room = "{furnished}"
            silent_after_s = 0.5
            server = {{url = "{server.url}"}}
            spool = {{path = "hand.spool"}}
            robot = {{states = {{kind = "tcp", host = "127.0.0.1", port = {robot.port}}}}}
            hands = [{{name = "gripper"}}]
        """)
        with agent(config):
            await _until(lambda: town.agents.get("mute").state == "connected")
            robot.talks = False
            await _until(lambda: town.agents.get("mute").state == "silent")
            robot.talks = True
            await _until(lambda: town.agents.get("mute").state == "connected")
    assert kinds(town, furnished) == ["mover"]


async def _until(true, timeout_s: float = 20.0) -> None:
    async with asyncio.timeout(timeout_s):
        while not await asyncio.to_thread(_safely, true):
            await asyncio.sleep(0.05)


def _safely(true) -> bool:
    from tms_client import NotFound

    try:
        return true()
    except (NotFound, AttributeError, TypeError):  # not there yet
        return False
