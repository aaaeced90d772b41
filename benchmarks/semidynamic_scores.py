"""Objects and maps whose truth is known, with the paths laid on one another as well as possible."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.spatial import cKDTree

from tms_agents.slam import Log
from tms_agents.slam.geometry import Floats, compose, transform, wrapped
from tms_agents.slam.logs import odometry_at
from tms_agents.slam.semidynamic import Models, Semidynamic
from tms_agents.slam.semidynamic.shapes import surface

#: Right within (m, degrees); a door is open from (degrees) on; fewer reads are no visit.
_RIGHT_M, _RIGHT_DEG, _OPEN_DEG, _READS = 0.2, 20.0, 15.0, 3
#: A ghost is so far from all that is there (m); a cell so near is on it; occupied from this probability on.
_APART_M, _ON_M, _OCCUPIED = 0.07, 0.03, 0.65


@dataclass(frozen=True, slots=True)
class Scores:
    """Intervals of time in which an object stood still and was read: how many were there, found at all, and right
    (round things may be turned); ``doors_wrong``: open or closed; ``ghosts``: share of former surfaces that the map
    still holds."""

    expected: int
    found: int
    right: int
    doors_wrong: int
    ghosts: float


def scores(log: Log, models: Models, truth: Mapping[str, Any], result: Semidynamic) -> Scores:
    """``truth`` is the document of the simulation."""
    path = np.array(truth["trajectory"])
    to_world = _best_fit(result.poses, odometry_at(path[:, 0], path[:, 1:], log.t))
    expected = found = right = doors_wrong = 0
    for tag, thing in truth["objects"].items():
        stays = [(float(log.t[stay.visit.scans[0]]), stay.pose) for stay in result.stays.get(tag, ())]
        for reads, interval in zip(thing["reads"], thing["poses"], strict=True):
            if reads < _READS:
                continue
            expected += 1
            before = [pose for t, pose in stays if t < interval["t1"]]
            if not before:
                continue
            found += 1
            there = compose(to_world, before[-1])
            off = np.hypot(there[0] - interval["x"], there[1] - interval["y"])
            turned = np.degrees(abs(wrapped(there[2] - interval["theta"])))
            right += bool(off < _RIGHT_M and (turned < _RIGHT_DEG or thing["class"] == "bin_round"))
            if thing["door"]:
                closed = thing["door"]["closed_theta"]
                doors_wrong += _open(there[2], closed) != _open(interval["theta"], closed)
    return Scores(expected, found, right, doors_wrong, _ghosts(models, truth, result, to_world))


def _open(theta: float, closed: float) -> bool:
    return bool(np.degrees(abs(wrapped(theta - closed))) > _OPEN_DEG)


def _ghosts(models: Models, truth: Mapping[str, Any], result: Semidynamic, to_world: Floats) -> float:
    grid, former = result.grid, []
    now = [a + (b - a) * share for a, b in _ends(truth) for share in np.linspace(0, 1, 400)[:, None]]
    for tag, thing in truth["objects"].items():
        places = [surface(models.objects[tag], np.array([one["x"], one["y"], one["theta"]])) for one in thing["poses"]]
        now += list(places[-1])
        former += [place for place, reads in zip(places[:-1], thing["reads"][:-1], strict=True) if reads >= _READS]
    points = np.concatenate(former)
    points = points[cKDTree(np.array(now)).query(points)[0] > _APART_M]
    rows, columns = np.nonzero(np.nan_to_num(grid.probabilities()) > _OCCUPIED)
    cells = np.array(grid.origin) + (np.stack([columns, rows], axis=-1) + 0.5) * grid.resolution
    apart, _ = cKDTree(transform(to_world, cells)).query(points)
    return float((apart < _ON_M).mean())


def _ends(truth: Mapping[str, Any]) -> list[tuple[Floats, Floats]]:
    return [(np.array(wall[:2]), np.array(wall[2:4])) for wall in truth["walls"]]


def _best_fit(path: Floats, truth: Floats) -> Floats:
    """(3,) that brings ``path`` (S, 3) onto ``truth`` (S, 3) with the least squares."""
    a, b = path[:, :2] - path[:, :2].mean(axis=0), truth[:, :2] - truth[:, :2].mean(axis=0)
    turn = float(np.arctan2((a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]).sum(), (a * b).sum()))
    shift = truth[:, :2].mean(axis=0) - transform(np.array([0.0, 0.0, turn]), path[:, :2]).mean(axis=0)
    return np.array([*shift, turn])
