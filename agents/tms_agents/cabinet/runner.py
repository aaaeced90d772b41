"""The cabinet agent at work: boards and readers in, observations into the spool, the spool to the server."""

from __future__ import annotations

import asyncio
import contextlib
import logging
import time
from collections.abc import Callable, Mapping

from tms_agents.cabinet.calibration_file import BoardCalibration
from tms_agents.cabinet.clocks import Clocks
from tms_agents.cabinet.config import CabinetConfig
from tms_agents.cabinet.core import Cabinet
from tms_agents.cabinet.listening import listen_to_board, listen_to_reader, tick
from tms_agents.cabinet.live import serve_view, socket_path
from tms_agents.cabinet.state import load_state, save_state, state_path
from tms_agents.cabinet.view import view_of
from tms_agents.cabinet.weights import Weights, weights_path
from tms_agents.devices.beat import sleep_to_the_beat
from tms_agents.devices.transport import DeviceState
from tms_agents.running import Posted, Running, running
from tms_client.cli import CommandError
from tms_client.errors import SpoolError
from tms_schemas.observation import Observation

log = logging.getLogger(__name__)
_LOOK_S = 0.2
#: Between two times that the state is saved.
_SAVE_PAUSE_S = 0.1
#: After a device came back, what changed meanwhile has been told by then.
_SETTLED_S = 2.0
_SAVE_S = 60.0
_OUTBOX = 1000


async def run(
    config: CabinetConfig,
    calibrations: Mapping[str, BoardCalibration],
    *,
    drain_s: float,
    clock: Callable[[], float] = time.time,
    even: Callable[[], float] = time.monotonic,
) -> Posted:
    """Work until the task is cancelled, then post what waits for at most ``drain_s`` seconds.

    ``clock`` gives Unix time, ``even`` seconds that never jump.

    Raises:
        CommandError: a board of raw counts has no calibration, or a device needs an extra that is not installed.
        SpoolError: the spool cannot be opened or written.
    """
    require_calibration(config, calibrations)
    posted = Posted()
    async with running(config, drain_s=drain_s, heartbeat_s=config.heartbeat_s, posted=posted, clock=clock) as agent:
        saved = load_state(state_path(config.spool.path), config.agent)
        clocks = Clocks(clock, even, after=float(saved.get("t", "-inf")))
        cabinet = Cabinet(config, calibrations, clocks, agent.new_label, saved)
        work = _Work(config, cabinet, agent, clocks)
        try:
            await work.forever()
        except ExceptionGroup as group:
            for error in group.exceptions:
                if isinstance(error, CommandError | SpoolError):  # something that a person can mend
                    raise error from None
            raise
        finally:
            await work.finish()
    return posted


def require_calibration(config: CabinetConfig, calibrations: Mapping[str, BoardCalibration]) -> None:
    """Raises CommandError naming the board that cannot weigh without."""
    for board in config.boards:
        found = calibrations.get(board.name)
        if found is None and not all(one.filtered for one in board.load):
            raise CommandError(f"board {board.name!r} has no calibration: run tms cabinet calibrate first")
        if found is not None and len(found.gain) != board.cell_count:
            raise CommandError(
                f"the calibration of board {board.name!r} is for {len(found.gain)} cells, the board has "
                f"{board.cell_count}: calibrate again"
            )


class _Work:
    """The tasks of one run. Everything that is posted goes through one queue, so that its order is that of events."""

    def __init__(self, config: CabinetConfig, cabinet: Cabinet, agent: Running, clocks: Clocks) -> None:
        self._config, self._cabinet, self._agent, self._clocks = config, cabinet, agent, clocks
        self._weights = Weights(agent.town, config.room, config.weights, weights_path(config.spool.path))
        self._outbox: asyncio.Queue[list[Observation]] = asyncio.Queue(_OUTBOX)
        self._told: dict[str, DeviceState] = {}
        self._inventory_at: float | None = None
        self._dirty = asyncio.Event()

    async def forever(self) -> None:
        self._cabinet.know(self._weights.load_copy())
        self._post([self._cabinet.inventory()])
        async with asyncio.TaskGroup() as tasks:
            for board in self._config.boards:
                tasks.create_task(listen_to_board(self._cabinet, board, self._found, self._came_back))
            for reader in self._config.readers:
                tasks.create_task(listen_to_reader(self._cabinet, reader, self._found))
            tasks.create_task(tick(self._cabinet, self._found))
            for work in (self._look_after, self._learn_weights, self._send, self._save):
                tasks.create_task(work())
            tasks.create_task(
                serve_view(socket_path(self._config.spool.path), lambda: view_of(self._cabinet, self._clocks, "agent"))
            )

    async def finish(self) -> None:
        """What is in the queue into the spool, the state on the disk."""
        while not self._outbox.empty():
            await self._agent.observations(*self._outbox.get_nowait())
        self._save_now()

    async def _look_after(self) -> None:
        while True:
            await sleep_to_the_beat(_LOOK_S)
            await self._tell_states()
            if self._inventory_at is not None and self._clocks.now() >= self._inventory_at:
                self._inventory_at = None
                self._post([self._cabinet.inventory()])

    async def _tell_states(self) -> None:
        for name, state in self._cabinet.states().items():
            if self._told.get(name) != state:
                self._told[name] = state
                await self._agent.device(name, self._clocks.utc(self._clocks.now()), state)

    async def _learn_weights(self) -> None:
        async with contextlib.aclosing(self._weights.changes()) as changes:
            async for changed in changes:
                self._cabinet.know(changed)

    async def _send(self) -> None:
        while True:
            batch = await self._outbox.get()
            if not await self._agent.observations(*batch):
                self._lost()
            self._dirty.set()

    async def _save(self) -> None:
        """After every event, and now and then for what is learnt meanwhile."""
        while True:
            with contextlib.suppress(TimeoutError):
                async with asyncio.timeout(_SAVE_S):
                    await self._dirty.wait()
            self._dirty.clear()
            state = self._cabinet.to_dict()
            await asyncio.to_thread(save_state, state_path(self._config.spool.path), self._config.agent, state)
            await asyncio.sleep(_SAVE_PAUSE_S)

    def _save_now(self) -> None:
        save_state(state_path(self._config.spool.path), self._config.agent, self._cabinet.to_dict())

    def _came_back(self, state: DeviceState) -> None:
        if state.state == "connected":
            self._inventory_at = self._clocks.now() + _SETTLED_S

    def _found(self, observations: list[Observation], tags: set[str]) -> None:
        for tag in tags:
            self._weights.want(tag)
        self._post(observations)

    def _post(self, observations: list[Observation]) -> None:
        if observations:
            try:
                self._outbox.put_nowait(observations)
            except asyncio.QueueFull:
                self._lost()

    def _lost(self) -> None:
        """An event never reached the spool: say what is there instead, until that is taken."""
        self._inventory_at = self._clocks.now() + self._config.heartbeat_s
