"""A floor for tests: a room of walls with legs and things in it, lasers that see it, the agent as a task or process."""

from __future__ import annotations

import asyncio
import contextlib
import math
import subprocess
import sys
import time
from collections.abc import AsyncIterator
from pathlib import Path
from typing import Any

import numpy as np

from tms_agents.config import read_config
from tms_agents.devices.scans import Scan, Sweep
from tms_agents.floor.calibration.poses import read_poses
from tms_agents.floor.config import FloorConfig
from tms_agents.floor.runner import run
from tms_agents.running import Posted
from tms_client import Town
from tms_schemas.agents import AgentView

WIDTH, DEPTH = 5.0, 4.0
OUTLINE = ((0.0, 0.0), (WIDTH, 0.0), (WIDTH, DEPTH), (0.0, DEPTH))
LEG_M, THING_M, STEP_M = 0.05, 0.04, 0.6


def sweep(beams=361, span=math.pi, period_s=0.1):
    return Sweep(np.linspace(-span / 2, span / 2, beams), 1e-4 * 361 / beams, period_s, 0.02, 8.0, "test")


class Room:
    """Discs (x, y, radius) by name between four walls; ``walk`` puts two legs of a walker somewhere."""

    def __init__(self, seed: int = 3, noise_m: float = 0.004) -> None:
        self.discs: dict[str, tuple[float, float, float]] = {}
        self._random, self._noise_m = np.random.default_rng(seed), noise_m

    def put(self, name: str, x: float, y: float, radius: float = THING_M) -> None:
        self.discs[name] = (x, y, radius)

    def take(self, name: str) -> None:
        del self.discs[name]

    def walk(self, name: str, x: float, y: float, heading: float, way: float) -> None:
        """The legs after ``way`` metres: they pass each other, one stands while the other swings."""
        phase = way / STEP_M
        swing = 0.5 * STEP_M * np.sin(np.pi * phase)
        for side, sign in (("left", 1.0), ("right", -1.0)):
            ahead = sign * swing
            self.discs[f"{name} {side}"] = (
                x + ahead * math.cos(heading) - sign * 0.09 * math.sin(heading),
                y + ahead * math.sin(heading) + sign * 0.09 * math.cos(heading),
                LEG_M,
            )

    def leave(self, name: str) -> None:
        for side in ("left", "right"):
            self.discs.pop(f"{name} {side}", None)

    def ranges(self, sweep: Sweep, pose: tuple[float, float, float]) -> np.ndarray:
        x, y, theta = pose
        cos, sin = np.cos(sweep.angles + theta), np.sin(sweep.angles + theta)
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            to_x = np.where(cos > 0, (WIDTH - x) / cos, np.where(cos < 0, -x / cos, np.inf))
            to_y = np.where(sin > 0, (DEPTH - y) / sin, np.where(sin < 0, -y / sin, np.inf))
        far = np.minimum(to_x, to_y)
        for dx, dy, radius in ((cx - x, cy - y, r) for cx, cy, r in self.discs.values()):
            along = dx * cos + dy * sin
            inside = radius**2 - (dx**2 + dy**2 - along**2)
            hit = along - np.sqrt(np.maximum(inside, 0.0))
            far = np.where((inside > 0) & (along > 0), np.minimum(far, hit), far)
        noisy = np.round(far + self._random.normal(0, self._noise_m, len(far)), 3)
        return np.where(noisy < sweep.range_max_m, noisy, np.inf)

    def scan(self, sweep: Sweep, pose: tuple[float, float, float], device_time_s: float | None = None) -> Scan:
        return Scan(sweep, self.ranges(sweep, pose), None, device_time_s)


#: Of the story below: when somebody comes, stops, puts something down, goes on, and is gone.
COMES, STOPS, PUTS, GOES, GONE = 3.0, 5.5, 6.0, 7.0, 9.0
#: Settings for a story of seconds: learn the empty room, believe in things, quickly.
QUICK = "[estimator]\nlearn_s = 1.5\nstart_s = 0.5\n"
PUT_AT = (2.3, 1.7)
#: Where that is: people come through the wall on the left and go through the wall on the right.
DOORS = """[scene]
gates = [
  [[-0.5, 1.5], [0.5, 1.5], [0.5, 2.5], [-0.5, 2.5]],
  [[4.5, 1.5], [5.5, 1.5], [5.5, 2.5], [4.5, 2.5]],
]
"""


