"""How well the way of the load fits an outcome: on it the load is made of parts of what went and of what came."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from tms_agents.cabinet.geometry import Array, Geometry
from tms_agents.cabinet.wandering import misfit, pulls_of

#: How much of the way's likelihood counts, since its blocks err together.
WAY = 0.35
#: Misfit of a block that counts, and what a hand adds to a load in other directions.
_CAP, _HAND = 12.0, 0.03
#: A further direction that is free costs this much more than one that is known.
_FREE = 1.5


def way_odds(way: Sequence[tuple[Array, Array]], loads: Sequence[Array], geometry: Geometry, *, free: bool) -> float:
    """Log-likelihood of ``way``, means and variances (k,) of its blocks, up to what is the same for all outcomes.

    ``loads`` (k,) g are what may be there in part. ``free``: two have come of which only the sum is among them.
    """
    if not way:
        return 0.0
    path, variances = (np.array(values) for values in zip(*way, strict=True))
    sd = np.sqrt(variances + (_HAND**2 * (path**2).sum(axis=1) / path.shape[1])[:, None])
    common = np.sqrt((sd**2).mean(axis=0))
    weight = np.linalg.norm(common) / np.linalg.norm(sd, axis=1)
    scaled = path / common * weight[:, None]
    pulls = pulls_of(path, geometry) / common[:, None] * weight[:, None, None]
    rank = 0.0
    if loads:
        basis, size, _ = np.linalg.svd((np.array(loads) / common).T, full_matrices=False)
        basis = basis[:, size > 1e-3 * size[0]]
        scaled = scaled - (scaled @ basis) @ basis.T
        pulls = pulls - np.einsum("tkb,kr,lr->tlb", pulls, basis, basis)
        rank = float(basis.shape[1])
    if free and rank < path.shape[1]:
        _, vectors = np.linalg.eigh(scaled.T @ scaled)
        scaled = scaled - np.outer(scaled @ vectors[:, -1], vectors[:, -1])
        rank += _FREE
    # A direction that is free takes up what noise there is, not what a hand might have added.
    noise = float((variances.sum(axis=1) / (sd**2).sum(axis=1)).sum())
    return -0.5 * WAY * (misfit(scaled, pulls, _CAP) + rank * noise)
