"""Where people come in and go out: by the gates that are told, or, where none is, where they were seen to come in."""

from __future__ import annotations

import math
from collections import deque
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tms_agents.floor.scan.edges import from_edge
from tms_agents.floor.scan.masks import Area, distance
from tms_agents.floor.state import pack, unpack

Array = NDArray[np.float64]
Places = deque[tuple[float, float]]

#: So near a gate that is told (m), or where others came, people come; who is lost so near a gate has gone.
_GATE_M, _DOOR_M, _GONE_M = 0.7, 1.0, 0.3
#: So near (m) where one goes out of sight before a gate people come.
_UNSEEN_M = 0.3
#: So near (m) the edge of what is seen somebody may go out of sight; by the way he came if that is so near (m).
_EDGE_M, _WAY_M = 0.5, 1.7
#: Where somebody began to be seen far from every edge of sight feet are hardly seen: so near (m) others go out unseen.
_FAINT_M = 1.0
#: So many comings are remembered, the last ones.
_MOST = 200


class Doors:
    """The ``gates``, and how far from them sight ends; where none is told, the edges of what is seen, and by which of
    them people have come."""

    def __init__(self, gates: Area) -> None:
        self._gates = gates
        #: How far (m) from each gate the lasers begin to see.
        self.unseen_m = [0.0] * len(gates.polygons)
        self._edges = np.zeros((0, 4))
        #: Where people began to be seen: at an edge of sight, and elsewhere, x, y (m).
        self._ways, self._faint = Places(maxlen=_MOST), Places(maxlen=_MOST)

    @property
    def told(self) -> bool:
        """Whether gates are told."""
        return bool(self._gates.polygons)

    @property
    def known(self) -> bool:
        """Whether it is known where somebody can leave."""
        return self.told or bool(self._edges.size)

    def see(self, edges: Array) -> None:
        """These are the edges (k, 4) of what all lasers see (`edges.edges_of_sight`)."""
        self._edges = edges

    def came(self, x: float, y: float, alone: bool) -> None:
        """Somebody new began to be seen at (x, y) m; ``alone``: nobody is out of sight who might be he."""
        if self.told or not self.known:
            return
        if from_edge(self._edges, x, y) < _EDGE_M:
            self._ways.append((x, y))
        elif alone:
            self._faint.append((x, y))

    def keeps(self, body: Any) -> bool:
        """Whether the body (`state.BODY`), of whom nothing is seen any more, was lost where nobody can leave."""
        if self.told:
            return min(self._from_gates(float(body["x"]), float(body["y"]))) > _GONE_M
        foot = "a" if body["a_seen"] > body["b_seen"] else "b"
        return self.known and not self._leads_out(float(body[f"{foot}x"]), float(body[f"{foot}y"]))

    def inside(self, x: float, y: float) -> bool:
        """Whether whoever begins to be seen at (x, y) m has not come in by a door, as far as doors are known."""
        if self.told:
            return self._gates.distance(x, y) >= _GATE_M and min(self._from_gates(x, y)) >= _UNSEEN_M
        return self.known and not self._leads_out(x, y)

    def enters(self, x: float, y: float) -> bool:
        """Whether whoever begins to be seen at (x, y) m has come in by a door that is told or where others came."""
        if self.told:
            return not self.inside(x, y)
        return from_edge(self._edges, x, y) < _EDGE_M and _nearest(self._ways, x, y, math.inf) < _DOOR_M

    def out_of_sight(self, body: Any) -> bool:
        """Whether the body was lost where the way to a gate that is told begins to be out of sight."""
        away = self._from_gates(float(body["x"]), float(body["y"]))
        return any(unseen_m and one <= _GONE_M for one, unseen_m in zip(away, self.unseen_m, strict=True))

    def _from_gates(self, x: float, y: float) -> list[float]:
        """How far (m) it is from each gate that is told, or from where one goes out of sight on the way to it."""
        gates = zip(self._gates.polygons, self.unseen_m, strict=True)
        return [float(distance(gate, x, y)) - unseen_m for gate, unseen_m in gates]

    def _leads_out(self, x: float, y: float) -> bool:
        """Whether one may go out of sight at (x, y) m, and people came there, or nobody came anywhere yet."""
        if from_edge(self._edges, x, y) < _EDGE_M and _nearest(self._ways, x, y, 0.0) < _WAY_M:
            return True
        return _nearest(self._faint, x, y, math.inf) < _FAINT_M

    def save(self) -> dict[str, Any]:
        """JSON values."""
        return {
            "edges": pack(self._edges),
            "unseen_m": self.unseen_m,
            "ways": list(self._ways),
            "faint": list(self._faint),
        }

    def restore(self, saved: Any) -> None:
        """Raises KeyError, TypeError or ValueError where that is nothing that ``save`` gave."""
        edges = saved["edges"]
        unseen_m = [float(one) for one in saved["unseen_m"]]
        if len(unseen_m) == len(self.unseen_m):
            self.unseen_m = unseen_m
        self._edges = unpack(edges, np.zeros((int(edges["shape"][0]), 4)))
        for name, places in (("ways", self._ways), ("faint", self._faint)):
            places.clear()
            places.extend((float(x), float(y)) for x, y in saved[name])


def _nearest(places: Places, x: float, y: float, none: float) -> float:
    """How far (m) from the nearest place; ``none`` where there is none."""
    return min((math.hypot(x - u, y - v) for u, v in places), default=none)
