"""The cabinet agent on this computer: how late its events are on the server, and what it costs.

    python benchmarks/cabinet_agent.py [--seconds 60] [--things 20] [--ask all]

A board of four cells at 50 Hz and a TR3 behind pseudo terminals (a process of their own), a real server, ``tms agent
cabinet`` as a process. Latency: from the moment the load has its final value to the first moment the server answers
with the event (asked every 5 ms). Cost: processor time of the agent's process in percent of one core.
"""

from __future__ import annotations

import argparse
import asyncio
import contextlib
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from tms_agents.devices.emulation import PtyLine
from tms_agents.devices.loadboard.emulator import RosTmsBoardDevice
from tms_agents.devices.tr3.emulator import Tr3Device
from tms_client import Town
from tms_schemas.rooms import RoomIn

CELLS = np.array([[0.04, 0.047], [0.425, 0.047], [0.04, 0.27], [0.425, 0.27]])
CONFIG = """
agent = "bench-cabinet"
room = "bench"
server = {{ url = "{url}", linger_s = {linger} }}
spool = {{ path = "cabinet.spool" }}
[[boards]]
name = "shelf"
load = {{ kind = "ros-tms", device = "{board}", ask = "{ask}" }}
width = 0.465
depth = 0.317
cells = {cells}
pose = {{ x = 0, y = 0 }}
[[readers]]
source = {{ kind = "tr3-serial", device = "{reader}", poll_s = 0.2 }}
zone = "shelf"
[[zones]]
name = "shelf"
board = "shelf"
"""


async def play() -> None:
    """The devices, as a process: ``put`` and ``take`` on stdin change the load at once."""
    load, random, tag = np.zeros(4), np.random.default_rng(1), ""

    def counts(_: float) -> Sequence[float]:
        return [float(one) for one in load + random.normal(0, 2.0, 4)]

    reader = Tr3Device()
    async with PtyLine(RosTmsBoardDevice(counts)) as board, PtyLine(reader) as line:
        print(board.path, line.path, flush=True)
        while order := (await asyncio.to_thread(sys.stdin.readline)).split():
            if order[0] == "put":
                middle, reach = CELLS.mean(axis=0), np.ptp(CELLS, axis=0) / 2
                at = np.array([float(order[2]), float(order[3])])
                load[:] = float(order[1]) / 4 * (1 + ((CELLS - middle) / reach**2) @ (at - middle))
            elif order[0] == "see":
                tag = order[1]
                reader.see(tag)
            else:
                load[:] = 0
                reader.lose(tag)


@contextlib.contextmanager
def process(*command: str, **options: int) -> Iterator[subprocess.Popen[str]]:
    running = subprocess.Popen([sys.executable, *command], text=True, **options)  # type: ignore[call-overload]
    try:
        yield running
    finally:
        running.terminate()
        running.wait(20)


def measure(seconds: float, things: int, ask: str) -> None:
    folder = Path(tempfile.mkdtemp(prefix="tms-bench-"))
    serve = ("-m", "tms_client", "serve", "--data-dir", str(folder / "data"), "--port", "0")
    with (
        process(*serve, stderr=subprocess.PIPE) as server,
        process(__file__, "--play", stdin=subprocess.PIPE, stdout=subprocess.PIPE) as devices,
    ):
        assert server.stderr and devices.stdin and devices.stdout
        url = next(line.split()[1].rstrip("/") for line in server.stderr if line.startswith("tms: http"))
        board, reader = devices.stdout.readline().split()
        config = folder / "cabinet.toml"
        config.write_text(
            CONFIG.format(url=url, board=board, reader=reader, cells=CELLS.tolist(), linger=0.02, ask=ask)
        )
        (folder / "cabinet.calibration.toml").write_text("[shelf]\ngain = [1, 1, 1, 1]\noffset = [0, 0, 0, 0]\n")
        with Town(url) as town:
            town.rooms.put("bench", RoomIn.model_validate({"name": "Bench", "outline": [[0, 0], [2, 0], [2, 2]]}))
            command = ("-m", "tms_client", "agent", "cabinet", "--config", str(config))
            with process(*command, stderr=subprocess.DEVNULL, stdout=subprocess.DEVNULL) as agent:
                while town.agents.get("bench-cabinet").state != "connected":
                    time.sleep(0.05)
                time.sleep(3)
                used = 100 * cost(agent.pid, seconds)
                print(f"cost at rest, cells asked {ask}, {seconds:g} s: {used:.2f} % of one core (goal 2)")
                for kind in ("tag", "plain"):
                    late = latencies(town, devices, things, kind)
                    for what, values in late.items():
                        print(
                            f"{what:6s} {'with tag' if kind == 'tag' else 'no tag':8s} n {len(values):3d}  median "
                            f"{np.median(values):.3f} s  95 % {np.quantile(values, 0.95):.3f} s  most "
                            f"{max(values):.3f} s  (goal 0.5)"
                        )


def latencies(town: Town, devices: subprocess.Popen[str], things: int, kind: str) -> dict[str, list[float]]:
    random = np.random.default_rng(2)
    late: dict[str, list[float]] = {"put": [], "taken": []}
    for number in range(things):
        weight, x, y = random.uniform(50, 1000), random.uniform(0.08, 0.38), random.uniform(0.07, 0.25)
        for what, order, there in (("put", f"put {weight} {x} {y}\n", 1), ("taken", "take\n", 0)):
            assert devices.stdin
            if what == "put" and kind == "tag":  # a hand brings it into the field before it touches the board
                devices.stdin.write(f"see E00401{number:010X}\n")
                devices.stdin.flush()
                time.sleep(0.4)
            devices.stdin.write(order)
            devices.stdin.flush()
            began = time.monotonic()
            while len(town.labels("bench").labels) != there and time.monotonic() - began < 10:
                time.sleep(0.005)
            late[what].append(time.monotonic() - began)
            time.sleep(float(random.uniform(1.0, 2.0)))
    return late


def cost(pid: int, seconds: float) -> float:
    def used() -> float:
        fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
        return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")

    before, began = used(), time.monotonic()
    time.sleep(seconds)
    return (used() - before) / (time.monotonic() - began)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--things", type=int, default=20)
    parser.add_argument("--ask", choices=["one", "all"], default="one", help="cell after cell, or all at once")
    parser.add_argument("--play", action="store_true", help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.play:
        asyncio.run(play())
    else:
        measure(arguments.seconds, arguments.things, arguments.ask)
