"""The cabinet agent at work: boards and readers in, observations into the spool, the spool to the server."""

from __future__ import annotations

import asyncio
import contextlib
import time
from collections.abc import Callable, Mapping

from tms_agents.cabinet.calibration_file import BoardCalibration
from tms_agents.cabinet.config import CabinetConfig
from tms_agents.cabinet.core import Cabinet
from tms_agents.cabinet.listening import listen_to_board, listen_to_reader, tick
from tms_agents.cabinet.view import view_of
from tms_agents.cabinet.weights import Weights, weights_path
from tms_agents.clocks import Clocks
from tms_agents.live import serve_view, socket_path
from tms_agents.outbox import Outbox, mendable
from tms_agents.running import Posted, Running, running
from tms_agents.state import load_state, state_path
from tms_client.cli import CommandError
from tms_schemas.observation import Observation


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
        clocks = Clocks.resumed(saved, clock, even)
        cabinet = Cabinet(config, calibrations, clocks, agent.new_label, saved)
        work = _Work(config, cabinet, agent, clocks)
        try:
            await work.forever()
        except ExceptionGroup as group:
            raise mendable(group) or group from None
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
    """The tasks of one run."""

    def __init__(self, config: CabinetConfig, cabinet: Cabinet, agent: Running, clocks: Clocks) -> None:
        self._config, self._cabinet, self._clocks = config, cabinet, clocks
        self._weights = Weights(agent.town, config.room, config.weights, weights_path(config.spool.path))
        self._outbox = Outbox(
            agent,
            clocks,
            name=config.agent,
            state_file=state_path(config.spool.path),
            heartbeat_s=config.heartbeat_s,
            inventory=cabinet.inventory,
            states=cabinet.states,
            memory=cabinet.to_dict,
        )

    async def forever(self) -> None:
        self._cabinet.know(self._weights.load_copy())
        await self._outbox.post_inventory()
        async with asyncio.TaskGroup() as tasks:
            for board in self._config.boards:
                tasks.create_task(listen_to_board(self._cabinet, board, self._found, self._outbox.came_back))
            for reader in self._config.readers:
                tasks.create_task(listen_to_reader(self._cabinet, reader, self._found))
            if self._cabinet.ticks:
                tasks.create_task(tick(self._cabinet, self._found))
            for work in (self._outbox.work, self._learn_weights):
                tasks.create_task(work())
            tasks.create_task(
                serve_view(socket_path(self._config.spool.path), lambda: view_of(self._cabinet, self._clocks, "agent"))
            )

    async def finish(self) -> None:
        await self._outbox.finish()

    async def _learn_weights(self) -> None:
        async with contextlib.aclosing(self._weights.changes()) as changes:
            async for changed in changes:
                self._cabinet.know(changed)

    def _found(self, observations: list[Observation], tags: set[str]) -> None:
        for tag in tags:
            self._weights.want(tag)
        self._outbox.post(observations)
