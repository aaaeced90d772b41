"""Where the emulated devices are plugged in: pseudo terminals and a TCP port, served by a thread of their own."""

from __future__ import annotations

import asyncio
import threading
from collections.abc import Callable, Coroutine, Iterator, Mapping
from contextlib import AsyncExitStack, contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from tms_agents.devices.emulation import PtyLine, TcpLine
from tms_agents.simulation.cabinet_bench import CabinetBench
from tms_agents.simulation.robot_bench import STATE_S, RobotBench
from tms_agents.simulation.room import CABINETS, FLOOR_AGENT, ROBOT, ROBOT_AGENT
from tms_agents.simulation.world import World

if TYPE_CHECKING:
    from tms_agents.simulation.floor_bench import FloorBench

T = TypeVar("T")
#: Of the laser's line; a sweep takes 25 ms.
_LASER_TICK_S = 0.005


@dataclass(frozen=True, slots=True)
class Plugs:
    """Where the devices of one agent are plugged in.

    ``loads`` is a load-cell board, ``states`` the robot's controller, ``laser`` looks over the floor.
    """

    reader: str | None = None
    loads: str | None = None
    states: tuple[str, int] | None = None
    laser: tuple[str, int] | None = None


class Hardware:
    """All devices of the room; made by ``plugged_in``."""

    def __init__(self, seed: int, *, laser: bool = False) -> None:
        names = [*(one.id for one in CABINETS), ROBOT_AGENT, FLOOR_AGENT]
        streams = dict(zip(names, np.random.default_rng(seed).spawn(len(names)), strict=True))
        self.cabinets: Mapping[str, CabinetBench] = {one.id: CabinetBench(one, streams[one.id]) for one in CABINETS}
        self.robot = RobotBench(ROBOT, streams[ROBOT_AGENT])
        self.floor = _floor_bench(streams[FLOOR_AGENT]) if laser else None
        self.plugs: dict[str, Plugs] = {}
        self._loop = asyncio.new_event_loop()
        self._unplug = asyncio.Event()

    def follow(self, world: World) -> None:
        """What people and robots just did in the room happens at the devices."""
        self._call(lambda: self._follow(world))

    def _follow(self, world: World) -> None:
        for bench in self.cabinets.values():
            bench.follow(world)
        self.robot.follow(world)
        if self.floor is not None:
            self.floor.follow(world)

    def _call(self, work: Callable[[], T]) -> T:
        """Run in the devices' thread."""

        async def run() -> T:
            return work()

        return asyncio.run_coroutine_threadsafe(run(), self._loop).result()

    async def serve(self, ready: Callable[[], object]) -> None:
        async with AsyncExitStack() as stack:
            for name, bench in self.cabinets.items():
                board, reader = PtyLine(bench.board), PtyLine(bench.reader)
                for line in (board, reader):
                    await stack.enter_async_context(line)
                self.plugs[name] = Plugs(reader=reader.path, loads=board.path)
            hand, states = PtyLine(self.robot.reader), TcpLine(self.robot, tick_s=STATE_S)
            await stack.enter_async_context(hand)
            await stack.enter_async_context(states)
            self.plugs[ROBOT_AGENT] = Plugs(reader=hand.path, states=(states.host, states.port))
            if self.floor is not None:
                laser = TcpLine(self.floor.device, tick_s=_LASER_TICK_S)
                await stack.enter_async_context(laser)
                self.plugs[FLOOR_AGENT] = Plugs(laser=(laser.host, laser.port))
            ready()
            await self._unplug.wait()

    def start(self) -> Callable[[], None]:
        """Plug in; the answer pulls all plugs."""
        return served(self._loop, self.serve, self._unplug)


def served(
    loop: asyncio.AbstractEventLoop,
    serve: Callable[[Callable[[], object]], Coroutine[Any, Any, None]],
    unplug: asyncio.Event,
) -> Callable[[], None]:
    """Run ``serve`` in a thread with ``loop`` until the answer is called; ``serve`` says when it is ready, and ends
    when ``unplug`` is set.

    Raises:
        OSError: the devices are not ready in time.
    """
    ready = threading.Event()
    thread = threading.Thread(target=lambda: loop.run_until_complete(serve(ready.set)), name="devices", daemon=True)
    thread.start()
    if not ready.wait(30.0):
        raise OSError("the emulated devices cannot be plugged in")

    def stop() -> None:
        loop.call_soon_threadsafe(unplug.set)
        thread.join(10.0)
        loop.close()

    return stop


def _floor_bench(rng: np.random.Generator) -> FloorBench:
    from tms_agents.simulation.floor_bench import FloorBench  # needs numba and scipy, the others do not

    return FloorBench(rng)


@contextmanager
def plugged_in(seed: int, *, laser: bool = False) -> Iterator[Hardware]:
    hardware = Hardware(seed, laser=laser)
    stop = hardware.start()
    try:
        yield hardware
    finally:
        stop()
