"""Who is called what: how likely it is, after all crossings, that a body is the one who had this name.

Two hypotheses that put people at the same places and differ only in who is who are one from then on; how likely the
other one was is kept as a probability that names were exchanged. What is seen later, how bright somebody's shoes are
and at what beat he walks, tells which it was, and names are given back. (Identity mass flow: Shin, Guibas and Zhao
2003, "A distributed algorithm for managing multi-target identities in wireless ad-hoc sensor networks".)
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from tms_agents.floor.association.assignment import assign
from tms_agents.floor.feet.brightness import PATCHES
from tms_agents.floor.feet.build import LEGS_KNOWN, SHOES, SHOES_KNOWN
from tms_agents.floor.feet.person import is_person
from tms_agents.floor.norm import norm

Array = NDArray[np.float64]

#: Standard deviations (s) of one stance, seen of a shoe or of a leg, and of how somebody walks of late; nothing tells
#: more than so many deviations.
_STANCE, _STANCE_OF_LEGS, _MOOD, _FAR = 0.1, 0.17, 0.02, 3.5
#: Standard deviations (m) of how wide a leg looks in one sighting (a few beams, scans alike), and of late.
_WIDTH_M, _TROUSERS_M = 0.015, 0.004
#: The same of how long a shoe looks.
_SOLE_M, _SOLES_M = 0.012, 0.003
#: So many sightings make a look that somebody can be known by; so many stances a beat.
_SEEN, _WALKED = 40, 8
#: Who is found again may be anybody who is so near (m), this much as likely.
_BESIDE_M, _CONFUSED = 2.0, 0.7
#: Two names may have been exchanged unnoticed with this probability at least; a smaller one is no doubt; they are given
#: back when that is likelier by so much (log likelihood).
_UNNOTICED, _DOUBT, _SURE = 0.1, 0.02, 1.5


@njit(cache=True)
def likeness(body: Any, name: Any, scattered: Array) -> float:
    """Log likelihood of how the body looked and walked of late, were it who is called like ``name``.

    ``scattered`` (3,) is what `brightness.scatter` has learned.
    """
    value = 0.0
    if body.look_n > 0 and name.own_n >= _SEEN:
        variance = scattered[1] + scattered[0] * PATCHES**2 / body.look_n
        value -= 0.5 * min((body.look - name.own) ** 2 / variance, _FAR**2)
    if body.stance_n > 0 and name.own_stance_n >= _WALKED:
        stance = _STANCE if body.shoe >= SHOES else _STANCE_OF_LEGS
        variance = stance**2 * (1.0 / body.stance_n + 1.0 / name.own_stance_n) + _MOOD**2
        value -= 0.5 * min((body.stance - name.own_stance) ** 2 / variance, _FAR**2)
    if body.leg_width_n > 0 and name.own_leg_width_n >= LEGS_KNOWN and body.shoe < SHOES:
        variance = _WIDTH_M**2 * (1.0 / body.leg_width_n + 1.0 / name.own_leg_width_n) + _TROUSERS_M**2
        value -= 0.5 * min((body.leg_width - name.own_leg_width) ** 2 / variance, _FAR**2)
    if body.shoe_length_n > 0 and name.own_shoe_length_n >= SHOES_KNOWN and body.shoe >= SHOES:
        variance = _SOLE_M**2 * (1.0 / body.shoe_length_n + 1.0 / name.own_shoe_length_n) + _SOLES_M**2
        value -= 0.5 * min((body.shoe_length - name.own_shoe_length) ** 2 / variance, _FAR**2)
    return value


@njit(cache=True)
def _posterior(bodies: Any, b: int, belief: Array, scattered: Array, out: Array) -> None:
    """Fill ``out`` (n,): how likely body b is who has each name, with what was seen since the last doubt."""
    total = 0.0
    for k in range(bodies.size):
        out[k] = 0.0
        if belief[b, k] > 0.0 and bodies[k].used and bodies[k].confirmed:
            out[k] = belief[b, k] * np.exp(likeness(bodies[b], bodies[k], scattered))
            total += out[k]
    if total > 0.0:
        out /= total
    else:
        out[b] = 1.0


@njit(cache=True)
def exchanged(bodies: Any, belief: Array, one: int, two: int, scattered: Array) -> float:
    """How likely it is that two bodies have each other's names, if each has one of these two; 0: there is no doubt."""
    prior, own = belief[one, two] + belief[two, one], belief[one, one] + belief[two, two]
    if prior <= 0.0:
        return 0.0
    a, b = bodies[one], bodies[two]
    more = likeness(a, b, scattered) + likeness(b, a, scattered)
    more -= likeness(a, a, scattered) + likeness(b, b, scattered)
    return float(prior / (prior + own * np.exp(-more)))


