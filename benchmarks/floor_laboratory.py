"""The laboratory's floor sensing as it was published (ROS-TMS, 2012): the yardstick for ours, with its defects.

Background: the maximum of each beam over the first 50 scans, never updated, 0 where nothing echoed. Foreground: 100 mm
nearer. Clusters break at chord + 35 mm and need 4 beams. What rests for more than 5 s is an object; what rests for 0.2
to 5 s is a footprint, and footprints at most a step apart are a person. Clusters that something nearer hides are kept.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Pose = tuple[float, float, float]

BACKGROUND_SCANS = 50
NEARER_M, BREAK_M, BEAMS = 0.1, 0.035, 4
STEEP = math.radians(80)
SAME_M, STEP_M = 0.15, 0.8
PRINT_S, OBJECT_S, FORGET_S = 0.2, 5.0, 2.0
HIDDEN_M = 0.05


@dataclass(slots=True)
class Cluster:
    """Something that rests. ``person`` is the number of the walker whose footprint it is."""

    number: int
    xy: Floats
    since: float
    seen: float
    person: int | None = None

    def age(self) -> float:
        return self.seen - self.since


class LaboratoryFloor:
    """One laser: ``angles`` (n,) at ``pose`` in the room."""

    def __init__(self, angles: Floats, pose: Pose) -> None:
        bearings = np.asarray(angles) + pose[2]
        self._rays = np.stack([np.cos(bearings), np.sin(bearings)], axis=1)
        self._first, self._heading = float(angles[0]), pose[2]
        self._step = float(angles[1] - angles[0])
        self._at = np.array(pose[:2])
        self._background = np.zeros(len(angles))
        self._scans = 0
        self._clusters: list[Cluster] = []
        self._people: dict[int, list[tuple[float, Floats]]] = {}
        self._number = 0

    def scan(self, t: float, ranges: Floats) -> None:
        """Take a sweep: +inf or NaN where nothing was measured."""
        ranges = np.where(np.isfinite(ranges), ranges, 0.0)
        if self._scans < BACKGROUND_SCANS:
            self._scans += 1
            self._background = np.maximum(self._background, ranges)
            return
        points = self._segmented(ranges)
        fresh = []
        for xy in points:
            near = [one for one in self._clusters if math.dist(one.xy, xy) < SAME_M and one.seen < t]
            if near:
                one = min(near, key=lambda one: math.dist(one.xy, xy))
                one.xy, one.seen = 0.8 * one.xy + 0.2 * xy, t
            else:
                self._number += 1
                fresh.append(Cluster(self._number, xy, t, t))
        self._clusters = [
            one
            for one in self._clusters
            if t - one.seen < 0.5 or (one.age() > OBJECT_S and self._hidden(one.xy, ranges))
        ] + fresh
        for one in self._clusters:
            if one.person is None and one.seen == t and one.age() >= PRINT_S:
                self._step_of(one, t)
        self._people = {number: prints for number, prints in self._people.items() if t - prints[-1][0] < FORGET_S}

    def labels(self) -> list[dict[str, Any]]:
        """As a prediction has them."""
        things = [one for one in self._clusters if one.age() > OBJECT_S]
        found = [{"id": one.number, "attr": "object", "x": one.xy[0], "y": one.xy[1]} for one in things]
        for number, prints in self._people.items():
            x, y = np.mean([xy for _, xy in prints[-2:]], axis=0)
            found.append({"id": f"p{number}", "attr": "mover", "x": x, "y": y})
        return found

    def _segmented(self, ranges: Floats) -> list[Floats]:
        """Centres of the clusters of foreground beams, room frame."""
        beams = np.flatnonzero((ranges > 0) & (ranges + NEARER_M < self._background))
        if not len(beams):
            return []
        r = ranges[beams]
        far = np.abs(np.diff(r)) > self._step * np.minimum(r[1:], r[:-1]) + BREAK_M
        groups = np.split(beams, np.flatnonzero(far | (np.diff(beams) > 1)) + 1)
        centres = []
        for group in groups:
            if len(group) < BEAMS:
                continue
            slope = np.abs(np.gradient(ranges[group])) / (self._step * ranges[group])
            kept = group[np.arctan(slope) < STEEP]
            if len(kept):
                centres.append(self._at + (ranges[kept, None] * self._rays[kept]).mean(axis=0))
        return centres

    def _hidden(self, xy: Floats, ranges: Floats) -> bool:
        """Something stands in the line of sight."""
        x, y = xy - self._at
        beam = round((math.remainder(math.atan2(y, x) - self._heading, 2 * math.pi) - self._first) / self._step)
        return 0 <= beam < len(ranges) and bool(0 < ranges[beam] < math.hypot(x, y) - HIDDEN_M)

    def _step_of(self, one: Cluster, t: float) -> None:
        """Whose footprint it is: of who stood last within a step, else of somebody new."""
        near = [
            (number, prints) for number, prints in self._people.items() if math.dist(prints[-1][1], one.xy) < STEP_M
        ]
        if near:
            one.person = min(near, key=lambda item: math.dist(item[1][-1][1], one.xy))[0]
        else:
            self._number += 1
            one.person = self._number
        self._people.setdefault(one.person, []).append((t, one.xy))
