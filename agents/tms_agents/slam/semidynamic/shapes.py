"""Outlines of object models as points: where a laser would see something, and where it could not see through."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tms_agents.slam.geometry import Floats, transform
from tms_agents.slam.semidynamic.models import ObjectModel

#: Distance of the points (m), and how deep inside a beam surely does not get.
STEP_M, _DEEP_M = 0.03, 0.06
#: Past the ends of longer edges than the last one (m).
_BEYOND_M, _EDGE_M = (0.10, 0.16, 0.22), 0.2


@dataclass(frozen=True, slots=True, eq=False)
class Shape:
    """``outline`` (M, 2) with outward ``normals`` (M, 2), ``inside`` (I, 2), and ``beyond`` (E, 2, P, 2) in line with
    E longer edges but past either end, m in the object's frame; ``edges`` (M,) on which of these a point of the outline
    lies (-1: on none). What is ``hinged`` is a panel along x."""

    outline: Floats
    normals: Floats
    beyond: Floats
    edges: NDArray[np.int64]
    inside: Floats
    hinged: bool

    @property
    def size(self) -> float:
        """m from the origin to the farthest point."""
        return float(np.hypot(*self.outline.T).max())


def shape_of(model: ObjectModel) -> Shape:
    points, normals, edges = [], [], []
    beyond: list[Floats] = []
    for part in model.parts:
        for on, outward, past in _edges(part):
            points.append(on)
            normals.append(np.broadcast_to(outward, on.shape))
            edges.append(np.full(len(on), len(beyond) if past is not None else -1))
            beyond += [past] if past is not None else []
    inside = np.concatenate([_inside(part) for part in model.parts])
    ends = np.array(beyond) if beyond else np.empty((0, 2, len(_BEYOND_M), 2))
    return Shape(np.concatenate(points), np.concatenate(normals), ends, np.concatenate(edges), inside, model.hinged)


def surface(model: ObjectModel, pose: Floats) -> Floats:
    """(M, 2) points on the outline of an object at ``pose`` (3,)."""
    return transform(pose, shape_of(model).outline)


def _edges(corners: Floats) -> Iterator[tuple[Floats, Floats, Floats | None]]:
    """Of each edge of a polygon: points on it, its outward normal, and if it is long, points past either end."""
    following = np.roll(corners, -1, axis=0)
    area = float(np.sum(corners[:, 0] * following[:, 1] - following[:, 0] * corners[:, 1]))
    for a, b in zip(corners, following, strict=True):
        length = max(float(np.hypot(*(b - a))), 1e-9)
        steps = max(1, round(length / STEP_M))
        points = a + (b - a) * ((np.arange(steps) + 0.5) / steps)[:, None]
        outward = np.array([b[1] - a[1], a[0] - b[0]]) / length * np.sign(area)
        past = (b - a) / length * np.array(_BEYOND_M)[:, None]
        yield points, outward, np.stack([b + past, a - past]) if length > _EDGE_M else None


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
