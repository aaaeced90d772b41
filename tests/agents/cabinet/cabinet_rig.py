"""A cabinet for tests: things on an emulated board, its configuration, the agent as a process."""

from __future__ import annotations

import asyncio
import contextlib
import math
import subprocess
import sys
from collections.abc import AsyncIterator, Callable
from pathlib import Path

import numpy as np

from tms_agents.cabinet.calibration_file import read_calibration
from tms_agents.cabinet.config import CabinetConfig
from tms_agents.cabinet.runner import run
from tms_agents.config import read_config
from tms_agents.live import socket_path, views
from tms_agents.running import Posted
from tms_client import Town
from tms_schemas.agents import AgentView
from tms_schemas.belief import LabelView
from tms_schemas.objects import ObjectFields

WIDTH, DEPTH = 0.465, 0.317
CELLS = ((0.04, 0.047), (0.425, 0.047), (0.04, 0.27), (0.425, 0.27))
GAIN, OFFSET = 0.5, (1000, -200, 40, 3000)
MILK, MUG = "E00401004E17F97A", "E00401508747FFC8"


class Shelf:
    """Things on a board; ``counts`` is what its cells say, with noise of ``noise_g`` per cell."""

    def __init__(self, noise_g: float = 2.0) -> None:
        self.things: dict[str, tuple[float, float, float]] = {}
        self.noise_g = noise_g
        self.zero_g = np.zeros(4)
        self._random = np.random.default_rng(7)

    def put(self, name: str, grams: float, x: float, y: float) -> None:
        self.things[name] = (grams, x, y)

    def take(self, name: str) -> None:
        del self.things[name]

    def grams(self) -> np.ndarray:
        """On each cell: a stiff board on four equal springs."""
        cells = np.array(CELLS)
        middle, reach = cells.mean(axis=0), np.ptp(cells, axis=0) / 2
        loads = np.zeros(4)
        for grams, x, y in self.things.values():
            loads += grams / 4 * (1 + ((cells - middle) / reach**2) @ (np.array([x, y]) - middle))
        return loads

    def total(self, _: float = 0.0) -> float:
        """What a scale under all of it shows."""
        return float(self.grams().sum())

    def noise(self, sd_g: float) -> float:
        return float(self._random.normal(0, sd_g))

    def counts(self, _: float) -> list[float]:
        noisy = self.grams() + self.zero_g + self._random.normal(0, self.noise_g, 4)
        return list(noisy / GAIN + OFFSET)


def calibration_toml(*boards: str) -> str:
    return "".join(f'["{board}"]\ngain = {[GAIN] * 4}\noffset = {list(OFFSET)}\n' for board in boards)


def config_toml(
    name: str, url: str, load: str, *, reader: str = "", cells: bool = True, more: str = "", top: str = ""
) -> str:
    """A cabinet of one board, at (2, 1) in the room and turned by 90 degrees."""
    text = f'agent = "{name}-cabinet"\nroom = "{name}"\nsilent_after_s = 0.5\nheartbeat_s = 1.0\n{top}\n'
    text += f'[server]\nurl = "{url}"\nlinger_s = 0.0\n[spool]\npath = "cabinet.spool"\n'
    text += f'[[boards]]\nname = "shelf"\nwidth = {WIDTH}\ndepth = {DEPTH}\nload = {load}\n'
    text += f"cells = {[list(one) for one in CELLS]}\n" if cells else ""
    text += f'pose = {{x = 2.0, y = 1.0, theta = {math.pi / 2}, z = 0.8}}\nsurface = "cabinet/shelf"\n{more}\n'
    if reader:
        text += f'[[readers]]\nzone = "shelf"\nsilent_after_s = 0.5\nsource = {reader}\n'
        text += '[[zones]]\nname = "shelf"\nboard = "shelf"\n'
    return text


@contextlib.asynccontextmanager
async def agent(config: Path, log: Path | None = None) -> AsyncIterator[subprocess.Popen[bytes]]:
    """``tms agent cabinet`` as a process, ended in order."""
    with (log or config.with_suffix(".log")).open("ab") as output:
        command = [sys.executable, "-m", "tms_client", "agent", "cabinet", "--config", str(config)]
        process = subprocess.Popen(command, stdout=output, stderr=output)
    try:
        yield process
    finally:
        if process.poll() is None:
            process.terminate()
        await asyncio.to_thread(process.wait, 20)


async def until(true: Callable[[], bool], timeout_s: float = 20.0) -> None:
    async with asyncio.timeout(timeout_s):
        while not await asyncio.to_thread(true):
            await asyncio.sleep(0.05)


class Rig:
    """One cabinet with an agent in this process: put and take things, look at the server."""

    def __init__(self, town: Town, name: str, config: Path) -> None:
        self.town, self.name, self.config = town, name, config

    @property
    def socket(self) -> Path:
        return socket_path(read_config(self.config, CabinetConfig).spool.path)

    @property
    def agent_name(self) -> str:
        return f"{self.name}-cabinet"

    def register(self, tag: str, name: str, weight_g: float | None = None) -> None:
        self.town.objects.put(tag, ObjectFields(name=name, room=self.name, weight_g=weight_g))

    async def view(self) -> AgentView:
        return await asyncio.to_thread(self.town.agents.get, self.agent_name)

    async def labels(self) -> dict[str, LabelView]:
        return {one.label: one for one in (await asyncio.to_thread(self.town.labels, self.name)).labels}

    async def state(self, state: str, why: str = "", timeout_s: float = 20.0) -> AgentView:
        """Wait until the server shows this state, with this in its reason."""
        view = await self.view()
        try:
            async with asyncio.timeout(timeout_s):
                while view.state != state or why not in view.why:
                    await asyncio.sleep(0.05)
                    view = await self.view()
        except TimeoutError:
            raise AssertionError(f"not {state} ({why}) within {timeout_s} s, but {view.state}: {view.why}") from None
        return view

    async def ready(self, *devices: str) -> None:
        """Wait until the devices deliver and the agent knows the empty board."""
        for device in devices:
            await self.state("connected", device)
        async with asyncio.timeout(20.0), contextlib.aclosing(views(self.socket)) as shown:
            async for view in shown:
                if all(board["knows_load"] for board in view["boards"]):
                    break
        await asyncio.sleep(1.0)  # and knows it well

    async def count(self, labels: int, timeout_s: float = 20.0) -> dict[str, LabelView]:
        """Wait until the server has so many labels."""
        found = await self.labels()
        try:
            async with asyncio.timeout(timeout_s):
                while len(found) != labels:
                    await asyncio.sleep(0.05)
                    found = await self.labels()
        except TimeoutError:
            raise AssertionError(f"not {labels} labels within {timeout_s} s, but {found}") from None
        return found

    @contextlib.asynccontextmanager
    async def agent(self, **options: object) -> AsyncIterator[asyncio.Task[Posted]]:
        config = read_config(self.config, CabinetConfig)
        calibrations = read_calibration(config.calibration_path(self.config))
        task = asyncio.create_task(run(config, calibrations, drain_s=2.0, **options))  # type: ignore[arg-type]
        try:
            yield task
        finally:
            task.cancel()
            await task
