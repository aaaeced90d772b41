"""Where in the room somebody is or went who is not seen: on a seat, where nobody is looked for, or out by a door."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from tms_agents.floor.scan.masks import Area
from tms_agents.floor.settings import Scene
from tms_agents.floor.state import SEATED

#: A seated person's feet vanish so near the seat (m), and those of somebody who goes where nobody is looked for.
_SEAT_M, _MASK_M = 0.45, 0.5
#: Who would be so near (m) a seat as he went sits on it.
_INTO_M = 0.2
#: A foot is where it was seen so long (s) before the last one.
_FOOT_S = 1.5
#: Who is so near (m) is in a door. Of a way out of the room so many places are looked at.
_DOOR_M, _SAMPLES = 0.3, 9


class Whereabouts:
    """What of the ``scene`` matters for who is not seen: ``seats``, ``masks``, ``gates`` and the ``region``."""

    def __init__(self, scene: Scene) -> None:
        self.seats, self.masks, self.gates = Area(scene.seats), Area(scene.masks), Area(scene.gates)
        self.region = Area([] if scene.region is None else [scene.region])

    def seated(self, body: Any) -> bool:
        """Whether the body (`state.BODY`) sits, or its feet were seen last beside a seat."""
        return bool(body["stale"] == SEATED or _nearest(self.seats, body) < _SEAT_M)

    def sits(self, body: Any) -> bool:
        """Whether somebody whose feet are seen no more has sat down: beside a seat, or on his way into one."""
        into = self.seats.distance(float(body["x"]), float(body["y"])) < _INTO_M
        return not body["robot"] and (into or self.seated(body))

    def masked(self, body: Any) -> bool:
        """Whether the body is where nobody is looked for, or was seen last beside that."""
        return min(_nearest(self.masks, body), self.masks.distance(body["x"], body["y"])) < _MASK_M

    def leaves(self, body: Any) -> bool:
        """Whether the body is in a door or past it."""
        return self.through(body) or self.gates.distance(float(body["x"]), float(body["y"])) < _DOOR_M

    def through(self, body: Any) -> bool:
        """Whether the body has gone on out of the room since it was told last: by a door, not through a wall."""
        x, y, dx, dy = (float(body[name]) for name in ("x", "y", "told_x", "told_y"))
        if not self.region.polygons or self.region.distance(x, y) == 0.0:
            return False
        ways = ((dx + u * (x - dx), dy + u * (y - dy)) for u in np.linspace(0.0, 1.0, _SAMPLES))
        out = next((xy for xy in ways if self.region.distance(*xy) > 0.0), (x, y))
        return not self.gates.polygons or self.gates.distance(*out) < _DOOR_M


def _nearest(area: Area, body: Any) -> float:
    """How far (m) from the area a foot was seen at last."""
    feet = [foot for foot in "ab" if body["seen"] - body[f"{foot}_seen"] < _FOOT_S]
    return min((area.distance(body[f"{foot}x"], body[f"{foot}y"]) for foot in feet), default=math.inf)