def story(room: Room, t: float) -> None:
    """Somebody walks in at the left, stops in the middle, leaves something there, goes on to the right."""
    if COMES <= t < STOPS:
        room.walk("walker", 0.3 + (t - COMES), 2.0, 0.0, t - COMES)
    elif PUTS <= t < GOES and "thing" not in room.discs:
        room.put("thing", *PUT_AT)
    elif GOES <= t < GONE:
        room.walk("walker", 2.8 + (t - GOES), 2.0, 0.0, t - GOES)
    elif t >= GONE:
        room.leave("walker")


def config_toml(name: str, url: str, lasers: str, *, more: str = "", top: str = "") -> str:
    return (
        f'agent = "{name}-floor"\nroom = "{name}"\nsilent_after_s = 0.5\nheartbeat_s = 1.0\n{top}\n'
        f'[server]\nurl = "{url}"\nlinger_s = 0.0\n[spool]\npath = "floor.spool"\n{lasers}\n{more}\n'
    )


def laser_toml(source: str, pose=(2.5, 0.05, math.pi / 2), name="laser", more: str = "") -> str:
    x, y, theta = pose
    return f'[[lasers]]\nname = "{name}"\nsource = {source}\npose = {{ x = {x}, y = {y}, theta = {theta} }}\n{more}\n'


@contextlib.asynccontextmanager
async def agent(config: Path) -> AsyncIterator[subprocess.Popen[bytes]]:
    """``tms agent floor`` as a process, ended in order."""
    with config.with_suffix(".log").open("ab") as output:
        command = [sys.executable, "-m", "tms_client", "agent", "floor", "--config", str(config)]
        process = subprocess.Popen(command, stdout=output, stderr=output)
    try:
        yield process
    finally:
        if process.poll() is None:
            process.terminate()
        await asyncio.to_thread(process.wait, 20)


class Rig:
    """One floor with an agent in this process: move things, look at the server."""

    def __init__(self, town: Town, name: str, config: Path) -> None:
        self.town, self.name, self.config = town, name, config

    @property
    def agent_name(self) -> str:
        return f"{self.name}-floor"

    async def view(self) -> AgentView:
        return await asyncio.to_thread(self.town.agents.get, self.agent_name)

    async def labels(self, kind: str = "floor") -> dict[str, Any]:
        if kind == "mover":
            return {one.label: one for one in (await asyncio.to_thread(self.town.movers, self.name)).movers}
        found = await asyncio.to_thread(self.town.labels, self.name)
        return {one.label: one for one in found.labels if one.kind == kind and not one.ghost}

    async def state(self, state: str, why: str = "", timeout_s: float = 60.0) -> AgentView:
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

    async def count(self, wanted: int, kind: str = "floor", timeout_s: float = 60.0) -> dict[str, Any]:
        """Wait until the server has so many labels of a kind."""
        found = await self.labels(kind)
        try:
            async with asyncio.timeout(timeout_s):
                while len(found) != wanted:
                    await asyncio.sleep(0.05)
                    found = await self.labels(kind)
        except TimeoutError:
            raise AssertionError(f"not {wanted} labels of kind {kind} within {timeout_s} s, but {found}") from None
        return found

    @contextlib.asynccontextmanager
    async def agent(self, **options: object) -> AsyncIterator[asyncio.Task[Posted]]:
        config = read_config(self.config, FloorConfig)
        found = read_poses(config.calibration_path(self.config))
        poses = {name: one.pose for name, one in found.items()}
        task = asyncio.create_task(run(config, poses, drain_s=2.0, **options))  # type: ignore[arg-type]
        try:
            yield task
        finally:
            task.cancel()
            await task


class Playing:
    """Plays ``story`` at the clock's pace, beginning at ``start``, from the moment it is made."""

    def __init__(self, room: Room, start: float = 0.0) -> None:
        self._room, self._begun, self._start = room, time.monotonic(), start

    @property
    def t(self) -> float:
        return time.monotonic() - self._begun + self._start

    def step(self) -> None:
        story(self._room, self.t)
