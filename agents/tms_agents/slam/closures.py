"""Places that were visited again: where a later part of the path fits into an earlier submap, and how surely."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tms_agents.slam.agreement import agreement
from tms_agents.slam.branch_and_bound import best_pose
from tms_agents.slam.geometry import Floats, between, compose, inverse, wrapped
from tms_agents.slam.matching import SHARE, match
from tms_agents.slam.submaps import Submap, Submaps

#: Points of a cloud, keys on either side that it is made of, its least mean score in a search.
_POINTS, _AROUND, _LEAST = 300, 3, 0.5
_TURN_STEP = 0.025
#: Closures within so much way (m, both ends added) should agree; a crowd is so much larger than its rivals to win,
#: and one counts by this power of how well it fits.
_CROWD_M, _CLEARLY, _MERIT = 60.0, 1.5, 8
#: A match holds if so large a share of the points ends near surfaces, among those that end where the submap knows
#: something, and so many points do;
#: near is within so many m.
_FITS, _KNOWN, _NEAR_M = 0.85, 0.4, 0.2
#: The precision of a cloud's match is that of so few independent witnesses; and it is never better than this (m, rad).
_WITNESSES, _FLOOR = 20.0, (0.04, 0.04, 0.006)


@dataclass(frozen=True, slots=True, eq=False)
class Closure:
    """Key scan ``key`` seen from key scan ``anchor``, with ``information`` (3, 3); ``shift`` m from where it was
    thought."""

    anchor: int
    key: int
    seen: Floats
    information: Floats
    fit: float
    shift: float


def find_closure(
    submaps: Submaps, number: int, key: int, thought: Floats, window: float, turn: float
) -> Closure | None:
    """Compare key scan ``key``, ``thought`` (3,) to be there, with a submap: near by first, then in the whole
    window."""
    submap = submaps.rendered(number)
    cloud = submaps.cloud(key, _AROUND, _POINTS)
    there = _refined(submap, cloud, thought)
    if there is None and window > 0:
        found = np.empty(3)
        score = best_pose(
            submaps.levels(number), submap.origin, submap.scale, cloud, thought, window, turn, _TURN_STEP, _LEAST, found
        )
        if score > 0.0:
            there = _refined(submap, cloud, found)
    if there is None:
        return None
    pose, hessian, fit = there
    if submaps.light is not None:
        placed = submaps.light.placed(number, key, _AROUND, submap.maps, 0, cloud, pose, hessian, window)
        if placed is None or not _agrees(submap, cloud, placed[0])[0]:
            return None
        pose, hessian = placed
    covariance = np.linalg.inv(hessian) * _WITNESSES + np.diag(np.square(_FLOOR))
    shift = float(np.hypot(*(pose - thought)[:2]))
    return Closure(submap.anchor, key, pose, np.linalg.inv(covariance), fit, shift)


def _refined(submap: Submap, cloud: Floats, start: Floats) -> tuple[Floats, Floats, float] | None:
    """(pose, hessian, share that fits) of the match from ``start``; None if it does not hold."""
    maps = submap.maps
    pose, hessian, result = np.empty(3), np.empty((3, 3)), np.empty(3)
    loose = np.diag([1.0, 1.0, 25.0])
    match(
        maps.distance.directory[0], maps.distance.cells, maps.metres, maps.frame, cloud, start, start, loose, 0.1, 1.0,
        pose, hessian, result,
    )  # fmt: skip
    if result[SHARE] < _KNOWN * _FITS:
        return None
    agrees, fit = _agrees(submap, cloud, pose)
    return (pose, hessian, fit) if agrees else None


def _agrees(submap: Submap, cloud: Floats, pose: Floats) -> tuple[bool, float]:
    """(Whether the match holds at ``pose``, share that fits)."""
    maps = submap.maps
    near, free = agreement(
        maps.occupancy.directory[0], maps.occupancy.cells, maps.distance.directory[0], maps.distance.cells,
        maps.metres, maps.frame, cloud, pose, _NEAR_M,
    )  # fmt: skip
    holds = near >= _FITS * (near + free) and near + free >= _KNOWN * len(cloud)
    return holds, near / max(1, near + free)


def consistent(closures: list[Closure], path: Floats, way: Floats) -> NDArray[np.bool_]:
    """(C,) which closures are borne out by others near by: going round between two of them leads back to the start.

    ``way`` (K,) m is the length of ``path`` (K, 3) until each key. Corridors with doors at equal distances fit into
    themselves in many ways, each of which has its own crowd of closures that agree: a closure needs two others, and the
    crowd of none that contradicts it may be nearly as large.
    """
    count = len(closures)
    if not count:
        return np.zeros(0, dtype=bool)
    anchors, keys = np.array([c.anchor for c in closures]), np.array([c.key for c in closures])
    seen = np.array([c.seen for c in closures])
    merit = np.array([c.fit for c in closures]) ** _MERIT
    agree, contradict = np.zeros((count, count), dtype=bool), np.zeros((count, count), dtype=bool)
    for n in range(count):
        apart = np.abs(way[keys] - way[keys[n]]) + np.abs(way[anchors] - way[anchors[n]])
        others = np.flatnonzero((apart < _CROWD_M) & (np.arange(count) != n))
        from_anchor = inverse(between(path[anchors[n]][None], path[anchors[others]]))
        expected = compose(compose(from_anchor, seen[n][None]), between(path[keys[n]][None], path[keys[others]]))
        error = expected - seen[others]
        same = (np.hypot(error[:, 0], error[:, 1]) < 0.25 + 0.03 * apart[others]) & (
            np.abs(wrapped(error[:, 2])) < 0.05 + 0.003 * apart[others]
        )
        agree[n, others[same]] = True
        contradict[n, others[~same]] = True
    support = agree @ merit + merit
    rival = np.where(contradict | contradict.T, support, 0.0).max(axis=1)
    kept: NDArray[np.bool_] = (agree.sum(axis=1) >= 2) & (support > _CLEARLY * rival)
    return kept
