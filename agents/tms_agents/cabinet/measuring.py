"""Counts of a board that is at rest: what calibration measures, and how it knows that something was put down."""

from __future__ import annotations

import asyncio
import contextlib
from collections import deque
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tms_agents.devices.loads import LoadSample, LoadSource
from tms_agents.devices.transport import DeviceState
from tms_client.cli import CommandError

Floats = NDArray[np.float64]
#: Rest: the means of the halves of the window differ by less than so many of their standard deviations.
_REST = 4.0
#: A load is another one where a cell's mean differs by so many standard deviations of a sample.
_OTHER = 5.0
#: Devices that show few digits differ by this at rest.
_QUANTUM = 1.0


@dataclass(frozen=True, slots=True)
class AtRest:
    """Mean and standard deviation of one sample of every cell, (k,), over ``samples`` samples."""

    mean: Floats
    noise: Floats
    samples: int


class Measuring:
    """Listens to one board while somebody puts weights on it; use ``async with``."""

    def __init__(self, source: LoadSource, cells: int, *, window_s: float = 1.0, timeout_s: float = 120.0) -> None:
        self._source, self._cells, self._window_s, self._timeout_s = source, cells, window_s, timeout_s
        self._window: deque[tuple[float, tuple[float, ...]]] = deque(maxlen=100_000)
        self._trouble = "nothing heard from it yet"

    async def __aenter__(self) -> Measuring:
        self._listening = asyncio.create_task(self._listen())
        return self

    async def __aexit__(self, *_: object) -> None:
        self._listening.cancel()
        await asyncio.gather(self._listening, return_exceptions=True)

    async def rest(self, other_than: tuple[AtRest, ...] = (), *, noise: Floats | None = None) -> AtRest:
        """The load once it is at rest, measured from now on; another one than those of ``other_than``.

        ``noise`` is what it was at rest before: with much more, somebody's hand is still there.

        Raises:
            CommandError: that does not come in time, with what is wrong.
        """
        clock = asyncio.get_running_loop().time
        began = clock()
        while clock() - began < self._timeout_s:
            await asyncio.sleep(min(0.05, self._window_s / 4))
            if self._listening.done():
                self._listening.result()
            found = self._at_rest(began)
            calm = found is not None and (noise is None or bool((found.noise <= 3 * noise + _QUANTUM).all()))
            if found is not None and calm and all(_differs(found, one) for one in other_than):
                return found
        raise CommandError(f"no load at rest within {self._timeout_s:g} s: {self._why()}")

    async def _listen(self) -> None:
        clock = asyncio.get_running_loop().time
        async with contextlib.aclosing(self._source.listen()) as items:
            async for item in items:
                if isinstance(item, DeviceState):
                    self._trouble = "" if item.state == "connected" else item.why
                    if self._trouble:
                        self._window.clear()
                    continue
                for sample in item:
                    self._take(clock(), sample)

    def _take(self, now: float, sample: LoadSample) -> None:
        if len(sample.values) == self._cells:
            self._window.append((now, sample.values))
            if sample.fault:
                self._trouble = sample.fault
        while self._window and now - self._window[0][0] > self._window_s:
            self._window.popleft()

    def _at_rest(self, since: float) -> AtRest | None:
        values = np.array([values for at, values in self._window if at >= since])
        if len(values) < 6 or self._window[-1][0] - max(self._window[0][0], since) < 0.8 * self._window_s:
            return None
        if not np.isfinite(values).all():
            # A cell without values is for the solver to name, as long as the others rest.
            values = np.where(np.isfinite(values), values, 0.0)
            dead = ~np.isfinite(np.array([one for _, one in self._window])).all(axis=0)
        else:
            dead = np.zeros(values.shape[1], dtype=bool)
        half = len(values) // 2
        noise = values.std(axis=0, ddof=1)
        apart = np.abs(values[:half].mean(axis=0) - values[-half:].mean(axis=0))
        if (apart > _REST * noise * np.sqrt(2 / half) + 1e-6).any():
            return None
        mean = values.mean(axis=0)
        mean[dead] = np.nan
        return AtRest(mean, noise, len(values))

    def _why(self) -> str:
        return self._trouble or "it never came to rest, or nothing was put down"


def _differs(a: AtRest, b: AtRest) -> bool:
    noise = np.maximum(np.maximum(a.noise, b.noise), 1e-6)
    with np.errstate(invalid="ignore"):
        return bool((np.abs(a.mean - b.mean) > _OTHER * noise).any())
