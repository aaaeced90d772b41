"""Where a robot may be: particles that hang together are one hypothesis, with a mean, a covariance and a weight."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from tms_agents.slam.geometry import Floats, wrapped
from tms_agents.slam.sampling import bins_of

#: Boxes (m, rad) that touch, corners too, belong together.
_SIDE = (0.4, np.pi / 12)
_NEIGHBOURS = np.array([(x, y, t) for x in (-1, 0, 1) for y in (-1, 0, 1) for t in (-1, 0, 1) if (x, y, t) > (0, 0, 0)])


@dataclass(frozen=True, slots=True, eq=False)
class Hypothesis:
    """``weight`` 0..1; ``pose`` (3,) m, m, rad in the map; ``covariance`` (3, 3)."""

    weight: float
    pose: Floats
    covariance: Floats

    @property
    def spread_m(self) -> float:
        """Standard deviation of the position along its longest axis."""
        return float(np.sqrt(max(0.0, np.linalg.eigvalsh(self.covariance[:2, :2])[-1])))

    @property
    def spread_rad(self) -> float:
        """Standard deviation of the heading."""
        return float(np.sqrt(self.covariance[2, 2]))


def hypotheses(poses: Floats, weights: Floats, most: int = 8) -> list[Hypothesis]:
    """The ``most`` heaviest hypotheses of particles ``poses`` (N, 3) with ``weights`` (N,) that sum to 1."""
    group = groups(poses)
    sums = np.bincount(group, weights)
    heaviest = np.argsort(-sums, kind="stable")[:most]
    return [_described(poses[group == g], weights[group == g]) for g in heaviest if sums[g] > 0]


def groups(poses: Floats) -> NDArray[np.int64]:
    """(N,) number of the group of each pose: poses in boxes that touch are in one."""
    boxes, member = np.unique(bins_of(poses, *_SIDE), axis=0, return_inverse=True)
    around = round(2 * np.pi / _SIDE[1])
    low = boxes.min(axis=0)
    size = boxes.max(axis=0) - low + 3
    keys = _key(boxes - low + 1, size, around)
    order = np.argsort(keys)
    ends = []
    for step in _NEIGHBOURS:
        beside = _key(boxes - low + 1 + step, size, around)
        place = np.minimum(np.searchsorted(keys[order], beside), len(keys) - 1)
        found = keys[order][place] == beside
        ends.append(np.column_stack([np.flatnonzero(found), order[place[found]]]))
    pairs = np.concatenate(ends)
    graph = coo_matrix((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(len(boxes), len(boxes)))
    _, label = connected_components(graph, directed=False)
    return np.asarray(label, dtype=np.int64)[member.reshape(-1)]


def _key(boxes: NDArray[np.int64], size: NDArray[np.int64], around: int) -> NDArray[np.int64]:
    """One number per box; boxes are counted from 1 on in x and y, headings wrap."""
    turns = (boxes[:, 2] - 1) % around
    key: NDArray[np.int64] = (boxes[:, 0] * size[1] + boxes[:, 1]) * around + turns
    return key


def _described(poses: Floats, weights: Floats) -> Hypothesis:
    share = weights / weights.sum()
    heading = np.arctan2(share @ np.sin(poses[:, 2]), share @ np.cos(poses[:, 2]))
    mean = np.array([share @ poses[:, 0], share @ poses[:, 1], heading])
    apart = poses - mean
    apart[:, 2] = wrapped(apart[:, 2])
    return Hypothesis(float(weights.sum()), mean, (apart * share[:, None]).T @ apart)
