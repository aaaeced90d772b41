"""Which cluster is whose foot: movers that are believed choose first, then those that are not yet (two stages)."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment

from tms_agents.floor.bodies import UNLIKELY, begin, costs, update
from tms_agents.floor.segmentation import CLUSTER
from tms_agents.floor.state import free_slot

Array = NDArray[np.float64]

#: A new body begins only at a print younger than this (s): what has stood there for long does not begin to walk.
_FRESH_S = 0.4


def associate(clusters: Any, of: NDArray[np.int64], prints: Any, bodies: Any, t: float) -> NDArray[np.bool_]:
    """Update ``bodies`` with the clusters (m,) of one scan, begin new ones; which clusters (m,) are somebody's."""
    free = np.ones(clusters.size, np.bool_)
    used = bodies["used"] == 1
    confirmed = bodies["confirmed"] == 1
    for rows in (np.flatnonzero(used & confirmed), np.flatnonzero(used & ~confirmed)):
        if rows.size:
            _assign(clusters, of, free, prints, bodies, rows, t)
    for k in np.flatnonzero(free):
        cluster = clusters[k]
        single = cluster["n"] == 1 and cluster["spacing"] < 0.025
        if single or t - prints[of[k]]["first"] > _FRESH_S:
            continue
        slot = free_slot(bodies)
        if slot < 0:
            break
        if _crowded(cluster, bodies):
            continue
        begin(bodies[slot], cluster, of[k], t)
    return ~free


def _crowded(cluster: Any, bodies: Any) -> bool:
    """Whether somebody's foot is so near that this is hardly another body."""
    x, y = cluster["x"], cluster["y"]
    near = np.minimum(np.hypot(bodies["ax"] - x, bodies["ay"] - y), np.hypot(bodies["bx"] - x, bodies["by"] - y))
    return bool(((bodies["used"] == 1) & (near < 0.22)).any())


def _assign(
    clusters: Any,
    of: NDArray[np.int64],
    free: NDArray[np.bool_],
    prints: Any,
    bodies: Any,
    rows: NDArray[np.int64],
    t: float,
) -> None:
    """One stage: the assignment of free clusters to the feet of the bodies ``rows`` that is most probable together."""
    cost = np.empty((clusters.size, 2 * rows.size))
    costs(clusters, of, free, prints, bodies, rows, t, cost)
    feet: dict[int, int] = {}
    if clusters.size and (cost < UNLIKELY).any():
        which, columns = linear_sum_assignment(np.minimum(cost, 60.0))
        for k, column in zip(which.tolist(), columns.tolist(), strict=True):
            if cost[k, column] < UNLIKELY:
                feet[column] = k
                free[k] = False
    blank = clusters[0] if clusters.size else _BLANK[0]
    for column, row in enumerate(rows.tolist()):
        a, b = feet.get(2 * column, -1), feet.get(2 * column + 1, -1)
        update(
            bodies[row],
            clusters[a] if a >= 0 else blank,
            a >= 0,
            of[a] if a >= 0 else -1,
            clusters[b] if b >= 0 else blank,
            b >= 0,
            of[b] if b >= 0 else -1,
            prints,
            t,
        )


_BLANK = np.zeros(1, CLUSTER)
