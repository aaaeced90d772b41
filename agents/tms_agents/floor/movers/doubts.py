"""Who may have been taken for whom: whoever met may have been exchanged, and the server is told how likely that is.

A label follows a body. Two who met may each have gone on as the other one, so that what the one held is with the other
label now: told for the time when they were nearest, but only when how they look and walk since has had its say. If
they are taken for exchanged their labels are given back (`identity`): that they are exchanged from then on is told,
too, and for sure, so that what happened in between was done by who did it.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import astuple, dataclass
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from tms_agents.floor.association.identity import exchanged
from tms_agents.floor.events import Confused, FloorEvent, Vanished
from tms_agents.floor.feet.build import SHOES
from tms_agents.floor.feet.person import is_person
from tms_agents.floor.norm import norm
from tms_agents.floor.state import NEVER

Array = NDArray[np.float64]

#: Two so near each other (m) meet; so far apart (m) they have parted.
_NEAR_M, _PARTED_M = 1.0, 1.5
#: So long (s) after they were nearest it is told how likely they were exchanged, if it is so likely at least.
_WAITS_S, _LEAST = 10.0, 0.02
#: A doubt that is no larger any more is over.
_OVER = 0.1
#: In shoes of which the laser tells no brightness so many are exchanged unnoticed when they meet (`make bench-names`).
_UNNOTICED = 0.035
#: Of those who have their labels back so many had been exchanged, at least and at most (measured so, too).
_GIVEN_BACK = 0.5, 0.7
#: It is looked who is near whom so often (s).
_LOOKS_S = 0.2

#: Two labels, how far they are from each other (m), how likely each is the other one, and whether they wear shoes that
#: nobody knows by how bright they are.
_PAIR = np.dtype([("a", "i8"), ("b", "i8"), ("apart", "f8"), ("p", "f8"), ("alike", "?")])


@dataclass(slots=True)
class _Doubt:
    """Of two labels: when they were ``apart`` the least (m), how likely they were exchanged, and what of that is told.

    ``waits``: that has not been judged yet; ``parted``: since it was they have not been together; ``alike``: they met
    in shoes that nobody knows by how bright they are.
    """

    since: float = 0.0
    apart: float = math.inf
    p: float = 0.0
    told: float = 0.0
    waits: bool = False
    parted: bool = True
    alike: bool = False


class Doubts:
    """About all pairs of people who have met; so many bodies at ``most``."""

    def __init__(self, most: int) -> None:
        self._doubts: dict[tuple[int, int], _Doubt] = {}
        self._pairs = np.zeros(most * (most - 1) // 2, _PAIR)
        self._looked = NEVER

    def look(self, bodies: Any, belief: Array, scattered: Array, t: float) -> list[Confused]:
        """Who is near whom, and who may be whom; what is due to be told."""
        if t - self._looked < _LOOKS_S:
            return []
        self._looked = t
        for doubt in self._doubts.values():
            doubt.p = 0.0
        together = set()
        for a, b, apart, p, alike in self._pairs[: _pairs(bodies, belief, scattered, self._pairs)].tolist():
            doubt = self._doubts.setdefault((a, b), _Doubt())
            doubt.p = p
            if apart < _PARTED_M:
                together.add((a, b))
            if apart < _NEAR_M and apart < doubt.apart and (doubt.parted or doubt.waits):
                doubt.since, doubt.apart, doubt.waits, doubt.alike, doubt.parted = t, apart, True, alike, False
            elif not doubt.waits and p > doubt.told + _LEAST:
                doubt.since, doubt.waits, doubt.alike = t, True, False
        for pair, doubt in self._doubts.items():
            if not doubt.waits and doubt.p < _OVER:
                doubt.told = min(doubt.told, doubt.p)
            if not doubt.waits and pair not in together:
                doubt.parted, doubt.apart = True, math.inf
        due = [pair for pair, doubt in self._doubts.items() if doubt.waits and t - doubt.since >= _WAITS_S]
        return [one for pair in due for one in self._judge(pair, t)]

    def given_back(self, exchanges: Sequence[tuple[int, int]], t: float) -> list[Confused]:
        """These labels are exchanged now, one pair after the other, because who has them had been.

        Whom else they met they met under the labels they had.
        """
        found: list[Confused] = []
        for one, other in exchanges:
            pair = (min(one, other), max(one, other))
            for also, doubt in self._doubts.items():
                if doubt.waits and also != pair and {one, other} & {*also}:
                    found += self._judge(also, t)
            doubt = self._doubts.setdefault(pair, _Doubt(since=t))
            doubt.p = min(max(doubt.p, _GIVEN_BACK[0]), _GIVEN_BACK[1])
            doubt.alike = False
            found += [*self._judge(pair, t), Confused(t, *pair, 1.0, t)]
            doubt.told = 1.0 - doubt.told
        return found

    def gone(self, events: Iterable[FloorEvent], t: float) -> list[Confused]:
        """What is to be told of those who have vanished, before nothing is known of them any more."""
        found: list[Confused] = []
        for event in events:
            if isinstance(event, Vanished):
                for pair in [pair for pair in self._doubts if event.label in pair]:
                    if self._doubts[pair].waits and event.into is None:
                        found += self._judge(pair, t)
                    del self._doubts[pair]
        return found

    def save(self) -> dict[str, Any]:
        """JSON values."""
        doubts = [[*pair, *(None if one == math.inf else one for one in astuple(doubt))]
                  for pair, doubt in self._doubts.items()]  # fmt: skip
        return {"looked": self._looked, "doubts": doubts}

    def restore(self, saved: Any) -> None:
        """Raises KeyError, TypeError or ValueError where that is nothing that ``save`` gave."""
        self._looked = float(saved["looked"])
        self._doubts = {
            (int(a), int(b)): _Doubt(float(since), math.inf if apart is None else float(apart), float(p), float(told),
                                     bool(waits), bool(parted), bool(alike))
            for a, b, since, apart, p, told, waits, parted, alike in saved["doubts"]
        }  # fmt: skip

    def _judge(self, pair: tuple[int, int], t: float) -> list[Confused]:
        """Tell what makes how likely it is that they were exchanged of how likely it was told to be.

        Told p after q they are exchanged with p (1 - q) + q (1 - p): a doubt can be added, never taken back.
        """
        doubt = self._doubts[pair]
        doubt.waits = False
        p, told = doubt.p, doubt.told
        more = (p - told) / (1.0 - 2.0 * told) if told != 0.5 else 0.0
        if _LEAST <= more <= 1.0:
            doubt.told = p
        else:
            more = 0.0
        if doubt.alike:
            more = more * (1.0 - _UNNOTICED) + _UNNOTICED * (1.0 - more)
        return [Confused(t, *pair, round(more, 4), doubt.since)] if more else []


@njit(cache=True)
def _pairs(bodies: Any, belief: Array, scattered: Array, pairs: Any) -> int:
    """Fill ``pairs`` with those people who are near each other, or may be each other: how many."""
    count = 0
    for i in range(bodies.size):
        for j in range(i):
            one, two = bodies[j], bodies[i]
            if not (is_person(one) and is_person(two)):
                continue
            apart = norm(one.x - two.x, one.y - two.y)
            p = exchanged(bodies, belief, j, i, scattered)
            if apart < _PARTED_M or p > 0.0:
                pair = pairs[count]
                pair.a, pair.b = min(one.label, two.label), max(one.label, two.label)
                pair.apart, pair.p = apart, p
                pair.alike = max(one.shoe, two.shoe) >= SHOES and min(one.own_n, two.own_n) == 0
                count += 1
    return count
