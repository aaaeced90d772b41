"""The linear assignment problem, small and compiled; and the next best if one row must not have what it has."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

Array = NDArray[np.float64]
Integers = NDArray[np.int64]

#: Of a column that no row has.
_NOBODY = -1


class Work(NamedTuple):
    """What `solve` leaves for `reassign`, of a table of m rows and n columns at most: `one_of` those that `work` makes.

    columns (m, n) that each row may have, so many (counts (m,)); of_column (n,) the row of each column, or `_NOBODY`;
    u (m,), v (n,) what each row and column costs by itself. Of a search: from which row (path (n,)) and how far
    (shortest (n,)) the columns are that it has met, and which it has reached: of none between searches.
    """

    columns: Integers
    counts: Integers
    of_column: Integers
    u: Array
    v: Array
    path: Integers
    shortest: Array
    met: Integers
    reached: NDArray[np.bool_]


@njit(cache=False)
def work(count: int, m: int, n: int) -> Work:
    """For so many tables of m rows and n columns at most: `one_of` them."""
    # Not cached: loaded from a cache after a kernel that contains it, what gives Python a named tuple crashes.
    columns, counts = np.empty((count, m, n), np.int64), np.empty((count, m), np.int64)
    of_column, u, v = np.empty((count, n), np.int64), np.empty((count, m)), np.empty((count, n))
    path, met = np.empty((1, n), np.int64), np.empty((1, n), np.int64)
    shortest, reached = np.full((1, n), np.inf), np.zeros((1, n), np.bool_)
    return Work(columns, counts, of_column, u, v, path, shortest, met, reached)


@njit(cache=True, inline="always")
def one_of(several: Work, h: int) -> Work:
    """Of what is there for ``several`` tables what belongs to table h: searches in all of them share the rest."""
    columns, counts, of_column = several.columns[h], several.counts[h], several.of_column[h]
    u, v = several.u[h], several.v[h]
    return Work(
        columns, counts, of_column, u, v, several.path[0], several.shortest[0], several.met[0], several.reached[0]
    )


@njit(cache=True)
def assign(cost: Array, shared: int, most: float, of_row: Integers) -> float:
    """Fill ``of_row`` (m,) with the column of each row of ``cost`` (m, n), m <= n, at the least sum: that sum.

    Of the first ``shared`` columns each row may have those in which it costs less than ``most``, and of the others, if
    there are any, its own: the first is that of the first row. There must be a solution.
    """
    return float(solve(cost, shared, most, of_row, one_of(work(1, cost.shape[0], cost.shape[1]), 0)))


@njit(cache=True)
def solve(cost: Array, shared: int, most: float, of_row: Integers, w: Work) -> float:
    """As `assign`: shortest augmenting paths (Jonker and Volgenant 1987; Crouse 2016)."""
    m, n = cost.shape
    _allow(cost, shared, most, w)
    u, v, of_column, path, shortest, met, reached = w.u, w.v, w.of_column, w.path, w.shortest, w.met, w.reached
    u[:m], v[:n], of_row[:], of_column[:n] = 0.0, 0.0, -1, _NOBODY
    for start in range(m):
        best, lowest = _cheapest(cost, w, start, -1)
        if of_column[best] < 0:
            # Most rows get what they would like best.
            u[start], of_row[start], of_column[best] = lowest, best, start
            continue
        least, i, sink, many = 0.0, start, -1, 0
        while sink < 0:
            for o in range(w.counts[i]):
                j = w.columns[i, o]
                many = _approach(j, i, least + cost[i, j] - u[i] - v[j], w, many)
            best, least = _nearest(w, many, True)
            reached[best] = True
            if of_column[best] < 0:
                sink = best
            else:
                i = of_column[best]
        u[start] += least
        for o in range(many):
            j = met[o]
            if reached[j]:
                if of_column[j] >= 0:
                    u[of_column[j]] += least - shortest[j]
                v[j] -= least - shortest[j]
        _forget(w, many)
        j = sink
        while True:
            i = path[j]
            of_column[j] = i
            j, of_row[i] = of_row[i], j
            if i == start:
                break
    return _total(cost, of_row)


@njit(cache=True)
def at_least(cost: Array, row: int, barred: int, w: Work) -> float:
    """After `solve`: what it costs more at least if ``row`` has neither the column ``barred`` nor the next."""
    return float(_cheapest(cost, w, row, barred)[1] - w.u[row])


@njit(cache=True)
def reassign(cost: Array, of_row: Integers, row: int, barred: int, most: float, other: Integers, w: Work) -> float:
    """Fill ``other`` (m,) with the best assignment in which ``row`` has none of the columns ``barred`` and the next.

    Of what `solve` gave only one row must find another place: one shortest path to the column that it had, as if there
    were rows to which every column is free of charge, and one of them had each column that nobody has. Its sum, or
    infinity where that costs more than ``most`` more.
    """
    of_column, u, v, path = w.of_column, w.u, w.v, w.path
    freed = of_row[row]
    best, lowest = _cheapest(cost, w, row, barred)
    if lowest - u[row] > most:
        return np.inf
    for i in range(of_row.size):
        other[i] = of_row[i]
    if of_column[best] < 0 and v[freed] == 0.0:
        other[row] = best
        return _total(cost, other)
    least, i, best, idle, many = 0.0, row, -1, -1, 0
    while best != freed and least <= most:
        if i != _NOBODY:
            for o in range(w.counts[i]):
                j = w.columns[i, o]
                if i != row or not barred <= j <= barred + 1:
                    many = _approach(j, i, least + cost[i, j] - u[i] - v[j], w, many)
        elif idle < 0:
            idle = best
            if v[freed] == 0.0:
                # Nothing is nearer.
                path[freed] = _NOBODY
                break
            for j in range(cost.shape[1]):
                # From another column that nobody has, nothing is nearer than from this one.
                if of_column[j] != _NOBODY:
                    many = _approach(j, _NOBODY, least - v[j], w, many)
        best, least = _nearest(w, many, False)
        w.reached[best] = True
        i = of_column[best]
    _forget(w, many)
    if least > most:
        return np.inf
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
def _allow(cost: Array, shared: int, most: float, w: Work) -> None:
    """Note which columns each row may have."""
    m, n = cost.shape
    for i in range(m):
        count = 0
        for j in range(shared):
            if cost[i, j] < most:
                w.columns[i, count] = j
                count += 1
        if shared + i < n:
            w.columns[i, count] = shared + i
            count += 1
        w.counts[i] = count


@njit(cache=True, inline="always")
def _cheapest(cost: Array, w: Work, i: int, barred: int) -> tuple[int, float]:
    """The column that row i would like best, neither of the two that are ``barred`` (-1: none), and what it costs."""
    best, lowest = -1, np.inf
    for o in range(w.counts[i]):
        j = w.columns[i, o]
        if barred < 0 or not barred <= j <= barred + 1:
            reduced = cost[i, j] - w.v[j]
            if reduced < lowest or (reduced == lowest and _goes_first(j, best, w.of_column, barred < 0)):
                best, lowest = j, reduced
    return best, lowest


@njit(cache=True, inline="always")
def _goes_first(j: int, other: int, of_column: Integers, idle: bool) -> bool:
    """Which of two columns that are equally near is the next: the first, or the last that is ``idle``, if wanted."""
    if idle and (of_column[j] < 0 or of_column[other] < 0):
        return bool(of_column[j] < 0 and (j > other or of_column[other] >= 0))
    return j < other


@njit(cache=True, inline="always")
def _approach(j: int, i: int, length: float, w: Work, many: int) -> int:
    """The column j may be reached from row i on a path so long: how many columns have been met."""
    if not w.reached[j] and length < w.shortest[j]:
        if w.shortest[j] == np.inf:
            w.met[many] = j
            many += 1
        w.path[j] = i
        w.shortest[j] = length
    return many


@njit(cache=True, inline="always")
def _nearest(w: Work, many: int, idle: bool) -> tuple[int, float]:
    """The nearest column that is not reached, and how long the path to it is."""
    best, lowest = -1, np.inf
    for o in range(many):
        j = w.met[o]
        length = w.shortest[j]
        nearer = length < lowest or (length == lowest and _goes_first(j, best, w.of_column, idle))
        if nearer and not w.reached[j]:
            best, lowest = j, length
    return best, lowest


@njit(cache=True)
def _forget(w: Work, many: int) -> None:
    """The search is over."""
    for o in range(many):
        w.shortest[w.met[o]], w.reached[w.met[o]] = np.inf, False


@njit(cache=True)
def _total(cost: Array, of_row: Integers) -> float:
    total = 0.0
    for i in range(of_row.size):
        total += cost[i, of_row[i]]
    return total
