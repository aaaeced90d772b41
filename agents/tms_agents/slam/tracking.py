"""Particles moved to where the scan fits a known map: the improved proposal, of many particles in one map."""

from __future__ import annotations

import numpy as np
from numba import njit, prange

from tms_agents.slam.geometry import Bytes, Floats, Ints, wrapped
from tms_agents.slam.known import KnownMap
from tms_agents.slam.matching import match


def matched(
    known: KnownMap, points: Floats, starts: Floats, priors: Floats, precision: Floats, sigma_m: float
) -> tuple[Floats, Floats, Floats]:
    """Each of ``starts`` (N, 3) moved to the best fit of ``points`` (M, 2) under ``priors`` (N, 3) with ``precision``
    (N, 3, 3).

    Returns poses (N, 3), inverse covariances (N, 3, 3) there, and the logarithm (N,) of what prior and curvature say
    of the volume around them (Laplace; Grisetti, Stachniss, Burgard 2007).
    """
    n = len(starts)
    poses, hessians, results = np.empty((n, 3)), np.empty((n, 3, 3)), np.empty((n, 3))
    _match_known(
        known.directory, known.tiles, known.metres, known.frame, points, starts, priors, precision, sigma_m,
        poses, hessians, results,
    )  # fmt: skip
    away = poses - priors
    away[:, 2] = wrapped(away[:, 2])
    pulled = np.einsum("ni,nij,nj->n", away, precision, away)
    volume = np.linalg.slogdet(precision)[1] - np.linalg.slogdet(hessians)[1]
    return poses, hessians, 0.5 * (volume - pulled)


@njit(cache=True, parallel=True)
def _match_known(
    directory: Ints,
    tiles: Bytes,
    metres: Floats,
    frame: Floats,
    points: Floats,
    starts: Floats,
    priors: Floats,
    precision: Floats,
    sigma: float,
    poses: Floats,
    hessians: Floats,
    results: Floats,
) -> None:
    for n in prange(len(starts)):
        match(
            directory, tiles, metres, frame, points, starts[n], priors[n], precision[n], sigma, 1.0,
            poses[n], hessians[n], results[n],
        )  # fmt: skip
