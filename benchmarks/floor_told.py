"""An estimator that is told whose each foot was, after it has said what it would cost to be whose.

So every decision can be judged with a right past, not with what follows from the mistake before.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple, Self
from unittest.mock import patch

import numpy as np
from floor_contestants import Ours
from numpy.typing import NDArray

from tms_agents.floor.association.adopting import adopt, complete
from tms_agents.floor.association.assignment import assign
from tms_agents.floor.association.association import Association
from tms_agents.floor.feet.bodies import predict
from tms_agents.floor.feet.brightness import scatter
from tms_agents.floor.feet.clutter import costs, known
from tms_agents.floor.feet.one_foot import UNLIKELY
from tms_agents.floor.scan.clustered import ClusteredScan
from tms_agents.floor.settings import Polygon
from tms_agents.simulation.floor_world import LASERS, FloorWorld

#: Who begins to be followed so near (m) somebody is he.
_HIS_M = 0.6


class Job(NamedTuple):
    """A room to be played; ``laser`` is one of `LASERS`."""

    scene: str
    seed: int
    feet: Any
    laser: str


class Explained(NamedTuple):
    """A scan, what is known when it is to be explained, and the right explanation.

    Movers ``rows`` (k,) of the bodies, ``cost`` (m, 2k + m) as `costs` fills it, ``columns`` (m,) the right assignment;
    ``sight`` as `clear` takes it.
    """

    scan: ClusteredScan
    rows: NDArray[np.int64]
    cost: NDArray[np.float64]
    columns: NDArray[np.int64]
    sight: Any


class Told(Association):
    """Is told whose feet are whose; ``people`` and ``owners`` are the truth about the next scan."""

    def __init__(self, most: int, prints: int, seats: Sequence[Polygon], job: Job) -> None:
        super().__init__(most, prints, seats)
        self.job = job
        self.tracks: dict[int, int] = {}
        self.people: dict[int, tuple[float, float]] = {}
        self.owners: NDArray[np.int64] = np.zeros(0, np.int64)

    @classmethod
    def play(cls, job: Job, duration: float | None = None) -> Self:
        """Play a room, ``duration`` s of it or all."""
        world = FloorWorld(job.scene, job.seed, feet=job.feet, laser=LASERS[job.laser], duration=duration)
        sensors = {name: (mount.laser.sweep(), mount.reported) for name, mount in world.sensors.items()}
        told: list[Self] = []

        def tell(most: int, prints: int, seats: Sequence[Polygon]) -> Association:
            told.append(cls(most, prints, seats, job))
            return told[-1]

        with patch("tms_agents.floor.estimator.Association", tell):
            ours = Ours(sensors, world.known())
        for frame in world.scans():
            plan = world.life.plan
            inside = [mover for mover in world.life.movers.values() if plan.contains(mover.xy, -0.01)]
            told[0].people = {world.room.owner(mover.id): mover.xy for mover in inside if mover.walker is not None}
            told[0].owners = frame.owners
            ours.scan(frame.sensor, frame.t, frame.ranges, frame.intensities if job.laser == "fine" else None)
        return told[0]

    def explained(self, found: Explained) -> None:
        """The right explanation of a scan is known, and nothing has come of it yet."""

    def step(self, scan: ClusteredScan, sight: Any) -> NDArray[np.bool_]:
        predict(self.bodies, scan.t)
        rows = np.flatnonzero((self.bodies["used"] == 1) & (self.bodies["confirmed"] == 1))
        self._follow(rows)
        count, columns = scan.clusters.size, np.full(scan.clusters.size, -1)
        if count and rows.size:
            cost = np.empty((count, 2 * rows.size + count))
            costs(scan, np.ones(count, np.bool_), self.bodies, rows, cost)
            known(scan, self.bodies, cost[:, 2 * rows.size :])
            owners = [self._owner(c) for c in scan.clusters]
            right = cost.copy()
            for column, row in enumerate(rows):
                others = [i for i, owner in enumerate(owners) if owner < 0 or owner != self.tracks.get(int(row))]
                right[others, 2 * column : 2 * column + 2] = UNLIKELY
            assign(right, 2 * rows.size, UNLIKELY, columns)
            self.explained(Explained(scan, rows, cost, columns, sight))
        free = np.ones(count, np.bool_)
        adopt(self.bodies, rows, columns, scan, free, sight)
        complete(self.bodies, scan, free, sight)
        scatter(self.bodies, scan.clusters, scan.of, scan.marks, scan.t, self.scattered)
        return ~free

    def rename(self, t: float) -> list[tuple[int, int]]:
        """Names are right."""
        return []

    def _follow(self, rows: Any) -> None:
        """Whose each of the bodies ``rows`` is: a new one is whose it is near, if he has none."""
        self.tracks = {row: who for row, who in self.tracks.items() if row in rows}
        for row in rows.tolist():
            if row not in self.tracks:
                xy = float(self.bodies[row]["x"]), float(self.bodies[row]["y"])
                away = {who: math.dist(xy, at) for who, at in self.people.items() if who not in self.tracks.values()}
                if away and min(away.values()) < _HIS_M:
                    self.tracks[row] = min(away, key=lambda who: away[who])

    def _owner(self, c: Any) -> int:
        met = self.owners[c["first"] : c["last"] + 1]
        met = met[met >= 0]
        return int(np.bincount(met).argmax()) if met.size else -1
