"""How far all lasers of a room see of it when it is empty: where sight ends, and how far before a gate."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from tms_agents.floor.movers.doors import Doors
from tms_agents.floor.scan.edges import beams, edges_of_sight, from_edge, looks_past
from tms_agents.floor.scan.masks import Area
from tms_agents.floor.scan.view import View
from tms_agents.floor.settings import Polygon, Scene

Array = NDArray[np.float64]

#: So often (s) it is looked where sight ends, and how far from the gates.
_LOOKS_S, _GATES_S = 2.0, 10.0
#: A gate is in sight if a beam is so near (m) a place of it, and such places are so far (m) from each other.
_NEAR_M, _APART_M = 0.1, 0.1


class Coverage:
    """Tells the ``doors`` of the ``scene`` what the lasers see."""

    def __init__(self, scene: Scene, doors: Doors) -> None:
        self._doors = doors
        region = Area([] if scene.region is None else [scene.region])
        self._gates = [_on_the_floor(gate, region) for gate in scene.gates]

    def look(self, views: Sequence[View], t: float, dt: float) -> None:
        """The scan at t came ``dt`` s after the last one of its laser."""
        every_s = _GATES_S if self._doors.told else _LOOKS_S
        # One laser that is covered, or begins late, keeps nobody from knowing what the others see.
        views = [view for view in views if view.background.learned]
        if t // every_s == (t - dt) // every_s or not views:
            return
        if self._doors.told:
            seen = np.concatenate([beams(*view.reach) for view in views])
            self._doors.unseen_m = [_unseen_m(places, seen) for places in self._gates]
        else:
            self._doors.see(np.concatenate(list(_edges(views))))


def _edges(views: Sequence[View]) -> Iterator[Array]:
    """Where sight ends of each laser, and no other one looks past."""
    for view in views:
        mine = edges_of_sight(*view.reach)
        for other in views:
            mine = mine if other is view else mine[~looks_past(mine, *other.reach)]
        yield mine


def _unseen_m(places: Array, seen: Array) -> float:
    """How far (m) from the ``places`` (k, 2) of a gate the nearest of the beams ``seen`` (n, 4) is; there: 0."""
    away = min((from_edge(seen, x, y) for x, y in places), default=0.0)
    return away if away > _NEAR_M else 0.0


def _on_the_floor(gate: Polygon, region: Area) -> Array:
    """Places (k, 2) of the gate that are in the room, where its walls are told: behind them nothing is seen."""
    corners, this = np.asarray(gate, dtype=float), Area([gate])
    low, high = corners.min(axis=0), corners.max(axis=0)
    grid = [np.arange(a, b + 1e-9, _APART_M) for a, b in zip(low, high, strict=True)]
    places = [(x, y) for x in grid[0] for y in grid[1] if this.distance(x, y) == 0.0]
    inside = [xy for xy in places if not region.polygons or region.distance(*xy) == 0.0]
    return np.array(inside).reshape(-1, 2)
