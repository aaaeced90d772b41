"""Where a laser stands and how its ruler errs, from the walls of a room whose outline is known. Pure.

Lasers of the class of a URG-04LX measure everything up to 1 % too long or too short (its data sheet; of five shared
samples -0.8 to +0.9 %). One that sees walls on both sides of it tells both, where it stands and by how much.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tms_agents.floor.settings import Pose

Array = NDArray[np.float64]

#: A point that fits a wall is this near to it.
MATCHED_M = 0.03
#: Fewer points, or a smaller share of those at walls, are at a wall by chance.
_FEW, _STRAY = 5, 0.03
#: Between the first look and the last, what counts as near a wall shrinks so.
_REACH_M = (0.6, 0.3, 0.15, 0.08, 0.05)
_TURNS_PER_REACH = 5
#: Starts around the pose that was measured by ruler.
_SHIFTS_M, _TURNS = (-0.35, 0.0, 0.35), (-0.35, -0.17, 0.0, 0.17, 0.35)
#: A pose that is farther (m, rad) from the one by ruler is none.
_NEAR_M, _NEAR = 0.75, 0.7
_NOWHERE = "what the laser sees does not fit the outline of the room anywhere near"
#: Nothing is known of a ruler but that it errs by so much (standard deviation), and by how much at most; a point is so
#: good (m).
_RULER, _MOST, _POINT_M = 0.01, 0.02, 0.005
#: A ruler is believed that is known so well, from this share of the points at a wall, the laser so near (m, rad) where
#: it is said to be.
_SURE, _AT_WALLS, _MOVED_M, _TURNED = 0.002, 0.3, 0.15, 0.1


@dataclass(frozen=True, slots=True)
class Fit:
    """A pose with its standard deviations (m, m, rad), the residual of the points that fit, and their share.

    ``range_scale``: what the laser measures times this is how far it is, with ``range_scale_sd``.
    """

    pose: Pose
    sd: tuple[float, float, float]
    range_scale: float
    range_scale_sd: float
    rmse_m: float
    matched: float
    points: int

    @property
    def known_scale(self) -> float | None:
        """The scale, if the walls tell it: of walls that are none what is near them is off by more than noise."""
        return self.range_scale if self.range_scale_sd < _SURE and self.matched >= _AT_WALLS else None


def fit_walls(points: Array, outline: Sequence[tuple[float, float]], start: Pose) -> Fit:
    """The pose near ``start`` (half a metre, 20 degrees) at which most points (n, 2) lie on the outline (a polygon).

    Furniture before the walls does no harm as long as every direction has some wall left.

    Raises:
        ValueError: too few points, or they leave the pose undetermined (walls of one direction only).
    """
    _require(points)
    walls = _Walls(outline)
    spaced = _spaced(points)
    fits = [
        _settled(spaced, walls, (start[0] + dx, start[1] + dy, start[2] + turn), _REACH_M)
        for dx, dy, turn in itertools.product(_SHIFTS_M, _SHIFTS_M, _TURNS)
    ]
    there = [found for found in fits if math.dist(found[:2], start[:2]) < _NEAR_M and _turn(found[2], start[2]) < _NEAR]
    if not there:
        raise ValueError(_NOWHERE)
    best = max(there, key=lambda found: (*_fits(spaced, walls, found), -math.dist(found[:2], start[:2])))
    return _judged(points, walls, best)


def held_against(points: Array, outline: Sequence[tuple[float, float]], pose: Pose) -> Fit | None:
    """Where a laser at about this ``pose`` stands, and how its ruler errs; None where the walls do not tell both."""
    try:
        _require(points)
        walls = _Walls(outline)
        fit = _judged(points, walls, _settled(_spaced(points), walls, pose, _REACH_M[2:]))
    except ValueError:
        return None
    here = math.dist(fit.pose[:2], pose[:2]) < _MOVED_M and _turn(fit.pose[2], pose[2]) < _TURNED
    return fit if here and fit.known_scale is not None else None


def _require(points: Array) -> None:
    if len(points) < 20:
        raise ValueError(f"only {len(points)} beams see something that stands still")


def _judged(points: Array, walls: _Walls, best: NDArray[np.float64]) -> Fit:
    residuals = _residuals(points, walls, best)
    gap, jacobian, _ = residuals
    near = residuals.matched
    if near.sum() < 20:
        raise ValueError(_NOWHERE)
    rmse = float(np.sqrt(np.mean(gap[near] ** 2)))
    good = max(rmse, 0.003)
    if np.linalg.eigvalsh(jacobian[near, :3].T @ jacobian[near, :3] / good**2)[0] < 1e4:
        raise ValueError("it sees walls of one direction only, along which it may stand anywhere")
    sd = _deviations(jacobian[near], good)
    x, y, theta, scale = best.tolist()
    return Fit(
        pose=(x, y, wrapped(theta)),
        sd=(sd[0], sd[1], sd[2]),
        range_scale=scale,
        range_scale_sd=float(sd[3]),
        rmse_m=rmse,
        matched=float(near.mean()),
        points=len(points),
    )


def _turn(one: float, other: float) -> float:
    return abs(wrapped(one - other))


def wrapped(angle: float) -> float:
    """The same angle between -pi and pi."""
    return float(np.arctan2(np.sin(angle), np.cos(angle)))


class _Walls:
    """The sides of a polygon."""

    def __init__(self, outline: Sequence[tuple[float, float]]) -> None:
        start = np.array(outline, dtype=np.float64)
        along = np.roll(start, -1, axis=0) - start
        length = np.hypot(along[:, 0], along[:, 1])
        # A corner that is told twice, as the first one is of polygons that are closed, has no side of its own.
        sides = length >= 1e-6
        if sides.sum() < 3:
            raise ValueError("the outline needs at least three corners, each somewhere else")
        self.start, self.length = start[sides], length[sides]
        self.along = along[sides] / self.length[:, None]
        self.normal = np.stack([-self.along[:, 1], self.along[:, 0]], axis=1)

    def nearest(self, points: Array) -> tuple[Array, NDArray[np.intp]]:
        """Signed distance (n,) to the nearest side, and which that is (n,)."""
        offset = points[:, None, :] - self.start[None]
        along = np.einsum("nsk,sk->ns", offset, self.along)
        across = np.einsum("nsk,sk->ns", offset, self.normal)
        beyond = along - np.clip(along, 0.0, self.length[None])
        side = np.argmin(np.hypot(across, beyond), axis=1)
        rows = np.arange(len(points))
        # Beyond a side's end a point is as far away as that end.
        gap = np.where(beyond[rows, side] == 0.0, across[rows, side], np.inf)
        return gap, side


class _Residuals(NamedTuple):
    """Distances (n,) m to the walls, inf at none, their derivatives (n, 4) by pose and scale; which wall."""

    gap: Array
    jacobian: Array
    side: NDArray[np.intp]

    @property
    def matched(self) -> NDArray[np.bool_]:
        """Which points are at a wall (n,) at which are others: in a corner some seem to be at the next one."""
        near: NDArray[np.bool_] = np.abs(self.gap) < MATCHED_M
        crowd = np.bincount(self.side[near], minlength=int(self.side.max()) + 1)
        crowded: NDArray[np.bool_] = crowd[self.side] >= max(_FEW, _STRAY * near.sum())
        return near & crowded


def _residuals(points: Array, walls: _Walls, found: NDArray[np.float64]) -> _Residuals:
    cos, sin = np.cos(found[2]), np.sin(found[2])
    turned = points @ np.array([[cos, sin], [-sin, cos]])
    gap, side = walls.nearest(found[3] * turned + found[:2])
    normal = walls.normal[side]
    by_angle = found[3] * (normal[:, 1] * turned[:, 0] - normal[:, 0] * turned[:, 1])
    return _Residuals(gap, np.column_stack([normal, by_angle, np.sum(normal * turned, axis=1)]), side)


def _settled(points: Array, walls: _Walls, start: Sequence[float], reaches: Sequence[float]) -> NDArray[np.float64]:
    """Pose and scale (4,): the pose first, both where the walls tell both."""
    pose = _descend(points, walls, np.array([*start, 1.0]), reaches, 1e6)
    both = _descend(points, walls, pose, _REACH_M[2:], (_POINT_M / _RULER) ** 2)
    residuals = _residuals(points, walls, both)
    sure = _deviations(residuals.jacobian[residuals.matched], _POINT_M)[3] < _SURE
    return both if sure and abs(both[3] - 1.0) < _MOST else pose


def _deviations(jacobian: Array, point_m: float) -> Array:
    """Standard deviations (4,) of pose and scale from points that are so good, with ``jacobian`` (n, 4)."""
    information = jacobian.T @ jacobian / point_m**2 + np.diag([1e-6, 1e-6, 1e-6, _RULER**-2])
    return np.asarray(np.sqrt(np.diag(np.linalg.inv(information))))


def _descend(
    points: Array, walls: _Walls, found: NDArray[np.float64], reaches: Sequence[float], ruler: float
) -> NDArray[np.float64]:
    """``ruler``: how much it counts, in points, that the scale is 1."""
    prior = np.diag([0.0, 0.0, 0.0, ruler])
    for reach in reaches:
        for _ in range(_TURNS_PER_REACH):
            gap, jacobian, _ = _residuals(points, walls, found)
            near = np.abs(gap) < reach
            if near.sum() < 10:
                return found
            weight = (1 - (gap[near] / reach) ** 2) ** 2  # Tukey's
            rows = jacobian[near] * weight[:, None]
            wanted = rows.T @ gap[near] + prior @ (found - 1.0)
            step = np.linalg.solve(rows.T @ jacobian[near] + prior + 1e-6 * np.eye(4), -wanted)
            found = found + step
            if np.abs(step).max() < 1e-6:
                break
    return found


def _fits(points: Array, walls: _Walls, found: NDArray[np.float64]) -> tuple[float, float]:
    """The share of points at a wall, in hundredths, and minus how far they are off, in whole millimetres."""
    gap = _residuals(points, walls, found).gap
    near = np.abs(gap) < MATCHED_M
    off = float(np.sqrt(np.mean(gap[near] ** 2))) if near.any() else MATCHED_M
    return round(float(near.mean()), 2), -round(off, 3)


def _spaced(points: Array, step_m: float = 0.03) -> Array:
    """Of points that crowd together one per ``step_m``, so that a near wall counts as its length."""
    _, first = np.unique(np.floor(points / step_m).astype(np.int64), axis=0, return_index=True)
    spaced: Array = points[np.sort(first)]
    return spaced
