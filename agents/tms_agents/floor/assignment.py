"""The linear assignment problem, small and compiled."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

Array = NDArray[np.float64]


@njit(cache=True)
def assign(cost: Array, of_row: NDArray[np.int64]) -> float:
    """Fill ``of_row`` (m,) with the column of each row of ``cost`` (m, n), m <= n, at the least sum: that sum.

    Shortest augmenting paths (Jonker and Volgenant 1987; Crouse 2016).
    """
    m, n = cost.shape
    u, v = np.zeros(m), np.zeros(n)
    of_column = np.full(n, -1)
    path = np.full(n, -1)
    shortest = np.empty(n)
    in_rows, in_columns = np.empty(m, np.bool_), np.empty(n, np.bool_)
    of_row[:] = -1
    for start in range(m):
        shortest[:] = np.inf
        in_rows[:] = False
        in_columns[:] = False
        least, i, sink = 0.0, start, -1
        while sink < 0:
            in_rows[i] = True
            best, lowest = -1, np.inf
            for j in range(n):
                if in_columns[j]:
                    continue
                reduced = least + cost[i, j] - u[i] - v[j]
                if reduced < shortest[j]:
                    path[j] = i
                    shortest[j] = reduced
                if shortest[j] < lowest or (shortest[j] == lowest and of_column[j] < 0):
                    best, lowest = j, shortest[j]
            least = lowest
            if of_column[best] < 0:
                sink = best
            else:
                i = of_column[best]
            in_columns[best] = True
        u[start] += least
        for i in range(m):
            if in_rows[i] and i != start:
                u[i] += least - shortest[of_row[i]]
        for j in range(n):
            if in_columns[j]:
                v[j] -= least - shortest[j]
        j = sink
        while True:
            i = path[j]
            of_column[j] = i
            j, of_row[i] = of_row[i], j
            if i == start:
                break
    total = 0.0
    for i in range(m):
        total += cost[i, of_row[i]]
    return total
