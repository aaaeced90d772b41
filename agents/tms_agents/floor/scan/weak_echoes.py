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
    heavy = np.empty(n)
    a, last, far, long_m = -1, -1, 0.0, 0.0
    for i in range(n + 1):
        r = 0.0
        if i < n:
            best = 0
            for j in range(1, k):
                if weight[i, j] > weight[i, best]:
                    best = j
            least[i], heavy[i], share = usual, weight[i, best], _MOST * (1.0 - empty[i])
            if share < heavy[i] < usual and times[i, best] >= _AGAIN:
                least[i] = 0.99 * heavy[i]
            if heavy[i] > seldom:
                r = centre[i, best]
            elif i - last <= _GAP:
                continue
        if a >= 0 and r > 0.0 and abs(r - far) < _SLANT_M * (i - last):
            long_m += r * step * (i - last)
        else:
            if a >= 0 and long_m > _WALL_M:
                for b in range(a, last + 1):
                    if seldom < heavy[b] <= least[b]:
                        least[b] = 0.99 * heavy[b]
            a, long_m = (i if r > 0.0 else -1), 0.0
        last, far = i, r
