"""What a laser without any error would have seen of a simulated world, and how much of it a map has right."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from tms_agents.simulation.floor_world.raycaster import cast
from tms_agents.simulation.floor_world.shapes import Shapes
from tms_agents.slam.geometry import Floats, compose, transform
from tms_agents.slam.gridmap import GridMap
from tms_agents.slam.semidynamic import Models

#: One scan in so many is looked through.
_EVERY, _REACH_M, _BEAMS = 2, 8.0, 361
#: Points so near to each other (m) are one; a cell is right so near to a surface (m).
_SAME_M, _RIGHT_M = 0.01, 0.05
#: A ghost is so far from all that is there (m), a cell so near is on it (m); occupied from this probability on.
_APART_M, _ON_M, _OCCUPIED = 0.07, 0.03, 0.65
#: So many beams, no farther off (m), went on beyond it by so much (m): it was looked through.
_THROUGH, _CELL_M, _BEYOND_M = 3, 0.01, 0.04


@dataclass(frozen=True, slots=True, eq=False)
class View:
    """Of a world up to one moment: ``surfaces`` (N, 2) that are there then, ``seen`` (M, 2) of them that were met by
    a beam, ``ghosts`` (G, 2) that were met on things that stand elsewhere now, which of those were ``looked_through``
    (G,) since they left."""

    surfaces: Floats
    seen: Floats
    ghosts: Floats
    looked_through: NDArray[np.bool_]


@dataclass(frozen=True, slots=True)
class MapScores:
    """``f`` within 5 cm; shares of former surfaces that are still occupied: of all, of those that no beam went through
    since (NaN: there are none)."""

    f: float
    ghosts: float
    ghosts_unseen: float


def map_scores(grid: GridMap, to_world: Floats, view: View) -> MapScores:
    rows, columns = np.nonzero(np.nan_to_num(grid.probabilities()) > _OCCUPIED)
    cells = np.array(grid.origin) + (np.stack([columns, rows], axis=-1) + 0.5) * grid.resolution
    cells = transform(to_world, cells)
    drawn = cKDTree(cells)
    precision = float((cKDTree(view.surfaces).query(cells)[0] <= _RIGHT_M).mean())
    recall = float((drawn.query(view.seen)[0] <= _RIGHT_M).mean())
    left = drawn.query(view.ghosts)[0] <= _ON_M if len(view.ghosts) else np.zeros(0, dtype=np.bool_)
    unseen = left[~view.looked_through]
    return MapScores(
        2 * precision * recall / max(precision + recall, 1e-9),
        float(left.mean()) if len(left) else 0.0,
        float(unseen.mean()) if len(unseen) else float("nan"),
    )


def view_of(truth: Mapping[str, Any], models: Models, until: float) -> View:
    """``truth`` is the document of the simulation."""
    tags = sorted(truth["objects"])
    scans = np.array([row for row in truth["scan_poses"] if row[0] <= until])[::_EVERY]
    points, owners, intervals, beams = [], [], [], []
    angles = np.linspace(-np.pi / 2, np.pi / 2, _BEAMS)
    for t, *pose in scans:
        now = np.array([_interval(truth["objects"][tag], t) for tag in tags] + [0])
        segments, owner = _segments(truth, models, tags, now)
        laser = compose(np.array(pose), models.laser)
        ranges, met = _cast(segments, owner, laser)
        beams.append((t, laser, ranges))
        hit = np.isfinite(ranges)
        ends = laser[:2] + ranges[hit, None] * np.stack([np.cos(a := angles[hit] + laser[2]), np.sin(a)], axis=-1)
        points.append(ends)
        owners.append(met[hit])
        intervals.append(now[met[hit]])
    all_points, all_owners, of = np.concatenate(points), np.concatenate(owners), np.concatenate(intervals)
    raster = np.column_stack([np.round(all_points / _SAME_M).astype(np.int64), all_owners, of])
    _, first = np.unique(raster, axis=0, return_index=True)
    all_points, all_owners, of = all_points[first], all_owners[first], of[first]
    last = np.array([_interval(truth["objects"][tag], until) for tag in tags] + [0])
    still = (all_owners < 0) | (of == last[all_owners])
    segments, _ = _segments(truth, models, tags, last)
    surfaces = _sampled(segments)
    former = np.flatnonzero(~still)
    former = former[cKDTree(surfaces).query(all_points[former])[0] > _APART_M] if len(former) else former
    left = np.array(
        [truth["objects"][tags[k]]["poses"][i]["t1"] for k, i in zip(all_owners[former], of[former], strict=True)]
    )
    return View(surfaces, all_points[still], all_points[former], _looked_through(all_points[former], left, beams))


def _interval(thing: Mapping[str, Any], t: float) -> int:
    spans = thing["poses"]
    return next((k for k, one in enumerate(spans) if one["t0"] <= t < one["t1"]), len(spans) - 1)


def _segments(
    truth: Mapping[str, Any], models: Models, tags: list[str], now: NDArray[np.int64]
) -> tuple[Floats, NDArray[np.int64]]:
    """(N, 4) m and whose they are (N,), -1: walls."""
    pieces, owners = [np.array(truth["walls"])[:, :4]], [np.full(len(truth["walls"]), -1)]
    for number, tag in enumerate(tags):
        at = truth["objects"][tag]["poses"][now[number]]
        for part in models.objects[tag].parts:
            corners = transform(np.array([at["x"], at["y"], at["theta"]]), part)
            pieces.append(np.column_stack([corners, np.roll(corners, -1, axis=0)]))
            owners.append(np.full(len(corners), number))
    return np.concatenate(pieces), np.concatenate(owners)


def _cast(segments: Floats, owners: NDArray[np.int64], laser: Floats) -> tuple[Floats, NDArray[np.int64]]:
    none = np.zeros((0, 5)), np.zeros(0, dtype=np.int64), np.zeros((0, 3))
    still = np.column_stack([segments, np.zeros((len(segments), 2))])
    shapes = Shapes(still, owners, np.zeros((len(segments), 3)), *none)
    pose = (float(laser[0]), float(laser[1]), float(laser[2]))
    met = cast(shapes, pose, -np.pi / 2, np.pi / (_BEAMS - 1), _BEAMS, 0.0)
    return np.where(met.ranges < _REACH_M, met.ranges, np.inf), met.owners


def _sampled(segments: Floats) -> Floats:
    """Points every centimetre."""
    found = []
    for one in segments:
        along = one[2:] - one[:2]
        found.append(one[:2] + along * np.linspace(0, 1, 2 + int(np.hypot(*along) / _SAME_M))[:, None])
    return np.concatenate(found)


def _looked_through(points: Floats, left: Floats, beams: list[tuple[float, Floats, Floats]]) -> NDArray[np.bool_]:
    """(G,) whether enough beams went through ``points`` after the times ``left`` (G,)."""
    counts = np.zeros(len(points))
    step = np.pi / (_BEAMS - 1)
    for t, laser, ranges in beams:
        off = points - laser[:2]
        distance = np.hypot(off[:, 0], off[:, 1])
        bearing = np.arctan2(off[:, 1], off[:, 0]) - laser[2]
        bearing = (bearing + np.pi) % (2 * np.pi) - np.pi
        beam = np.round((bearing + np.pi / 2) / step).astype(int)
        near = (t > left) & (beam >= 0) & (beam < _BEAMS) & (distance < _REACH_M)
        beam = np.clip(beam, 0, _BEAMS - 1)
        aside = distance * np.abs(bearing + np.pi / 2 - step * beam)
        counts += near & (aside < _CELL_M) & (np.minimum(ranges[beam], _REACH_M) > distance + _BEYOND_M)
    return counts >= _THROUGH
