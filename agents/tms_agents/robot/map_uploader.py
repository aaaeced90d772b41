"""A growing map goes to the server while it is made: changed tiles, at a modest rate, through outages of the server.

A version holds the whole map, so one that did not get through is made up for by the next one.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from tms_client import Busy, Conflict, ServerFault, Town, TownError, Unreachable
from tms_client.maps.cells import Intensity
from tms_schemas.maps import MapObject, MapVersion

_OUTAGE = (Unreachable, Busy, ServerFault)
_PAUSE_S = 0.5


class Grid(NamedTuple):
    """``occupancy`` (H, W), ``origin`` m is the lower left corner of its first cell; received light, where known."""

    occupancy: npt.NDArray[np.float64]
    origin: tuple[float, float]
    intensity: Intensity | None = None


class MapUploader:
    """``town`` should not retry by itself: here the next offer does. ``say`` is told when the server fails and is back.

    ``versions`` counts those that were made.
    """

    def __init__(
        self,
        town: Town,
        map: str,
        agent: str,
        every_s: float,
        say: Callable[[str], None],
        clock: Callable[[], float] = time.monotonic,
        sleep: Callable[[float], None] = time.sleep,
    ) -> None:
        self._town, self._map, self._agent, self._every_s = town, map, agent, every_s
        self._say, self._clock, self._sleep = say, clock, sleep
        self._due = clock() + every_s
        self._out = False
        self._last = 0
        self.versions = 0

    def offer(self, grid: Callable[[], Grid]) -> None:
        """Sends ``grid()`` where it is time; an outage of the server passes.

        Raises:
            TownError: the server refuses it, or somebody else changed the map.
        """
        if self._clock() < self._due:
            return
        try:
            self._send(grid(), "while driving")
        except _OUTAGE as error:
            self._fails(error)
        self._due = self._clock() + self._every_s

    def send(self, grid: Grid, note: str, objects: Sequence[MapObject]) -> MapVersion | None:
        """Sends it now, with all semi-dynamic objects; None in an outage of the server, which passes.

        Raises:
            TownError: the server refuses it, or somebody else changed the map.
        """
        try:
            return self._send(grid, note, objects)
        except _OUTAGE as error:
            self._fails(error)
            return None

    def finish(
        self,
        grid: Grid,
        patience_s: float,
        note: str = "the whole drive",
        objects: Sequence[MapObject] | None = None,
    ) -> MapVersion:
        """Sends the last state; tried again for so long. ``objects`` None leaves those there are.

        Raises:
            TownError: it did not get through.
        """
        until = self._clock() + patience_s
        while True:
            try:
                return self._send(grid, note, objects)
            except _OUTAGE as error:
                self._fails(error)
                if self._clock() >= until:
                    raise
                self._sleep(_PAUSE_S)

    def _send(self, grid: Grid, note: str, objects: Sequence[MapObject] | None = None) -> MapVersion:
        try:
            made = self._upload(grid, note, objects, None)
        except Conflict:
            # Our own version whose answer was lost is nothing to stop for.
            newest = next(self._town.maps.versions(self._map))
            if newest.agent != self._agent:
                raise
            made = self._upload(grid, note, objects, newest.version)
        self.versions += made.version != self._last
        self._last = made.version
        if self._out:
            self._out = False
            self._say(f"the server is back; map {self._map} is at version {made.version}")
        return made

    def _upload(self, grid: Grid, note: str, objects: Sequence[MapObject] | None, base: int | None) -> MapVersion:
        return self._town.maps.upload(
            self._map, grid.occupancy, grid.origin, agent=self._agent, intensity=grid.intensity, objects=objects,
            note=note, base=base, snap=True,
        )  # fmt: skip

    def _fails(self, error: TownError) -> None:
        if not self._out:
            self._out = True
            self._say(f"map {self._map} waits for the server: {error}")
