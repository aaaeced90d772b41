"""From the devices into a ``Cabinet``: one task per board and reader, for the agent and for whoever only watches."""

from __future__ import annotations

import contextlib
from collections.abc import Callable

from tms_agents.cabinet.config import BoardSection, ReaderSection
from tms_agents.cabinet.core import Cabinet
from tms_agents.cabinet.sources import open_loads
from tms_agents.devices.beat import sleep_to_the_beat
from tms_agents.devices.transport import DeviceState, Link
from tms_agents.readers import Seen, open_reader
from tms_schemas.observation import Observation

#: Takes observations, and tags that came into view.
Found = Callable[[list[Observation], set[str]], None]
_TICK_S = 0.1


async def listen_to_board(
    cabinet: Cabinet,
    board: BoardSection,
    found: Found = lambda observations, tags: None,
    changed: Callable[[DeviceState], None] = lambda state: None,
) -> None:
    source = open_loads(board.load, cabinet.config.silent_after_s)
    async with contextlib.aclosing(source.listen()) as items:
        async for item in items:
            if isinstance(item, DeviceState):
                cabinet.board_line(board.name, item)
                changed(item)
            else:
                found(cabinet.samples(board.name, item), set())
                if isinstance(source, Link):
                    source.gather_s = cabinet.patience_s(board.name)


async def listen_to_reader(
    cabinet: Cabinet, reader: ReaderSection, found: Found = lambda observations, tags: None
) -> None:
    field = cabinet.readers[reader.name].field
    arrivals = open_reader(reader.source, silent_after_s=reader.silent_after_s, field=field)
    async with contextlib.aclosing(arrivals):
        async for _, item in arrivals:
            if isinstance(item, DeviceState):
                cabinet.reader_line(reader.name, item)
            else:
                found(*cabinet.reads(reader.name, [one.read if isinstance(one, Seen) else one for one in item]))


async def tick(cabinet: Cabinet, found: Found = lambda observations, tags: None) -> None:
    while True:
        await sleep_to_the_beat(_TICK_S)
        found(*cabinet.tick())
