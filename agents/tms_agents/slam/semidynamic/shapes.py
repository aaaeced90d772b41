"""Outlines of object models as points: where a laser would see something, and where it could not see through."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tms_agents.slam.geometry import Floats, transform
from tms_agents.slam.semidynamic.models import ObjectModel

#: Distance of the points (m), and how deep inside a beam surely does not get.
STEP_M, _DEEP_M = 0.03, 0.06
#: Past the ends of longer edges than the last one (m).
_BEYOND_M, _EDGE_M = (0.10, 0.16, 0.22), 0.2


@dataclass(frozen=True, slots=True, eq=False)
class Shape:
    """``outline`` (M, 2) with outward ``normals`` (M, 2), ``inside`` (I, 2), and ``beyond`` (B, 2) in line with the
    edges but past their ends, m in the object's frame. What is ``hinged`` is a panel along x."""

    outline: Floats
    normals: Floats
    beyond: Floats
    inside: Floats
    hinged: bool

    @property
    def size(self) -> float:
        """m from the origin to the farthest point."""
        return float(np.hypot(*self.outline.T).max())


def shape_of(model: ObjectModel) -> Shape:
    edges = [_edges(part) for part in model.parts]
    inside = np.concatenate([_inside(part) for part in model.parts])
    outline, normals, beyond = (np.concatenate(one) for one in zip(*edges, strict=True))
    return Shape(outline, normals, beyond, inside, model.hinged)


def surface(model: ObjectModel, pose: Floats) -> Floats:
    """(M, 2) points on the outline of an object at ``pose`` (3,)."""
    return transform(pose, shape_of(model).outline)


def _edges(corners: Floats) -> tuple[Floats, Floats, Floats]:
    """Points on the edges of a polygon, outward normals there, points past the ends of edges."""
    following = np.roll(corners, -1, axis=0)
    area = float(np.sum(corners[:, 0] * following[:, 1] - following[:, 0] * corners[:, 1]))
    points, normals, beyond = [], [], [np.empty((0, 2))]
    for a, b in zip(corners, following, strict=True):
        length = max(float(np.hypot(*(b - a))), 1e-9)
        steps = max(1, round(length / STEP_M))
        points.append(a + (b - a) * ((np.arange(steps) + 0.5) / steps)[:, None])
        outward = np.array([b[1] - a[1], a[0] - b[0]]) / length * np.sign(area)
        normals.append(np.broadcast_to(outward, (steps, 2)))
        if length > _EDGE_M:
            past = (b - a) / length * np.array(_BEYOND_M)[:, None]
            beyond += [b + past, a - past]
    return np.concatenate(points), np.concatenate(normals), np.concatenate(beyond)


def _inside(corners: Floats) -> Floats:
    """Points on a raster, deeper inside a convex or nearly convex polygon than a noisy beam gets."""
    low, high = corners.min(axis=0), corners.max(axis=0)
    x, y = (np.arange(a + _DEEP_M, b - _DEEP_M / 2, STEP_M) for a, b in zip(low, high, strict=True))
    points = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    kept = np.ones(len(points), dtype=np.bool_)
    centre = corners.mean(axis=0)
    for a, b in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        along = (b - a) / max(float(np.hypot(*(b - a))), 1e-9)
        side = along[0] * (points[:, 1] - a[1]) - along[1] * (points[:, 0] - a[0])
        inner = np.sign(along[0] * (centre[1] - a[1]) - along[1] * (centre[0] - a[0]))
        kept &= inner * side > _DEEP_M
    return points[kept]
