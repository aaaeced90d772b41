"""Between what an agent sees and its spool: a queue that keeps the order of events; states, inventories, memory."""

from __future__ import annotations

import asyncio
import contextlib
import logging
from collections.abc import Awaitable, Callable, Mapping
from pathlib import Path
from typing import Any

from tms_agents.clocks import Clocks
from tms_agents.devices.beat import sleep_to_the_beat
from tms_agents.devices.transport import DeviceState
from tms_agents.running import Running
from tms_agents.state import save_state
from tms_client.cli import CommandError
from tms_client.errors import SpoolError
from tms_schemas.observation import Inventory, Observation

log = logging.getLogger(__name__)
_LOOK_S = 0.4
_SAVE_S = 60.0
#: After a device came back, what changed meanwhile has been told by then.
_SETTLED_S = 2.0
_OUTBOX = 1000


class Outbox:
    """Takes observations from any callback of the event loop; ``work`` does the rest until it is cancelled.

    ``inventory`` and ``memory`` (what is kept across restarts, for ``state_file``) are asked for when they are needed;
    ``states`` tells how the devices are. The memory is saved after every batch that is ``worth_saving``, with a pause
    of ``save_pause_s`` between, and once a minute. What finds no room in the queue or the spool is made good by an
    inventory.
    """

    def __init__(
        self,
        agent: Running,
        clocks: Clocks,
        *,
        name: str,
        state_file: Path,
        heartbeat_s: float,
        inventory: Callable[[], Inventory | Awaitable[Inventory]],
        states: Callable[[], Mapping[str, DeviceState]],
        memory: Callable[[], dict[str, Any] | Awaitable[dict[str, Any]]],
        save_pause_s: float = 0.1,
        worth_saving: Callable[[list[Observation]], bool] = lambda batch: True,
    ) -> None:
        self._agent, self._clocks, self._name, self._file = agent, clocks, name, state_file
        self._heartbeat_s = heartbeat_s
        self._inventory, self._states, self._memory = inventory, states, memory
        self._save_pause_s, self._worth_saving = save_pause_s, worth_saving
        self._queue: asyncio.Queue[list[Observation]] = asyncio.Queue(_OUTBOX)
        self._told: dict[str, DeviceState] = {}
        self._inventory_at: float | None = None
        self._dirty = asyncio.Event()
        self._kept = True

    def post(self, observations: list[Observation]) -> None:
        if observations:
            try:
                self._queue.put_nowait(observations)
            except asyncio.QueueFull:
                self._lost()

    def inventory_soon(self, after_s: float = _SETTLED_S) -> None:
        """Post what is there now, a little later: what a device tells first when it is back comes before."""
        self._inventory_at = self._clocks.now() + after_s

    def came_back(self, state: DeviceState) -> None:
        """A device is in a new state."""
        if state.state == "connected":
            self.inventory_soon()

    async def work(self) -> None:
        async with asyncio.TaskGroup() as tasks:
            for one in (self._look_after, self._send, self._save):
                tasks.create_task(one())

    async def finish(self) -> None:
        """What is in the queue into the spool, the state on the disk."""
        while not self._queue.empty():
            await self._agent.observations(*self._queue.get_nowait())
        self._keep(await self._remembered())

    async def post_inventory(self) -> None:
        self.post([await _now(self._inventory())])

    async def _look_after(self) -> None:
        while True:
            await sleep_to_the_beat(_LOOK_S)
            for name, state in self._states().items():
                if self._told.get(name) != state:
                    self._told[name] = state
                    await self._agent.device(name, self._clocks.utc(self._clocks.now()), state)
            if self._inventory_at is not None and self._clocks.now() >= self._inventory_at:
                self._inventory_at = None
                await self.post_inventory()

    async def _send(self) -> None:
        while True:
            batch = await self._queue.get()
            if not await self._agent.observations(*batch):
                self._lost()
            if self._worth_saving(batch):
                self._dirty.set()

    async def _save(self) -> None:
        """After every event, and now and then for what is learnt meanwhile."""
        while True:
            with contextlib.suppress(TimeoutError):
                async with asyncio.timeout(_SAVE_S):
                    await self._dirty.wait()
            self._dirty.clear()
            state = await self._remembered()
            await asyncio.to_thread(self._keep, state)
            await asyncio.sleep(self._save_pause_s)

    def _keep(self, state: dict[str, Any]) -> None:
        """On the disk, unless that was too full for the numbers of labels in it: a restart would give them again."""
        if self._agent.remembers:
            self._kept = save_state(self._file, self._name, state, quiet=not self._kept)

    async def _remembered(self) -> dict[str, Any]:
        memory: dict[str, Any] = await _now(self._memory())
        return memory | {"told": self._clocks.told}

    def _lost(self) -> None:
        """An event never reached the spool: say what is there instead, until that is taken."""
        self.inventory_soon(self._heartbeat_s)


def mendable(group: BaseExceptionGroup[BaseException]) -> CommandError | SpoolError | None:
    """Of the errors that ended an agent's tasks, one that a person can mend."""
    for error in group.exceptions:
        found = mendable(error) if isinstance(error, BaseExceptionGroup) else error
        if isinstance(found, CommandError | SpoolError):
            return found
    return None


async def _now(value: Any) -> Any:
    return await value if isinstance(value, Awaitable) else value
