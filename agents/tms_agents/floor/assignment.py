"""The linear assignment problem, small and compiled; and the next best if one row must not have what it has."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

Array = NDArray[np.float64]

#: Of a column that no row has.
_NOBODY = -1


@njit(cache=True)
def assign(cost: Array, of_row: NDArray[np.int64]) -> float:
    """Fill ``of_row`` (m,) with the column of each row of ``cost`` (m, n), m <= n, at the least sum: that sum."""
    m, n = cost.shape
    return float(solve(cost, of_row, np.empty(n, np.int64), np.empty(m), np.empty(n)))


@njit(cache=True)
def solve(cost: Array, of_row: NDArray[np.int64], of_column: NDArray[np.int64], u: Array, v: Array) -> float:
    """As `assign`; also the row of each column (n,), or `_NOBODY`, and what each row (m,) and column costs by itself.

    Shortest augmenting paths (Jonker and Volgenant 1987; Crouse 2016).
    """
    m, n = cost.shape
    u[:], v[:], of_row[:], of_column[:] = 0.0, 0.0, -1, _NOBODY
    path = np.full(n, -1)
    shortest = np.empty(n)
    in_rows, in_columns = np.empty(m, np.bool_), np.empty(n, np.bool_)
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
    return _total(cost, of_row)


@njit(cache=True)
def reassign(
    cost: Array,
    of_row: NDArray[np.int64],
    of_column: NDArray[np.int64],
    u: Array,
    v: Array,
    row: int,
    barred: int,
    most: float,
    other: NDArray[np.int64],
) -> float:
    """Fill ``other`` (m,) with the best assignment in which ``row`` has none of the columns ``barred`` and the next.

    Of what `solve` gave only one row must find another place: one shortest path to the column that it had, as if there
    were rows to which every column is free of charge, and one of them had each column that nobody has. Its sum, or
    infinity where that costs more than ``most`` more.
    """
    n = cost.shape[1]
    freed = of_row[row]
    path = np.full(n, _NOBODY)
    shortest = np.full(n, np.inf)
    reached = np.zeros(n, np.bool_)
    least, i, idle = 0.0, row, -1
    while not reached[freed]:
        best, lowest = -1, np.inf
        for j in range(n):
            if reached[j]:
                continue
            if i != row or not barred <= j <= barred + 1:
                reduced = least - v[j] if i == _NOBODY else least + cost[i, j] - u[i] - v[j]
                if reduced < shortest[j]:
                    path[j] = i
                    shortest[j] = reduced
            if shortest[j] < lowest:
                best, lowest = j, shortest[j]
        if lowest > most:
            return np.inf
        least = lowest
        reached[best] = True
        i = of_column[best]
        if i == _NOBODY and idle < 0:
            idle = best
    other[:] = of_row
    j = freed
    while True:
        i = path[j]
        if i == _NOBODY:
            j = idle
            continue
        j, other[i] = other[i], j
        if i == row:
            break
    return _total(cost, other)


@njit(cache=True)
def _total(cost: Array, of_row: NDArray[np.int64]) -> float:
    total = 0.0
    for i in range(of_row.size):
        total += cost[i, of_row[i]]
    return total
