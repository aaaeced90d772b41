"""A thing is put onto an edge first, and lifted from one: its load strays from the straight line, and is one still.

What that adds to the cells is linear in how far it strays, so that a likelihood is averaged over it in closed form.
"""

from __future__ import annotations

import numpy as np

from tms_agents.cabinet.geometry import Array, Geometry

#: So far from where it stands in the end it touches, and so far it wanders on its way (standard deviations).
_TILT_M, _WANDER_M = 0.015, 0.006


def pulls_of(path: Array, geometry: Geometry) -> Array:
    """What one deviation of each kind of wandering adds to the cells on the way, (n, k, 4) g, for one thing.

    It touches beside its place and comes nearer until it stands there, in x and in y, straight or on a bend.
    """
    way = (np.arange(len(path)) + 1.0) / (len(path) + 1.0)
    force = path.sum(axis=1)
    shapes = np.stack([_TILT_M * (1 - way), 4 * _WANDER_M * way * (1 - way)], axis=1) * force[:, None]
    aside = np.linalg.pinv(geometry.moments)[:, 1:]
    return np.asarray((shapes[:, None, :, None] * aside[None, :, None, :]).reshape(len(path), len(aside), 4))


def misfit(values: Array, pulls: Array, most: float = np.inf) -> float:
    """Twice the negative log-likelihood of ``values`` (n, m), noise one, with normal coefficients of ``pulls``.

    The misfit of one of the n counts at ``most`` so much.
    """
    basis, flat = pulls.reshape(-1, pulls.shape[-1]), values.reshape(-1)
    power = basis.T @ basis + np.eye(basis.shape[1])
    along = basis.T @ flat
    far = np.linalg.solve(power, along)
    left = ((flat - basis @ far).reshape(values.shape) ** 2).sum(axis=1)
    return float(np.minimum(left, most).sum() + far @ far + np.linalg.slogdet(power)[1])
