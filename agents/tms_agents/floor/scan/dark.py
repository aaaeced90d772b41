"""What is black or glossy echoes here and there: how wide is the surface of which a few beams come back?"""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

Array = NDArray[np.float64]

#: The ranges of one surface differ so little (m) from one echo to the next, and from the background that it has become;
#: so many beams at most end at something thin before it.
_SAME_M, _LEARNED_M, _BEFORE = 0.15, 0.05, 4


@njit(cache=True)
def dark_width(first: int, last: int, near: float, ranges: Array, longest: Array, step: float) -> float:
    """How wide (m) that is of which the beams ``first`` to ``last`` have met a part at ``near`` m.

    Beams beside them belong to it that meet it, too, or bring nothing although the background there does: ranges,
    longest (n,) m, ``step`` rad from beam to beam. Of something small all beams but its own go past it.
    """
    low, high = first, last
    for way in (-1, 1):
        r, hidden, i = near, 0, (first if way < 0 else last) + way
        while 0 <= i < ranges.size and hidden <= _BEFORE:
            learned = ranges[i] > longest[i] - _SAME_M
            met = abs(ranges[i] - r) < (_LEARNED_M if learned else _SAME_M)
            silent = not np.isfinite(ranges[i]) and np.isfinite(longest[i]) and longest[i] > near
            if met or silent:
                r, hidden = (ranges[i] if met else r), 0
                low, high = min(low, i), max(high, i)
            elif ranges[i] < r - _SAME_M:
                hidden += 1
            else:
                break
            i += way
    return float((high - low + 1) * abs(step) * near)
