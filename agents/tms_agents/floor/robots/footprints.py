"""Robots of known size: each is followed by its outline, so that no part of it is a foot and no foot a part of it.

What is wide may be a robot: a candidate is fitted scan by scan, and is one when it has come in by a door, or gone a way
by itself, and always looked like one. From then on what lies on its outline is its own before anybody else is looked
for, and where it goes it is not found by whose feet fit, but by its outline.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from tms_agents.floor.association.association import Association
from tms_agents.floor.robots.pursuit import SAME_M, bodiless, goes, is_near, own, pursue, wide
from tms_agents.floor.robots.sizes import RobotSizes
from tms_agents.floor.scan.furniture import Furniture, Piece
from tms_agents.floor.scan.masks import Area
from tms_agents.floor.scan.outline import search
from tms_agents.floor.scan.view import View
from tms_agents.floor.state import FOOTPRINT, empty, free_slot, pack, unpack

#: As many as there can be at once; so many directions are tried, and so well one must fit; a candidate is so wide
#: (share) at least as the narrowest robot.
_MOST, _YAWS, _FOUND, _PART = 16, 12, 0.85, 0.7
#: It is a robot that began so near a door (m), or has gone so far (m) with nobody beside it.
_DOOR_M, _BY_ITSELF_M = 0.7, 1.0
#: What is so wide (share of scans) is no person.
_BROAD = 0.3


class Footprints:
    """``robots``: (width, length) m of those there are; where none is told sizes are learned (`sizes`).

    ``gates``: where they come in. The bodies of ``association`` go where their footprints are.
    """

    def __init__(self, robots: Sequence[tuple[float, float]], gates: Area, association: Association) -> None:
        self._sizes = sorted({(0.5 * max(size), 0.5 * min(size)) for size in robots})
        self._learned = None if self._sizes else RobotSizes()
        self._gates, self._association = gates, association
        self._all, self._spare = empty(FOOTPRINT, _MOST), empty(FOOTPRINT, 1)
        self._order, self._seen = np.zeros(_MOST, np.int64), np.zeros(_MOST, np.bool_)
        self._at, self._how = np.zeros(3), np.zeros(6)

    def step(self, view: View, clusters: Any, t: float, pieces: Callable[[], list[Piece]]) -> int:
        """Follow all robots in a scan; what is theirs is taken out of ``clusters`` (m,): how many are left.

        ``pieces`` tells which pieces of the background have gone.
        """
        m = int(clusters.size)
        scan: Any = (view.ranges, view.background.states, view.rays, view.pose, view.first, view.step)
        bodies, scratch = self._association.bodies, (self._at, self._how)
        if self._learned is not None:
            self._learned.look(bodies, clusters, scan, t)
            self._sizes = self._learned.known
        if not self._sizes:
            return m
        count = pursue(self._all, self._spare, bodies, t, self._order, self._seen, *scratch, *scan)
        if count:
            self._recognize(pieces, t)
            room: Any = (self._association.hypotheses, t, view.claimed, self._at, view.ranges, view.rays, view.pose)
            m = int(own(self._all, self._order[:count], self._seen, clusters, *room))
        k, least_m = -1, 2.0 * _PART * min(half for _, half in self._sizes)
        while (k := wide(clusters[:m], k + 1, self._all, least_m, t)) < m:
            self._begin(clusters[k], scan, t)
        return m

    def _recognize(self, pieces: Callable[[], list[Piece]], t: float) -> None:
        """Who goes like a robot is one; but what was in the room may be furniture that somebody pushes, behind it."""
        waits = self._seen.copy()
        while (index := goes(self._all, waits)) >= 0:
            waits[index] = False
            q = self._all[index]
            came = self._gates.distance(float(q["x0"]), float(q["y0"])) < _DOOR_M
            if (came or q["alone"] > _BY_ITSELF_M) and not Furniture.was(q, 2.0 * float(q["a"]), pieces()):
                q["sure"] = 1
                # What else might be a robot at this place is none.
                near = np.hypot(self._all["x"] - q["x"], self._all["y"] - q["y"]) < SAME_M
                self._all["used"][near & (self._all["sure"] == 0)] = 0
        index = -1
        while (index := bodiless(self._all, self._seen, index + 1)) >= 0:
            q = self._all[index]
            q["body"] = self._association.robot(self._body(q), q, index + 1, t)

    def _body(self, q: Any) -> int:
        """The mover that is there and may be this robot, -1: none."""
        bodies = self._association.bodies
        broad = (bodies["robot"] == 1) | (bodies["wide"] > _BROAD)
        free = (bodies["used"] == 1) & (bodies["confirmed"] == 1) & broad & (bodies["footprint"] == 0)
        away = np.where(free, np.hypot(bodies["x"] - q["x"], bodies["y"] - q["y"]), np.inf)
        return int(away.argmin()) if away.min() < SAME_M else -1

    def _begin(self, c: Any, scan: Any, t: float) -> None:
        """Begin a candidate at the cluster, if it looks like a robot."""
        index = free_slot(self._all)
        best, found = 0.0, (0.0, 0.0, 0.0, 0.0, 0.0)
        for a, b in self._sizes if index >= 0 else ():
            self._at[:] = c["x"], c["y"], 0.0
            value = search(self._at, a, b, _YAWS, self._how, *scan)
            if value >= _FOUND and value > best and not is_near(self._all, self._at[0], self._at[1], t):
                best, found = value, (float(self._at[0]), float(self._at[1]), float(self._at[2]), a, b)
        if best > 0.0:
            q = self._all[index]
            q["x"], q["y"], q["yaw"], q["a"], q["b"] = found
            q["x0"], q["y0"], q["fits"] = q["x"], q["y"], 1.0
            q["used"], q["sure"], q["body"], q["hits"], q["going"] = 1, 0, -1, 1, 0
            q["first"] = q["seen"] = q["at"] = t
            q["vx"] = q["vy"] = q["pushed"] = q["alone"] = 0.0

    def save(self) -> dict[str, Any]:
        """JSON values."""
        return {"all": pack(self._all), "learned": None if self._learned is None else self._learned.save()}

    def restore(self, saved: Any) -> None:
        """Raises KeyError, TypeError or ValueError where that is nothing that ``save`` gave."""
        self._all[:] = unpack(saved["all"], self._all)
        if self._learned is not None:
            self._learned.restore(saved["learned"])
