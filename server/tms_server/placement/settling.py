"""From the children of an event to the next set of hypotheses, compiled: merged, normalised, written out as rows.

Shapes and the notion of a *child* are those of ``kernels``.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit

I32 = np.int32
U64 = np.uint64


@njit(cache=True)
def settle(
    rows: Any, cols: Any, col_of: Any, pinned: Any, parent: Any, obj: Any, to: Any, cw: Any, cz: Any, merging: bool
) -> Any:  # fmt: skip
    """Merge children (where they may coincide), normalise them, write them out as rows.

    Returns (total mass, w, hashes, rows, cols, touched), see ``build``; a total of 0 changes nothing.
    """
    n = parent.shape[0]
    if merging and n > 1:
        n = merge(rows, cols, col_of, pinned, parent, obj, to, cw, cz, n)
    w = cw[:n].copy()
    total = w.sum()
    if not total > 0.0:
        return 0.0, w, cz[:n], rows, cols, cols[:0]
    w /= total
    new_rows, new_cols, touched = build(rows, cols, col_of, pinned, parent[:n], obj[:n], to[:n])
    return total, w, cz[:n].copy(), new_rows, new_cols, touched


@njit(cache=True)
def merge(
    rows: Any, cols: Any, col_of: Any, pinned: Any, parent: Any, obj: Any, to: Any, cw: Any, cz: Any, n: int
) -> int:
    """Add up the weights of children with the same placement, in place; the first one stands. Returns their number."""
    size = 16
    while size < 2 * n:
        size *= 2
    mask = U64(size - 1)
    table = np.full(size, -1, I32)
    kept = 0
    for c in range(n):
        at = np.int64((cz[c] ^ (cz[c] >> U64(32))) & mask)
        while True:
            other = table[at]
            if other < 0:
                table[at] = kept
                if kept != c:
                    parent[kept], obj[kept], to[kept] = parent[c], obj[c], to[c]
                    cw[kept], cz[kept] = cw[c], cz[c]
                kept += 1
                break
            if cz[other] == cz[c] and _same(rows, cols, col_of, pinned, parent, obj, to, other, c):
                cw[other] += cw[c]
                break
            at = (at + 1) & np.int64(mask)
    return kept


@njit(cache=True)
def _same(rows: Any, cols: Any, col_of: Any, pinned: Any, parent: Any, obj: Any, to: Any, a: int, b: int) -> bool:
    """Whether two children are the same placement, object by object."""
    oa, ob = obj[a], obj[b]
    for k in range(cols.shape[0]):
        i = cols[k]
        va = to[a] if oa == i else rows[parent[a], k]
        vb = to[b] if ob == i else rows[parent[b], k]
        if va != vb:
            return False
    if oa >= 0 and col_of[oa] < 0 and to[a] != (to[b] if ob == oa else pinned[oa]):
        return False
    return not (ob >= 0 and col_of[ob] < 0 and to[b] != (to[a] if oa == ob else pinned[ob]))


@njit(cache=True)
def build(rows: Any, cols: Any, col_of: Any, pinned: Any, parent: Any, obj: Any, to: Any) -> Any:
    """Write the children out as rows; objects that became certain leave play, those that are not any more enter it.

    Updates col_of and pinned. Returns (rows, cols, touched): columns are in the order of the objects; touched are the
    objects that were in play or moved.
    """
    n = parent.shape[0]
    n_k = cols.shape[0]
    most = n_k
    for c in range(n):
        i = obj[c]
        if i >= 0 and col_of[i] == -1:
            col_of[i] = -2
            most += 1
    entering = np.empty(most, I32)
    m = 0
    for k in range(n_k):
        entering[m] = cols[k]
        m += 1
    for c in range(n):
        i = obj[c]
        if i >= 0 and col_of[i] == -2:
            col_of[i] = -3
            entering[m] = i
            m += 1
    entering.sort()
    source = np.empty(most, I32)
    for k in range(most):
        source[k] = col_of[entering[k]]
    for k in range(most):
        col_of[entering[k]] = k
    full = np.empty((n, most), I32)
    for c in range(n):
        h = parent[c]
        for k in range(most):
            s = source[k]
            full[c, k] = rows[h, s] if s >= 0 else pinned[entering[k]]
        if obj[c] >= 0:
            full[c, col_of[obj[c]]] = to[c]
    varies = np.zeros(most, np.bool_)
    left = most
    for c in range(1, n):
        if left == 0:
            break
        for k in range(most):
            if not varies[k] and full[c, k] != full[0, k]:
                varies[k] = True
                left -= 1
    kept = most - left
    new_cols = np.empty(kept, I32)
    m = 0
    for k in range(most):
        i = entering[k]
        if varies[k]:
            new_cols[m] = i
            col_of[i] = m
            pinned[i] = -1
            m += 1
        else:
            col_of[i] = -1
            pinned[i] = full[0, k]
    if kept == most:
        return full, new_cols, entering
    out = np.empty((n, kept), I32)
    for c in range(n):
        m = 0
        for k in range(most):
            if varies[k]:
                out[c, m] = full[c, k]
                m += 1
    return out, new_cols, entering
