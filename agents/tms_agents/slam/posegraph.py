"""Pose graph optimisation: sparse Gauss-Newton with a switch on every loop edge (Agarwal et al. 2013, dynamic
covariance scaling)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse.linalg import spsolve

from tms_agents.slam.geometry import Floats, between, wrapped

Indices = NDArray[np.int64]
_ITERATIONS = 30
_SMALL = 1e-5


@dataclass(frozen=True, slots=True, eq=False)
class Edges:
    """Pose ``end[e]`` was seen from pose ``start[e]`` as ``measured`` (E, 3), with ``information`` (E, 3, 3) in that
    frame."""

    start: Indices
    end: Indices
    measured: Floats
    information: Floats

    def __len__(self) -> int:
        return len(self.start)

    def chosen(self, which: NDArray[np.bool_]) -> Edges:
        """Those where ``which`` (E,)."""
        return Edges(self.start[which], self.end[which], self.measured[which], self.information[which])

    def errors(self, poses: Floats) -> Floats:
        """(E, 3) seen now less measured."""
        seen = between(poses[self.start], poses[self.end]) - self.measured
        seen[:, 2] = wrapped(seen[:, 2])
        return seen

    def chi2(self, poses: Floats) -> Floats:
        """(E,) squared errors in their own measure."""
        error = self.errors(poses)
        found: Floats = np.einsum("ei,eij,ej->e", error, self.information, error)
        return found


def optimise(poses: Floats, chain: Edges, loops: Edges, switch: float = np.inf) -> Floats:
    """``poses`` (N, 3) that fit all edges best; the first stays. A loop's weight falls once its chi2 is above
    ``switch``."""
    found = poses.copy()
    edges = joined(chain, loops)
    scale = np.ones(len(edges))
    for _ in range(_ITERATIONS):
        if np.isfinite(switch) and len(loops):
            chi2 = loops.chi2(found)
            scale[len(chain) :] = np.minimum(1.0, 2.0 * switch / (switch + chi2)) ** 2
        step = _step(found, edges, scale)
        found = found + step
        found[:, 2] = wrapped(found[:, 2])
        if np.abs(step).max() < _SMALL:
            break
    return found


def joined(first: Edges, second: Edges) -> Edges:
    """All edges of both."""
    return Edges(*(np.concatenate(pair) for pair in zip(_arrays(first), _arrays(second), strict=True)))


def _arrays(edges: Edges) -> tuple[Indices, Indices, Floats, Floats]:
    return edges.start, edges.end, edges.measured, edges.information


def _step(poses: Floats, edges: Edges, scale: Floats) -> Floats:
    """(N, 3) of one Gauss-Newton step."""
    start, end = edges.start, edges.end
    error = edges.errors(poses)
    cosine, sine = np.cos(poses[start, 2]), np.sin(poses[start, 2])
    dx, dy = (poses[end, :2] - poses[start, :2]).T
    by_start, by_end = np.zeros((len(edges), 3, 3)), np.zeros((len(edges), 3, 3))
    by_end[:, 0, 0], by_end[:, 0, 1], by_end[:, 1, 0], by_end[:, 1, 1] = cosine, sine, -sine, cosine
    by_end[:, 2, 2] = 1.0
    by_start[:, :2, :2] = -by_end[:, :2, :2]
    by_start[:, 0, 2], by_start[:, 1, 2] = cosine * dy - sine * dx, -cosine * dx - sine * dy
    by_start[:, 2, 2] = -1.0
    weighted = edges.information * scale[:, None, None]
    size = 3 * len(poses)
    rows, columns, values = [], [], []
    gradient = np.zeros((len(poses), 3))
    for i, by_i in ((start, by_start), (end, by_end)):
        left = by_i.swapaxes(1, 2) @ weighted
        np.add.at(gradient, i, np.einsum("eij,ej->ei", left, error))
        for j, by_j in ((start, by_start), (end, by_end)):
            block = left @ by_j
            rows.append(np.broadcast_to((3 * i)[:, None, None] + np.arange(3)[:, None], block.shape).ravel())
            columns.append(np.broadcast_to((3 * j)[:, None, None] + np.arange(3), block.shape).ravel())
            values.append(block.ravel())
    anchor = np.arange(3)
    matrix = sparse.coo_array(
        (
            np.concatenate([*values, np.full(3, 1e12)]),
            (np.concatenate([*rows, anchor]), np.concatenate([*columns, anchor])),
        ),
        shape=(size, size),
    ).tocsc()
    found: Floats = -spsolve(matrix, gradient.ravel(), permc_spec="MMD_AT_PLUS_A").reshape(-1, 3)
    return found
