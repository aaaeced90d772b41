"""Components of what a beam sees when nothing is there: how sharp they are at best, and new ones."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

Array = NDArray[np.float64]

#: No range finder of this class is better than this (m, and per metre); residuals seldom tell less.
SIGMA_M, SIGMA_PER_M = 0.003, 0.0012


@njit(cache=True)
def adopt(
    beams: NDArray[np.int64],
    ranges: Array,
    share: float,
    threshold: float,
    centre: Array,
    sigma: Array,
    weight: Array,
    empty: Array,
    missing: Array,
    times: Array,
    seen_at: Array,
    seconds: float,
) -> None:
    """Make ``ranges`` (m,) m, seen now, the background of ``beams`` (m,) with the weight ``share``, in place.

    A component that is there already weighs so much at least; else the one that weighs least is replaced.
    """
    for b in range(beams.size):
        i, r = beams[b], ranges[b]
        target, known = 0, False
        for j in range(centre.shape[1]):
            if weight[i, j] > 0.0 and abs(r - centre[i, j]) < threshold:
                target, known = j, True
                break
            if weight[i, j] < weight[i, target]:
                target = j
        missing[i, target] = 0.0
        if known and weight[i, target] >= share:
            continue
        if not known:
            times[i, target], seen_at[i, target] = 1.0, seconds
        for j in range(centre.shape[1]):
            weight[i, j] *= 1.0 - share
        empty[i] *= 1.0 - share
        centre[i, target], weight[i, target] = r, share
        sigma[i, target] = 2.0 * (SIGMA_M + SIGMA_PER_M * r)
