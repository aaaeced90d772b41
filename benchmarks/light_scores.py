"""Errors of a path whose truth is known."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from tms_agents.slam.geometry import Floats, between, compose

#: Two visits of the same place are so near (m) and so far apart in time (s).
_NEAR_M, _LATER_S = 0.5, 30.0


@dataclass(frozen=True, slots=True)
class Errors:
    """Root mean squares in m: ``longitudinal`` along the true heading with the first poses laid on one another,
    ``best`` of the position with the paths laid on one another as well as possible, ``revisit`` of the relative pose
    between two visits of the same place (NaN if there are none)."""

    longitudinal: float
    best: float
    revisit: float


def errors(t: Floats, truth: Floats, path: Floats) -> Errors:
    """Of ``path`` (S, 3), where ``truth`` (S, 3) was the case, at the times ``t`` (S,)."""
    start = np.broadcast_to(truth[0], truth.shape)
    laid = compose(start, between(np.broadcast_to(path[0], path.shape), path))
    off = laid[:, :2] - truth[:, :2]
    along = np.cos(truth[:, 2]) * off[:, 0] + np.sin(truth[:, 2]) * off[:, 1]
    pairs = cKDTree(truth[:, :2]).query_pairs(_NEAR_M, output_type="ndarray")
    pairs = pairs[np.abs(t[pairs[:, 0]] - t[pairs[:, 1]]) > _LATER_S]
    revisit = float("nan")
    if len(pairs):
        a, b = pairs.T
        apart = between(between(truth[a], truth[b]), between(path[a], path[b]))
        revisit = float(np.sqrt(np.square(apart[:, :2]).sum(axis=1).mean()))
    return Errors(
        float(np.sqrt(np.square(along).mean())),
        float(np.sqrt(np.square(_best(path[:, :2], truth[:, :2])).sum(axis=1).mean())),
        revisit,
    )


def _best(points: Floats, targets: Floats) -> Floats:
    """(S, 2) what is left of the differences after the rigid motion of least squares."""
    a, b = points - points.mean(axis=0), targets - targets.mean(axis=0)
    turn = np.arctan2((a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]).sum(), (a * b).sum())
    c, s = np.cos(turn), np.sin(turn)
    left: Floats = a @ np.array([[c, s], [-s, c]]) - b
    return left
