"""What of a background is believed though it seldom echoes: dark or distant walls."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

Array = NDArray[np.float64]

#: What is faint, because it is dark or far, echoes less often; it is believed if it weighs so much and goes on for so
#: long (m), differs so little from beam to beam (m), and at most so many beams between bring nothing.
FAINT, _WALL_M, _SLANT_M, _GAP = 0.002, 0.8, 0.1, 3
#: So is what comes back mostly, in this share of the echoes, so many times, each so long (s) after the one before.
_MOST, _AGAIN, LATER_S = 0.5, 5, 2.0


@njit(cache=True)
def believe(
    centre: Array, weight: Array, empty: Array, times: Array, usual: float, seldom: float, step: float, least: Array
) -> None:
    """Fill ``least`` (n,): what components must weigh to be believed, ``usual`` or what the heaviest has, if it is
    more than ``seldom`` and a part of a long surface, or most of what ever comes back, again and again.

    centre, weight, times: (n, k) components, m; empty: (n,) weight of no echo; step: rad between beams.
    """
    n, k = centre.shape
    a, last, far, long_m = -1, -1, 0.0, 0.0
    for i in range(n + 1):
        r, most = 0.0, seldom
        if i < n:
            least[i] = usual
            for j in range(k):
                if times[i, j] >= _AGAIN and weight[i, j] > _MOST * (1.0 - empty[i]):
                    least[i] = min(usual, 0.99 * weight[i, j])
                if weight[i, j] > most:
                    r, most = centre[i, j], weight[i, j]
            if r == 0.0 and i - last <= _GAP:
                continue
        if a >= 0 and r > 0.0 and abs(r - far) < _SLANT_M * (i - last):
            long_m += r * step * (i - last)
        else:
            if a >= 0 and long_m > _WALL_M:
                for b in range(a, last + 1):
                    heaviest = weight[b].max()
                    if seldom < heaviest <= least[b]:
                        least[b] = 0.99 * heaviest
            a, long_m = (i if r > 0.0 else -1), 0.0
        last, far = i, r
