"""Hypotheses about who is where, side by side: what they have in common, and what is found of the best is so in all."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from tms_agents.floor.state import BODY, CERTAIN, FEET, NEVER, empty

Array = NDArray[np.float64]
Integers = NDArray[np.int64]

#: Bodies so near each other (m, each axis), on the same prints, going alike (m/s, each axis), are at the same place.
_NEAR_M, _ALIKE = 0.08, 0.3
#: So many integers of a body are compared first: most that differ do so in these.
_FIRST = 16


class Hypotheses(NamedTuple):
    """So many hypotheses about who is where; `nothing_known` makes them.

    ``bodies`` (kept, n) of `state.BODY`, and the same as integers, ``raw`` (kept, n, fields); ``beliefs`` (kept, n, n),
    how likely each body is who has each name (`identity`); ``nobodys_at`` (kept, p), when each print was last seen to
    be nobody's who is believed.
    """

    bodies: Any
    raw: Integers
    beliefs: Array
    nobodys_at: Array


def nothing_known(kept: int, most: int, prints: int) -> Hypotheses:
    """Of so many bodies and prints."""
    bodies, beliefs = empty(BODY, (kept, most)), np.zeros((kept, most, most))
    beliefs[:] = np.eye(most)
    # All fields are as long as an integer: what is the same to the last bit is found by these.
    raw = bodies.view(np.int64).reshape(kept, most, -1)
    return Hypotheses(bodies, raw, beliefs, np.full((kept, prints), NEVER))


@njit(cache=True)
def same_places(one: Any, two: Any, top: int, of: Integers) -> bool:
    """Whether two hypotheses put the movers at the same places on the same prints, whoever is who; ``of`` (n,) tells.

    All who are believed are among the first ``top``. Then the way people go on cannot tell the two apart: only how
    they look and walk can (`identity`).
    """
    of[top:] = -1
    for b in range(top):
        p = one[b]
        of[b] = -1
        if not (p.used and p.confirmed):
            continue
        found = False
        for o in range(top):
            # Most often it is the same one.
            of[b] = b + o if b + o < top else b + o - top
            q = two[of[b]]
            if not (q.used and q.confirmed):
                continue
            near = _NEAR_M if p.a_print < 0 and p.b_print < 0 else 4.0 * _NEAR_M
            if abs(p.x - q.x) > near or abs(p.y - q.y) > near:
                continue
            if abs(p.vx - q.vx) > _ALIKE or abs(p.vy - q.vy) > _ALIKE:
                continue
            straight = p.a_print == q.a_print and p.b_print == q.b_print
            if straight or (p.a_print == q.b_print and p.b_print == q.a_print):
                found = True
                break
        if not found:
            return False
    return True


@njit(cache=True)
def first_like(raw: Integers, fields: int, h: int, row: int) -> int:
    """The first hypothesis in which the body ``row`` is as in hypothesis h, in the first ``fields`` of ``raw``."""
    g = 0
    while g < h and not _equal(raw, g, raw, h, row, fields):
        g += 1
    return g


@njit(cache=True)
def _equal(one: Integers, g: int, two: Integers, h: int, row: int, fields: int) -> bool:
    """Whether the body ``row`` is the same in the first ``fields`` of one[g] and of two[h], both as integers."""
    # No views of the rows: to count who uses them would take longer than to look. All are looked at, many at a time.
    differ = 0
    for k in range(_FIRST):
        differ |= one[g, row, k] ^ two[h, row, k]
    if differ:
        return False
    for k in range(_FIRST, fields):
        differ |= one[g, row, k] ^ two[h, row, k]
    return differ == 0


@njit(cache=True)
def copy(source: Any, source_belief: Array, target: Any, target_belief: Array, believed: bool) -> None:
    """Copy the bodies that are used, and who they may be; those that are ``believed`` only if that is wanted."""
    for b in range(source.size):
        if source[b].used:
            if believed or not source[b].confirmed:
                target[b] = source[b]
            target_belief[b] = source_belief[b]
        else:
            target[b].used = 0


@njit(cache=True)
def exchange(some: Hypotheses, i: int, j: int, between: Hypotheses) -> None:
    """Exchange the hypotheses i and j by way of the first of others, which is overwritten."""
    bodies, beliefs, nobodys_at = some.bodies, some.beliefs, some.nobodys_at
    copy(bodies[i], beliefs[i], between.bodies[0], between.beliefs[0], True)
    copy(bodies[j], beliefs[j], bodies[i], beliefs[i], True)
    copy(between.bodies[0], between.beliefs[0], bodies[j], beliefs[j], True)
    for p in range(nobodys_at.shape[1]):
        nobodys_at[i, p], nobodys_at[j, p] = nobodys_at[j, p], nobodys_at[i, p]


@njit(cache=True)
def settle(some: Hypotheses, before: Integers, decided: NDArray[np.bool_], scores: Array, count: int) -> int:
    """What became of bodies of the best hypothesis holds in all in which they were the same: how many there are.

    ``before`` (1, n, fields): those of the best as they were, as integers. Hypotheses in which one is another that is
    ``decided`` (n,) are dropped; ``scores`` (kept,) move along.
    """
    bodies, raw, beliefs, nobodys_at = some
    n = bodies.shape[1]
    kept = 1
    for h in range(1, count):
        good = True
        for b in range(n):
            good &= not decided[b] or _equal(raw, h, before, 0, b, FEET)
        if not good:
            continue
        if kept < h:
            copy(bodies[h], beliefs[h], bodies[kept], beliefs[kept], True)
            scores[kept] = scores[h]
            nobodys_at[kept] = nobodys_at[h]
        for b in range(n):
            if bodies[kept, b].used and _equal(raw, kept, before, 0, b, FEET):
                for field in range(CERTAIN):
                    raw[kept, b, field] = raw[0, b, field]
        kept += 1
    return kept
