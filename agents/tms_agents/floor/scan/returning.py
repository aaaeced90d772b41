"""What had gone from the background and is seen there again: the same, if it comes back whole."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

Array = NDArray[np.float64]

#: A surface whose place has been looked past for so long (s) has gone.
GONE_S = 2.5
#: The ranges of one surface differ so little from beam to beam (m).
_SURFACE_M = 0.05


@njit(cache=True)
def whole(
    ranges: Array,
    centre: Array,
    weight: Array,
    missing: Array,
    foreground: int,
    states: NDArray[np.int8],
    back: NDArray[np.bool_],
) -> None:
    """What had gone comes back whole: else something new lies where it was, and its ``states`` (n,) are ``foreground``.

    ``back`` (n,): which beams show nothing but what had gone; the rest as in `background`.
    """
    n = ranges.size
    a = 0
    while a < n:
        if not back[a]:
            a += 1
            continue
        b = a
        while b + 1 < n and back[b + 1] and abs(ranges[b + 1] - ranges[b]) < _SURFACE_M:
            b += 1
        new = False
        for edge, side in ((a, -1), (b, 1)):
            r = ranges[edge]
            past, beside = True, edge + side
            surface = _gone_near(centre, weight, missing, edge, r)
            for i in (beside, beside + side):
                # The rest of its surface, aslant or not, is still looked past.
                surface = _gone_near(centre, weight, missing, i, surface)
                past = past and 0 <= i < n and ranges[i] > surface + _SURFACE_M
            wider = 0 <= beside < n and states[beside] == foreground and abs(ranges[beside] - r) < _SURFACE_M
            new = new or past or wider
        if new:
            states[a : b + 1] = foreground
        a = b + 1


@njit(cache=True)
def _gone_near(centre: Array, weight: Array, missing: Array, i: int, r: float) -> float:
    """Where (m) something was that has gone, seen by beam i near the range r: infinity where nothing was.

    However seldom it was seen: what is behind it is soon believed instead.
    """
    found, nearest = np.inf, _SURFACE_M
    if 0 <= i < centre.shape[0]:
        for j in range(centre.shape[1]):
            gap = abs(centre[i, j] - r)
            if weight[i, j] > 0.0 and missing[i, j] > GONE_S and gap < nearest:
                found, nearest = centre[i, j], gap
    return found
