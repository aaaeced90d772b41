"""Our estimator and the laboratory's algorithm behind one face: samples and rounds in, detections out."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal, Protocol

import numpy as np
from laboratory import LaboratoryCabinet
from numpy.typing import NDArray

from tms_agents.cabinet import CabinetEstimator, CabinetEvent, Geometry, KnownWeight, Zone
from tms_agents.cabinet.events import Appeared, Identified, LoadChanged, Moved, Vanished
from tms_agents.simulation.board import BoardWorld
from tms_agents.simulation.board_tags import ZoneBox

Xy = tuple[float, float]
Kind = Literal["in", "out", "move", "identified", "unpinned"]


@dataclass(frozen=True, kw_only=True, slots=True)
class Detection:
    """What a contestant said, and when (``at``: time of the sample or round that made it speak)."""

    kind: Kind
    at: float
    stay: str
    xy: Xy | None = None
    cov: tuple[float, float, float] | None = None  # what it says of its own error: var_x, cov_xy, var_y
    tag: str | None = None
    group: tuple[str, ...] = ()  # "unpinned": stays that share one load in unknown parts


class Contestant(Protocol):
    #: Its stays are named after tags.
    by_tag: bool
    #: Its program asks the board at an even pace.
    even: bool

    def __init__(self, world: BoardWorld, known: dict[str, KnownWeight]) -> None: ...

    def load(self, t: float, grams: NDArray[np.float64]) -> list[Detection]: ...

    def inventory(self, t: float, zone: str, tags: frozenset[str]) -> list[Detection]: ...

    def standing(self) -> dict[str, tuple[Xy, str | None]]:
        """What it holds to be on the board by now: position and tag of each stay."""


class Ours:
    by_tag, even = False, False

    def __init__(self, world: BoardWorld, known: dict[str, KnownWeight]) -> None:
        board = world.parameters
        zones = {box.name: Zone(box.name, _polygon(box, board.width, board.depth)) for box in board.tags.zones}
        self._estimator = CabinetEstimator(Geometry(board.cells, board.width, board.depth), known=known, zones=zones)

    def load(self, t: float, grams: NDArray[np.float64]) -> list[Detection]:
        events = self._estimator.load(t, grams)
        return _detections(t, events) if events else []

    def inventory(self, t: float, zone: str, tags: frozenset[str]) -> list[Detection]:
        return _detections(t, self._estimator.inventory(t, zone, tags))

    def standing(self) -> dict[str, tuple[Xy, str | None]]:
        return {str(one.id): (one.xy, one.tag) for one in self._estimator.stays()}


class Laboratory:
    by_tag, even = True, True

    def __init__(self, world: BoardWorld, known: dict[str, KnownWeight]) -> None:
        self._cabinet = LaboratoryCabinet(world.parameters.cells)
        self._xy: dict[str, Xy] = {}

    def load(self, t: float, grams: NDArray[np.float64]) -> list[Detection]:
        said = []
        for told in self._cabinet.load(t, grams):
            if told.xy is not None:
                self._xy[told.tag] = told.xy
            said.append(Detection(kind=told.kind, at=t, stay=told.tag, xy=told.xy))
            if told.kind == "in":
                said.append(Detection(kind="identified", at=t, stay=told.tag, tag=told.tag))
        return said

    def inventory(self, t: float, zone: str, tags: frozenset[str]) -> list[Detection]:
        self._cabinet.inventory(tags)
        return []

    def standing(self) -> dict[str, tuple[Xy, str | None]]:
        """Each thing where its own last event was; the published program showed all at the last event of any."""
        return {tag: (self._xy[tag], tag) for tag in self._cabinet.inside}


def _detections(at: float, events: list[CabinetEvent]) -> list[Detection]:
    said = []
    for event in events:
        match event:
            case Appeared():
                said.append(Detection(kind="in", at=at, stay=str(event.stay), xy=event.xy, cov=event.cov))
            case Vanished():
                said.append(Detection(kind="out", at=at, stay=str(event.stay)))
            case Moved():
                said.append(Detection(kind="move", at=at, stay=str(event.stay), xy=event.xy))
            case Identified():
                said.append(Detection(kind="identified", at=at, stay=str(event.stay), tag=event.tag))
            case LoadChanged():
                said.append(Detection(kind="unpinned", at=at, stay="", group=tuple(map(str, event.stays))))
    return said


def _polygon(box: ZoneBox, width: float, depth: float) -> tuple[Xy, ...] | None:
    if not any(math.isfinite(value) for value in (*box.low, *box.high)):
        return None
    x0, y0 = max(box.low[0], 0.0), max(box.low[1], 0.0)
    x1, y1 = min(box.high[0], width), min(box.high[1], depth)
    return ((x0, y0), (x1, y0), (x1, y1), (x0, y1))
