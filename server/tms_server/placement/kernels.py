"""The hot loops of the belief engine on plain arrays, compiled by numba.

Shapes: H hypotheses, K objects in play (columns), N objects, S label slots, C children of an event.

    rows    int32 [H, K]   slot of each object in play, per hypothesis
    w       float64 [H]    weight, sums to 1
    zob     uint64 [H]     incremental Zobrist-like hash of the placement
    cols    int32 [K]      object of each column
    pinned  int32 [N]      slot of each object that is certain; -1 while it is in play

A *child* is a hypothesis after the event, written as its parent row with at most one object moved: (parent, obj,
to, weight, hash), obj = -1 where nothing moved; ``settling`` makes the next set of them.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba import njit

#: The slot of OUT, as in ``labels``.
OUT_SLOT = 0
I32 = np.int32
U64 = np.uint64
_GOLDEN = U64(0x9E3779B97F4A7C15)
_MIX1 = U64(0xBF58476D1CE4E5B9)
_MIX2 = U64(0x94D049BB133111EB)


@njit(cache=True)
def zobrist(obj: int, slot: int) -> Any:
    """The hash of "object at slot": splitmix64 of the pair, so that no table is needed."""
    z = (U64(obj) << U64(32)) ^ U64(slot)
    z = z * _GOLDEN + _GOLDEN
    z = (z ^ (z >> U64(30))) * _MIX1
    z = (z ^ (z >> U64(27))) * _MIX2
    return z ^ (z >> U64(31))


@njit(cache=True)
def content_likelihoods(
    weight_g: Any, weight_sd: Any, size_m: Any, p_read: Any, tagged: Any,
    read: int, alpha: float, n_tags: int, grams: float, sd_g: float, range_g: float,
    width: float, sd_m: float, range_m: float,
) -> Any:  # fmt: skip
    """Likelihood of a reading given what is at the label: [N + 1], the last for EMPTY.

    ``read``: index of the object whose tag was read, -1 reader saw nothing, -2 no reader. ``grams`` and ``width``
    are NaN where not measured. Registered weight (g) and size (m) are NaN where unknown.
    """
    n = p_read.shape[0]
    out = np.ones(n + 1)
    for i in range(n + 1):
        empty = i == n
        f = 1.0
        if read >= 0:
            if empty:
                f = (1.0 - alpha) / n_tags
            elif not tagged[i]:
                f = 0.0
            elif i == read:
                f = p_read[i] * alpha
            else:
                f = p_read[i] * (1.0 - alpha) / max(n_tags - 1, 1)
        elif read == -1:
            if empty:
                f = alpha
            elif tagged[i]:
                f = 1.0 - p_read[i]
        if not math.isnan(grams):
            if empty or math.isnan(weight_g[i]):
                f *= 1.0 / range_g
            else:
                v = sd_g * sd_g + weight_sd[i] * weight_sd[i]
                d = grams - weight_g[i]
                f *= math.exp(-0.5 * d * d / v) / math.sqrt(2.0 * math.pi * v)
        if not math.isnan(width):
            if empty or math.isnan(size_m[i]):
                f *= 1.0 / range_m
            else:
                v = sd_m * sd_m
                d = width - size_m[i]
                f *= math.exp(-0.5 * d * d / v) / math.sqrt(2.0 * math.pi * v)
        out[i] = f
    return out


@njit(cache=True)
def give(
    rows: Any, w: Any, zob: Any, cols: Any, pinned: Any,
    candidates: Any, logk: Any, near: Any, dest: Any, holding: bool, u: float, stay: float, idle_to_stay: bool,
    p_jump: float, shelf: Any, new: int, from_outside: bool, lik: Any,
) -> Any:  # fmt: skip
    """Children of "somebody gave one of the things he holds": appear and hand-over.

    candidates [Q]: slots of those who may have given. logk [Q]: log kernel of each. near [Q]: 1 inside the gate, 0
    outside, 2 not subject to it. dest [Q]: where a thing of that candidate goes. ``holding``: only those who hold
    something count. ``u`` mass of the giving, ``stay`` mass of nothing moving; an empty-handed candidate's mass is
    lost, or joins ``stay`` if ``idle_to_stay``. With ``p_jump`` a thing on the ``shelf`` [S + 1] (not ``new``) or at
    OUT goes to dest[0]; ``from_outside``: only one at OUT. lik [N + 1]: likelihood of the content of the label after
    the event.

    Returns (parent, obj, to, weight, hash, count).
    """
    n_h, n_k = rows.shape
    n_q = candidates.shape[0]
    cand_of = np.full(shelf.shape[0], -1, I32)
    for q in range(n_q):
        cand_of[candidates[q]] = q
    jumpable = np.zeros(shelf.shape[0], np.bool_)
    if p_jump > 0.0:
        if not from_outside:
            jumpable[:] = shelf
        jumpable[OUT_SLOT] = True
        jumpable[new] = False
    n_pinned = np.zeros(n_q, np.int64)
    pin_obj = np.empty(pinned.shape[0], I32)
    jump_obj = np.empty(pinned.shape[0], I32)
    pins = 0
    jumps = 0
    for i in range(pinned.shape[0]):
        slot = pinned[i]
        if slot < 0:
            continue
        if cand_of[slot] >= 0:
            n_pinned[cand_of[slot]] += 1
            pin_obj[pins] = i
            pins += 1
        if jumpable[slot]:
            jump_obj[jumps] = i
            jumps += 1

    room = n_h * (1 + n_k + pins + jumps)
    parent = np.empty(room, I32)
    obj = np.empty(room, I32)
    to = np.empty(room, I32)
    cw = np.empty(room)
    cz = np.empty(room, U64)
    empty = lik[lik.shape[0] - 1]
    kernel = np.exp(logk - logk.max()) if n_q > 0 else logk
    p = np.zeros(n_q)
    held = np.zeros(n_q, np.int64)
    if not holding and n_q > 0:
        _normalise(logk, kernel, near, held, False, p)
    n = 0
    for h in range(n_h):
        wh = w[h]
        zh = zob[h]
        for q in range(n_q):
            held[q] = n_pinned[q]
        n_jump = jumps
        for k in range(n_k):
            slot = rows[h, k]
            q = cand_of[slot]
            if q >= 0:
                held[q] += 1
            elif jumpable[slot]:
                n_jump += 1
        still = stay
        if n_q == 0 or (holding and not _normalise(logk, kernel, near, held, True, p)):
            still += u
        if idle_to_stay:
            for q in range(n_q):
                if held[q] == 0:
                    still += u * p[q]
        if p_jump > 0.0 and n_jump == 0:
            still += p_jump
        m = wh * still * empty
        if m > 0.0:
            parent[n], obj[n], to[n], cw[n], cz[n] = h, -1, -1, m, zh
            n += 1
        for k in range(n_k):
            slot = rows[h, k]
            q = cand_of[slot]
            if q >= 0:
                i = cols[k]
                m = wh * u * p[q] / held[q] * lik[i]
                d = dest[q]
            elif jumpable[slot]:
                i = cols[k]
                m = wh * p_jump / n_jump * lik[i]
                d = dest[0]
            else:
                continue
            if m > 0.0:
                parent[n], obj[n], to[n], cw[n] = h, i, d, m
                cz[n] = zh ^ zobrist(i, slot) ^ zobrist(i, d)
                n += 1
        for j in range(pins):
            i = pin_obj[j]
            q = cand_of[pinned[i]]
            m = wh * u * p[q] / held[q] * lik[i]
            if m > 0.0:
                parent[n], obj[n], to[n], cw[n] = h, i, dest[q], m
                cz[n] = zh ^ zobrist(i, pinned[i]) ^ zobrist(i, dest[q])
                n += 1
        for j in range(jumps):
            i = jump_obj[j]
            m = wh * p_jump / n_jump * lik[i]
            if m > 0.0:
                parent[n], obj[n], to[n], cw[n] = h, i, dest[0], m
                cz[n] = zh ^ zobrist(i, pinned[i]) ^ zobrist(i, dest[0])
                n += 1
    return parent, obj, to, cw, cz, n


@njit(cache=True)
def _normalise(logk: Any, kernel: Any, near: Any, held: Any, only_held: bool, p: Any) -> bool:
    """p [Q] := kernel over the (feasible) candidates, zero beyond the gate unless nobody is inside it.

    ``kernel`` is exp(logk - max(logk)), for all rows once; only where all feasible ones are so far away that it
    underflows are they scaled anew.
    """
    inside = False
    some = False
    for q in range(logk.shape[0]):
        if (not only_held or held[q] > 0) and near[q] == 1:
            inside = True
    total = 0.0
    for q in range(logk.shape[0]):
        p[q] = 0.0
        if (not only_held or held[q] > 0) and (near[q] != 0 or not inside) and logk[q] > -np.inf:
            p[q] = kernel[q]
            total += kernel[q]
            some = True
    if not some:
        return False
    if total < 1e-200:
        top = -np.inf
        for q in range(logk.shape[0]):
            if (not only_held or held[q] > 0) and (near[q] != 0 or not inside):
                top = max(top, logk[q])
        total = 0.0
        for q in range(logk.shape[0]):
            if (not only_held or held[q] > 0) and (near[q] != 0 or not inside):
                p[q] = math.exp(logk[q] - top)
                total += p[q]
    for q in range(logk.shape[0]):
        p[q] /= total
    return True


@njit(cache=True)
def spread(
    rows: Any, w: Any, zob: Any, cols: Any,
    src: int, only: int, pin_obj: int, pin_slot: int, dest: Any, p_dest: Any, p_stay: float, lik: Any,
) -> Any:  # fmt: skip
    """Children of "the object at ``src`` went somewhere": vanish and enter; with no dest, a mere reading.

    ``only`` >= 0 looks at that object alone; pin_obj >= 0: the (certain) object in question, at pin_slot. lik [N + 1]
    weighs the content before the event. Returns (parent, obj, to, weight, hash, count).
    """
    n_h, n_k = rows.shape
    room = n_h * (1 + dest.shape[0])
    parent = np.empty(room, I32)
    obj = np.empty(room, I32)
    to = np.empty(room, I32)
    cw = np.empty(room)
    cz = np.empty(room, U64)
    n = 0
    for h in range(n_h):
        i = pin_obj
        slot = pin_slot
        if pin_obj < 0:
            for k in range(n_k):
                if rows[h, k] == src and (only < 0 or cols[k] == only):
                    i = cols[k]
                    slot = src
                    break
        if i < 0:
            m = w[h] * lik[lik.shape[0] - 1]
            if m > 0.0:
                parent[n], obj[n], to[n], cw[n], cz[n] = h, -1, -1, m, zob[h]
                n += 1
            continue
        base = w[h] * lik[i]
        m = base * p_stay
        if m > 0.0:
            parent[n], obj[n], to[n], cw[n], cz[n] = h, -1, -1, m, zob[h]
            n += 1
        for q in range(dest.shape[0]):
            m = base * p_dest[q]
            if m > 0.0:
                parent[n], obj[n], to[n], cw[n] = h, i, dest[q], m
                cz[n] = zob[h] ^ zobrist(i, slot) ^ zobrist(i, dest[q])
                n += 1
    return parent, obj, to, cw, cz, n


@njit(cache=True)
def relabel(rows: Any, zob: Any, cols: Any, remap: Any) -> Any:
    """Rows with every slot s replaced by remap[s], and their hashes."""
    out = np.empty_like(rows)
    z = zob.copy()
    for h in range(rows.shape[0]):
        for k in range(rows.shape[1]):
            s = rows[h, k]
            t = remap[s]
            out[h, k] = t
            if t != s:
                z[h] ^= zobrist(cols[k], s) ^ zobrist(cols[k], t)
    return out, z


@njit(cache=True)
def hashes(rows: Any, cols: Any) -> Any:
    """Hash of every row from scratch."""
    z = np.zeros(rows.shape[0], U64)
    for h in range(rows.shape[0]):
        for k in range(rows.shape[1]):
            z[h] ^= zobrist(cols[k], rows[h, k])
    return z