@njit(cache=True)
def unite(
    bodies: Any,
    belief: Array,
    others: Any,
    others_belief: Array,
    of: NDArray[np.int64],
    worse: float,
    scattered: Array,
    spare: Array,
) -> None:
    """``others``, at the same places but with body ``of`` (n,) for each of ``bodies``, is ``worse`` (log likelihood).

    ``belief`` (n, n): how likely each body is who has each name; ``spare`` (2, n) is scratch.
    """
    share = 1.0 / (1.0 + np.exp(worse))
    if share < _DOUBT:
        return
    doubted = False
    for b in range(bodies.size):
        if of[b] >= 0 and of[b] != b:
            doubted = True
    if not doubted:
        return
    mixed = belief.copy()
    for b in range(bodies.size):
        if of[b] < 0 or of[b] == b:
            continue
        _posterior(bodies, b, belief, scattered, spare[0])
        _posterior(others, of[b], others_belief, scattered, spare[1])
        for k in range(bodies.size):
            mixed[b, k] = (1.0 - share) * spare[0, k] + share * spare[1, k]
    for b in range(bodies.size):
        if of[b] >= 0 and of[b] != b:
            belief[b] = mixed[b]
            bodies[b].look_n = 0
            bodies[b].stance_n = 0
            bodies[b].leg_width_n = 0
            bodies[b].shoe_length_n = 0


@njit(cache=True)
def christen(bodies: Any, belief: Array, index: int, x: float, y: float) -> None:
    """Body ``index`` has a name: a new one (x is NaN), or that of one lost at (x, y), who may as well be one beside."""
    belief[index] = 0.0
    belief[:, index] = 0.0
    belief[index, index] = 1.0
    if np.isnan(x):
        return
    here = bodies[index]
    for b in range(bodies.size):
        one = bodies[b]
        if b == index or not is_person(one):
            continue
        if min(norm(one.x - x, one.y - y), norm(one.x - here.x0, one.y - here.y0)) < _BESIDE_M:
            belief[index, b], belief[b, index] = _CONFUSED, _CONFUSED * belief[b, b]


@njit(cache=True)
def renamed(bodies: Any, belief: Array, t: float, scattered: Array, names: NDArray[np.int64]) -> bool:
    """Fill ``names`` (n,) with whose name each body should have; whether any changes. Notes how sure names are."""
    n = 0
    rows = np.empty(bodies.size, np.int64)
    for b in range(bodies.size):
        names[b] = b
        body = bodies[b]
        if is_person(body) and t - body.seen < 1.0:
            rows[n] = b
            n += 1
    if n < 2:
        return False
    cost = np.empty((n, n))
    for i in range(n):
        total = 0.0
        for j in range(n):
            b, k = rows[i], rows[j]
            cost[i, j] = -np.log(max(belief[b, k], _UNNOTICED)) - likeness(bodies[b], bodies[k], scattered)
            total += np.exp(-cost[i, j])
        bodies[rows[i]].sure = np.exp(-cost[i, i]) / total
    best = np.empty(n, np.int64)
    assign(cost, n, np.inf, best)
    changed = False
    done = np.zeros(n, np.bool_)
    for i in range(n):
        # Each cycle of exchanged names by itself.
        gain, j = 0.0, i
        while not done[j]:
            done[j] = True
            gain += cost[j, j] - cost[j, best[j]]
            j = best[j]
        if gain > _SURE:
            changed = True
            j = i
            while True:
                names[rows[j]] = rows[best[j]]
                j = best[j]
                if j == i:
                    break
    return changed
