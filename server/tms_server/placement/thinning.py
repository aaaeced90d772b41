"""Kernels on a finished set of hypotheses: its marginals, and thinning it to a budget. Shapes as in ``kernels``."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba import njit

I32 = np.int32


@njit(cache=True)
def marginals(rows: Any, w: Any, slots: int) -> Any:
    """Probability of every slot for every object in play: [K, S]."""
    p = np.zeros((rows.shape[1], slots))
    for h in range(rows.shape[0]):
        for k in range(rows.shape[1]):
            p[k, rows[h, k]] += w[h]
    return p


@njit(cache=True)
def pies(rows: Any, w: Any, slots: int, negligible: float) -> Any:
    """The marginals of every object in play, without what is below ``negligible``.

    Returns (ends [K], slots [n], probabilities [n]): those of column k stand before ends[k], after ends[k - 1].
    """
    p = marginals(rows, w, slots)
    n_k = p.shape[0]
    ends = np.empty(n_k, np.int64)
    found = np.empty(n_k * slots, I32)
    share = np.empty(n_k * slots)
    n = 0
    for k in range(n_k):
        for s in range(slots):
            if p[k, s] >= negligible:
                found[n] = s
                share[n] = p[k, s]
                n += 1
        ends[k] = n
    return ends, found[:n], share[:n]


@njit(cache=True)
def threshold(cw: Any, budget: int) -> Any:
    """Fearnhead and Clifford's c: sum of min(w / c, 1) = budget. Weights above c are kept as they are."""
    small = cw.copy()
    n = small.shape[0]
    above = 0
    c = small.sum() / budget
    while True:
        rest = 0.0
        left = 0
        # c falls from round to round, so that what is above it stays above: only the others are looked at again.
        for i in range(n):
            if small[i] <= c:
                small[left] = small[i]
                left += 1
                rest += small[i]
        above += n - left
        if left == n or above >= budget:
            return c
        n = left
        c = rest / (budget - above)


@njit(cache=True)
def thin(cw: Any, c: float, u: float, budget: int) -> Any:
    """Keep weights above c; of the others one per c of their cumulated weight, starting at u * c, at weight c.

    Returns indices [<= budget] in order and sets their weights in ``cw``.
    """
    room = budget
    for i in range(cw.shape[0]):
        if cw[i] > c:
            room -= 1
    keep = np.empty(budget, I32)
    n = 0
    point = u * c
    total = 0.0
    for i in range(cw.shape[0]):
        if cw[i] > c:
            keep[n] = i
            n += 1
        else:
            total += cw[i]
            if total > point and room > 0:
                room -= 1
                point += c
                cw[i] = c
                keep[n] = i
                n += 1
    return keep[:n]


@njit(cache=True)
def calibrate(rows: Any, w: Any, target: Any, sweeps: int) -> None:
    """Shift the weights of a thinned set, in place, towards the marginals [K, S] that it had before thinning.

    Parallel iterative scaling (Darroch and Ratcliff): all columns at once, so that no object is favoured.
    """
    n_h, n_k = rows.shape
    step = min(1.0, 2.0 / n_k)
    ratio = np.zeros(target.shape)
    for _ in range(sweeps):
        ratio[:] = 0.0
        for h in range(n_h):
            for k in range(n_k):
                ratio[k, rows[h, k]] += w[h]
        for k in range(n_k):
            for s in range(target.shape[1]):
                if ratio[k, s] > 0.0:
                    ratio[k, s] = step * math.log(max(target[k, s], 1e-300) / ratio[k, s])
        total = 0.0
        for h in range(n_h):
            x = 0.0
            for k in range(n_k):
                x += ratio[k, rows[h, k]]
            w[h] *= math.exp(x)
            total += w[h]
        for h in range(n_h):
            w[h] /= total
