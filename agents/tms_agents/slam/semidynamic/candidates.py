"""Poses that an object may have, from where its tag was read and from what the beams met there."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from tms_agents.slam.geometry import Floats, compose, inverse, transform, wrapped
from tms_agents.slam.semidynamic.evidence import CELL_M
from tms_agents.slam.semidynamic.models import ObjectModel
from tms_agents.slam.semidynamic.scoring import Sight
from tms_agents.slam.semidynamic.shapes import Shape

_FROM_READS, _FROM_SURFACES = 2000, 16000
#: One in so many is turned anyhow: tags that are turned away are read now and then, too.
_TURNED = 8
#: Cells that may be the object's (log-odds), the share that those count which are always occupied, how far away they
#: may be (reaches of the antenna).
_PROMISING, _WALLS, _REACHES = 0.1, 0.2, 1.3
#: So many of the best are refined, by steps (m, rad) that are halved so often.
_REFINED, _STEPS, _HALVED = 100, (0.06, 0.12), 4
#: Poses nearer to each other (m, rad) are one.
_SAME_M, _SAME_RAD = 0.06, 0.15


def candidates(
    sight: Sight, model: ObjectModel, shape: Shape, random: np.random.Generator, most: int = 24
) -> tuple[Floats, Floats]:
    """Poses (C, 3) and their scores (C,), best first, at most ``most``."""
    tried = np.concatenate([_from_reads(sight, model, random), _from_surfaces(sight, model, shape, random)])
    rough = sight.score(model, shape, tried)
    best = tried[np.argsort(-rough, kind="stable")[: 4 * _REFINED]]
    poses = refined(sight, model, shape, _apart(best)[:_REFINED])
    poses = np.concatenate([poses, *(_turned(poses, shape, quarters) for quarters in (1, 2, 3))])
    scores = sight.score(model, shape, poses)
    order = np.argsort(-scores, kind="stable")
    kept = _apart(poses[order])[:most]
    return kept, sight.score(model, shape, kept)


def refined(sight: Sight, model: ObjectModel, shape: Shape, poses: Floats) -> Floats:
    """Each of ``poses`` (N, 3) moved uphill."""
    middle = 0.5 * (shape.outline.min(axis=0) + shape.outline.max(axis=0))
    for halved in range(_HALVED):
        moves = _moves(middle, _STEPS[0] / 2**halved, _STEPS[1] / 2**halved)
        for _ in range(3):
            around = compose(np.repeat(poses, len(moves), axis=0), np.tile(moves, (len(poses), 1)))
            scores = sight.score(model, shape, around).reshape(len(poses), -1)
            poses = around.reshape(len(poses), len(moves), 3)[np.arange(len(poses)), np.argmax(scores, axis=1)]
    poses[:, 2] = wrapped(poses[:, 2])
    return poses


def _moves(middle: Floats, step: float, turn: float) -> Floats:
    """Small moves (9, 3) of an object in its own frame: none, along its sides, turns about its origin and its middle.

    Evidence is a ridge along a side that may lie anywhere on a wall, and about a corner that is met.
    """
    moves = [(0.0, 0.0, 0.0), (step, 0.0, 0.0), (-step, 0.0, 0.0), (0.0, step, 0.0), (0.0, -step, 0.0)]
    for angle in (turn, -turn):
        back = transform(np.array([0.0, 0.0, angle]), -middle[None])[0] + middle
        moves += [(0.0, 0.0, angle), (back[0], back[1], angle)]
    return np.array(moves)


def _from_reads(sight: Sight, model: ObjectModel, random: np.random.Generator) -> Floats:
    """Tags within the reach of antennas that read them, turned towards these."""
    seen_from = _readers(sight)
    reach = max(one.antenna.reach for one in sight.heard)
    origin = seen_from[random.integers(len(seen_from), size=_FROM_READS)]
    bearing = random.uniform(-1.4, 1.4, _FROM_READS)
    distance = reach * np.sqrt(random.uniform(0.01, 1, _FROM_READS)) * np.sqrt(np.maximum(np.cos(bearing), 0.05))
    facing = bearing + np.pi + random.uniform(-1.4, 1.4, _FROM_READS)
    seen = np.stack([distance * np.cos(bearing), distance * np.sin(bearing), facing], axis=-1)
    return compose(compose(origin, seen), np.broadcast_to(inverse(model.tag), seen.shape))


def _from_surfaces(sight: Sight, model: ObjectModel, shape: Shape, random: np.random.Generator) -> Floats:
    """A point of the outline at a cell where beams ended that do not always end there, turned as the reads have it."""
    # What is not always there is the more telling; far from where the tag was read nothing is.
    seen_from = _readers(sight)
    reach = max(one.antenna.reach for one in sight.heard) + shape.size
    cells = np.argwhere(sight.cells.seen + sight.cells.always > _PROMISING)
    apart, _ = cKDTree(seen_from[:, :2]).query(sight.place.corner + (cells[:, ::-1] + 0.5) * CELL_M)
    cells = cells[apart < _REACHES * reach]
    if not len(cells):
        return np.empty((0, 3))
    telling = sight.cells.seen[cells[:, 0], cells[:, 1]] + _WALLS * sight.cells.always[cells[:, 0], cells[:, 1]]
    shares = np.cumsum(telling) / telling.sum()
    drawn = np.searchsorted(shares, random.uniform(size=_FROM_SURFACES))
    cells = cells[np.minimum(drawn, len(cells) - 1)]
    at = sight.place.corner + (cells[:, ::-1] + 0.5) * CELL_M
    points = shape.outline[random.integers(len(shape.outline), size=_FROM_SURFACES)]
    antenna = seen_from[random.integers(len(seen_from), size=_FROM_SURFACES)]
    towards = np.arctan2(antenna[:, 1] - at[:, 1], antenna[:, 0] - at[:, 0])
    turn = towards - model.tag[2] + random.uniform(-1.4, 1.4, _FROM_SURFACES)
    turn[: _FROM_SURFACES // _TURNED] = random.uniform(-np.pi, np.pi, _FROM_SURFACES // _TURNED)
    c, s = np.cos(turn), np.sin(turn)
    x = at[:, 0] - c * points[:, 0] + s * points[:, 1]
    y = at[:, 1] - s * points[:, 0] - c * points[:, 1]
    return np.stack([x, y, wrapped(turn)], axis=-1)


def _turned(poses: Floats, shape: Shape, quarters: int) -> Floats:
    """``poses`` (N, 3) turned about the middle of the outline, which may look alike then."""
    middle = 0.5 * (shape.outline.min(axis=0) + shape.outline.max(axis=0))
    turn = np.array([0.0, 0.0, 0.5 * np.pi * quarters])
    back = transform(turn, -middle[None])[0] + middle
    return compose(poses, np.broadcast_to([*back, turn[2]], poses.shape))


def _readers(sight: Sight) -> Floats:
    """Antenna poses (R, 3) that read the tag."""
    return np.concatenate([one.poses for one in sight.heard if one.read])


def _apart(poses: Floats) -> Floats:
    """Those of ``poses`` (N, 3), the best first, that are not nearly one that comes before them."""
    kept: Floats = poses[_apart_from_better(poses)]
    return kept


@njit(cache=True)
def _apart_from_better(poses: Floats) -> NDArray[np.int64]:
    kept, count = np.empty(len(poses), dtype=np.int64), 0
    for n in range(len(poses)):
        alone = True
        for k in range(count):
            other = poses[kept[k]]
            if (poses[n, 0] - other[0]) ** 2 + (poses[n, 1] - other[1]) ** 2 <= _SAME_M * _SAME_M:
                turn = abs(poses[n, 2] - other[2]) % (2 * np.pi)
                if min(turn, 2 * np.pi - turn) <= _SAME_RAD:
                    alone = False
                    break
        if alone:
            kept[count] = n
            count += 1
    return kept[:count]
