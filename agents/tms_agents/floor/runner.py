"""The floor agent at work: scans in, observations into the spool, the spool to the server.

Scans are understood in a thread of their own, one after the other: the time that the estimator needs when it runs first
(it is compiled then) or in a full room keeps neither the lasers nor the server waiting.
"""

from __future__ import annotations

import asyncio
import contextlib
import logging
import time
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any, TypeVar

from tms_agents.clocks import Clocks
from tms_agents.devices.scans import Scan
from tms_agents.devices.transport import DeviceState
from tms_agents.floor.config import FloorConfig, LaserSection
from tms_agents.floor.core import Floor
from tms_agents.floor.live_view import LiveView
from tms_agents.floor.recordings.recorder import Recorder
from tms_agents.floor.settings import Pose
from tms_agents.floor.warm import compiled_before, warm_up
from tms_agents.live import serve_view, socket_path
from tms_agents.outbox import Outbox, mendable
from tms_agents.running import Posted, Running, running
from tms_agents.state import load_state, state_path
from tms_schemas.observation import LabelMoved, Observation

log = logging.getLogger(__name__)
T = TypeVar("T")
#: Groups of scans that wait to be understood; the oldest are left out beyond that.
_WAITING = 400
_SAVE_PAUSE_S = 1.0


async def run(
    config: FloorConfig,
    poses: Mapping[str, Pose],
    *,
    drain_s: float,
    clock: Callable[[], float] = time.time,
    even: Callable[[], float] = time.monotonic,
) -> Posted:
    """Work until the task is cancelled, then post what waits for at most ``drain_s`` seconds.

    ``poses`` are the calibrated ones by laser, ``clock`` gives Unix time, ``even`` seconds that never jump.

    Raises:
        SpoolError: the spool cannot be opened or written.
    """
    posted = Posted()
    async with running(config, drain_s=drain_s, heartbeat_s=config.heartbeat_s, posted=posted, clock=clock) as agent:
        saved = load_state(state_path(config.spool.path), config.agent)
        clocks = Clocks.resumed(saved, clock, even)
        floor = Floor(config, poses, clocks, agent.new_label, saved)
        work = _Work(config, floor, agent, clocks)
        try:
            await work.forever()
        except ExceptionGroup as group:
            raise mendable(group) or group from None
        finally:
            await work.finish()
    return posted


async def listen(
    laser: LaserSection,
    silent_after_s: float,
    scans: Callable[[str, Sequence[Scan]], object],
    changed: Callable[[str, DeviceState], object],
) -> None:
    """What a laser delivers, for ever."""
    async with contextlib.aclosing(laser.source.link(silent_after_s).listen()) as items:
        async for item in items:
            if isinstance(item, DeviceState):
                changed(laser.name, item)
            else:
                scans(laser.name, item)


class Understanding:
    """A ``Floor`` in a thread of its own. ``found`` is called in the event loop with what is to be posted."""

    def __init__(self, floor: Floor, clocks: Clocks, found: Callable[[list[Observation]], object]) -> None:
        self.floor, self.view = floor, LiveView(floor, clocks)
        self._clocks, self._found = clocks, found
        self._thread = ThreadPoolExecutor(1, "floor")
        self._waiting: deque[tuple[str, float, Sequence[Scan]]] = deque(maxlen=_WAITING)
        self._come = asyncio.Event()
        self.left_out = 0
        self._warming, self._warm = asyncio.Lock(), False

    def take(self, laser: str, scans: Sequence[Scan]) -> None:
        if len(self._waiting) == _WAITING:
            if not self.left_out:
                log.warning("scans come faster than they are understood; some are left out")
            self.left_out += 1
        self._waiting.append((laser, self._clocks.now(), scans))
        self._come.set()

    async def warm(self) -> None:
        """Have the estimator compiled; once is enough."""
        async with self._warming:
            if not self._warm:
                if not compiled_before():
                    log.info("compiling the estimator, which happens at the first start only (a minute or two) ...")
                await self.call(warm_up)
                self._warm = True

    async def call(self, work: Callable[[], T]) -> T:
        return await asyncio.get_running_loop().run_in_executor(self._thread, work)

    async def work(self) -> None:
        while True:
            await self._come.wait()
            self._come.clear()
            while self._waiting:
                group = self._waiting.popleft()
                self._found(await self.call(lambda group=group: self._understand(*group)))  # type: ignore[misc]

    def _understand(self, laser: str, arrival: float, scans: Sequence[Scan]) -> list[Observation]:
        found = self.floor.scans(laser, arrival, scans)
        self.view.refresh()
        return found

    def close(self) -> None:
        self._thread.shutdown()


class _Work:
    """The tasks of one run."""

    def __init__(self, config: FloorConfig, floor: Floor, agent: Running, clocks: Clocks) -> None:
        self._config, self._floor = config, floor
        self._outbox = Outbox(
            agent,
            clocks,
            name=config.agent,
            state_file=state_path(config.spool.path),
            heartbeat_s=config.heartbeat_s,
            inventory=lambda: self._mind.call(floor.inventory),
            states=floor.states,
            memory=self._memory,
            save_pause_s=_SAVE_PAUSE_S,
            worth_saving=lambda batch: any(not isinstance(one, LabelMoved) for one in batch),
        )
        self._mind = Understanding(floor, clocks, self._outbox.post)
        self._recorder = None if config.recording is None else Recorder(config.recording, config.upside_down)
        if self._recorder is not None:
            floor.hear = self._recorder.hear

    async def forever(self) -> None:
        await self._mind.warm()  # an agent that cannot follow yet says nothing
        await self._outbox.post_inventory()
        async with asyncio.TaskGroup() as tasks:
            for laser in self._config.lasers:
                tasks.create_task(listen(laser, self._config.silent_after_s, self._mind.take, self._line))
            tasks.create_task(self._mind.work())
            tasks.create_task(self._outbox.work())
            tasks.create_task(serve_view(socket_path(self._config.spool.path), self._mind.view.now))

    async def finish(self) -> None:
        try:
            await self._outbox.finish()
        finally:
            self._mind.close()
            if self._recorder is not None:
                self._recorder.close()

    async def _memory(self) -> dict[str, Any]:
        return await self._mind.call(self._floor.to_dict)

    def _line(self, laser: str, state: DeviceState) -> None:
        self._floor.line(laser, state)
        self._outbox.came_back(state)
