"""Several scales under one board: each is one cell."""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import AsyncGenerator, Sequence

from tms_agents.devices.loads import LoadSample, LoadSource
from tms_agents.devices.transport import DeviceState

_WORST = ("faulty", "silent", "connected")


class LoadGroup:
    """Listens to all scales or boards at once and delivers their cells side by side, in the order given.

    ``cells`` counts those of each source, default one. A sample is delivered every ``period_s`` seconds in which
    anything arrived. The cells of a scale from which nothing came for ``stale_s`` are NaN, and ``fault`` says so;
    ``stable`` is True only if all that have an opinion say so. The state is the worst of all, and "connected" once all
    are.
    """

    def __init__(
        self,
        sources: Sequence[LoadSource],
        *,
        cells: Sequence[int] | None = None,
        period_s: float = 0.05,
        stale_s: float = 1.0,
    ) -> None:
        self._sources, self._period_s, self._stale_s = tuple(sources), period_s, stale_s
        self._cells = tuple(cells) if cells is not None else (1,) * len(self._sources)
        if len(self._cells) != len(self._sources):
            raise ValueError(f"{len(self._cells)} numbers of cells for {len(self._sources)} scales")
        self._last: list[tuple[float, LoadSample] | None] = [None] * len(self._sources)
        self._states: list[DeviceState | None] = [None] * len(self._sources)
        self._state: DeviceState | None = None
        self._new = False

    async def listen(self) -> AsyncGenerator[Sequence[LoadSample] | DeviceState, None]:
        clock = asyncio.get_running_loop().time
        changed, began = asyncio.Event(), clock()
        listening = [asyncio.create_task(self._hear(i, changed)) for i in range(len(self._sources))]
        for task in listening:
            task.add_done_callback(lambda _: changed.set())
        try:
            while True:
                await changed.wait()
                changed.clear()
                for task in listening:
                    if task.done():
                        task.result()  # a Link ends only by an error, raised here
                        return
                for state in self._worst():
                    yield state
                if self._new and (all(self._last) or clock() - began > self._stale_s):
                    self._new = False
                    yield [self._sample(clock())]
                await asyncio.sleep(self._period_s)
        finally:
            for task in listening:
                task.cancel()
            await asyncio.gather(*listening, return_exceptions=True)

    async def _hear(self, index: int, changed: asyncio.Event) -> None:
        clock = asyncio.get_running_loop().time
        async with contextlib.aclosing(self._sources[index].listen()) as items:
            async for item in items:
                if isinstance(item, DeviceState):
                    self._states[index] = item
                elif item:
                    self._last[index] = clock(), item[-1]
                    self._new = True
                changed.set()

    def _worst(self) -> list[DeviceState]:
        known = [state for state in self._states if state is not None]
        if len(known) < len(self._states) and all(state.state == "connected" for state in known):
            return []
        worst = min(known, key=lambda state: _WORST.index(state.state))
        if worst == self._state:
            return []
        self._state = worst
        return [worst]

    def _sample(self, now: float) -> LoadSample:
        values: list[float] = []
        faults, opinions = [], []
        for index, last in enumerate(self._last):
            at, sample = last or (float("-inf"), LoadSample(values=()))
            if now - at > self._stale_s or len(sample.values) != self._cells[index]:
                values += [float("nan")] * self._cells[index]
                faults.append(f"scale {index + 1}: nothing for {self._stale_s:g} s")
                continue
            values += sample.values
            opinions += [sample.stable] if sample.stable is not None else []
            faults += [f"scale {index + 1}: {sample.fault}"] if sample.fault else []
        return LoadSample(values=tuple(values), stable=all(opinions) if opinions else None, fault="; ".join(faults))
