"""How somebody is built and walks, as far as a laser near the floor sees it: legs or shoes, their size, the beat.

A shoe seen from its side shows its heel and its toes: how long it is tells people apart (simulated: known to 0.7 cm,
standard deviation, after one stance, where people differ by 1.4 cm), and which way it points tells whose step it is.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from tms_agents.floor.feet.person import is_person
from tms_agents.floor.norm import norm

#: Of such a share of wide feet somebody's shoes are seen, not legs; so wide (m) is a shoe from its side.
SHOES, _SHOE_M = 0.3, (0.16, 0.34)
#: No shoe is so long (m).
LONGEST_SHOE_M = 0.31
#: Legs and shoes are measured while somebody walks faster than this (m/s): nothing else does.
WALKS = 0.4
#: Legs are expected as if so many had been seen; so many feet are remembered.
_EXPECTED, _LONG = 20.0, 1000.0
#: A foot stands and swings for so long (s) while somebody walks.
_STANCE_S, _SWING_S = (0.3, 1.1), (0.25, 0.75)
#: So many stances tell somebody's beat of late, and his own.
_STANCE_MEMORY, _STANCE_LIFE = 12, 80
#: So many sightings tell how wide somebody's legs are of late, how long his shoes, and both of who has the name.
_LEGS_MEMORY, _SHOES_MEMORY, _SIZE_LIFE = 300, 15, 1000
#: So many sightings of legs, or of shoes from the side, tell how wide or how long they are.
LEGS_KNOWN, SHOES_KNOWN = 40, 10
#: Whose name is less sure does not change what is known of the name.
SURE = 0.6
#: Where shoes are seen, at least this share of all feet that walk is as wide as one. Of simulated legs it is 0.03 at
#: most; of recorded ones, far from a coarse laser that joins both, up to 0.37. Of somebody alone (`shoe`) it is
#: unlearned while he seems to stand on a narrow thing.
SHOD = 0.2
#: Where so many feet were seen, and at most or at least such a share was as wide as a shoe, all show the same: legs, or
#: shoes, also those who stand and point at the laser.
_PLENTY, _ALL_LEGS, _ALL_SHOES = 150.0, 0.1, 0.45
#: So many feet tell that legs are seen, if less than this share was as wide as a shoe: of simulated shoes 0.3 were.
_FEW, _NO_SHOE = 50.0, 0.05
#: What stands alone looks less than so many times, and so much (m), wider than it mostly does.
_JOINED, _JOINED_M = 1.3, 0.03
#: The toes and the heel of a shoe are that wide, as a share of its length; both are in view if it looks so wide (m) and
#: points along the way (sine of the angle).
_TOES, _SIDE_M, _ASTRAY = 0.3, 0.19, 0.5


def legs() -> NDArray[np.float64]:
    """What is known of feet before anybody was seen, as `count_shoes` learns it."""
    return np.array([0.0, _EXPECTED])


@njit(cache=True)
def mean(value: float, count: int, new: float, most: int) -> tuple[float, int]:
    """The mean of so many values, and how many, with one more; it forgets after ``most``."""
    count = min(count + 1, most)
    return value + (new - value) / count, count


@njit(cache=True)
def beat(body: Any, stood: float, swung: float) -> None:
    """Learn from a stance of ``stood`` s, before a swing of ``swung`` s, at what beat the body walks."""
    if _STANCE_S[0] < stood < _STANCE_S[1] and _SWING_S[0] < swung < _SWING_S[1]:
        body.stance, body.stance_n = mean(body.stance, body.stance_n, stood, _STANCE_MEMORY)
        if body.sure >= SURE:
            body.own_stance, body.own_stance_n = mean(body.own_stance, body.own_stance_n, stood, _STANCE_LIFE)


@njit(cache=True)
def size_up(body: Any, c: Any) -> None:
    """Learn from a foot whether shoes are seen, flat on the floor, or legs, and how long or wide these are."""
    if c.cut != 0:
        return
    body.shoe += 0.04 * ((1.0 if _SHOE_M[0] < c.width < _SHOE_M[1] else 0.0) - body.shoe)
    speed = norm(body.vx, body.vy)
    if speed < WALKS:
        return
    body.leg += (0.05 if body.leg > 0.0 else 1.0) * (c.width - body.leg)
    if c.width < _SHOE_M[0]:
        body.leg_width, body.leg_width_n = mean(body.leg_width, body.leg_width_n, c.width, _LEGS_MEMORY)
        if body.sure >= SURE:
            body.own_leg_width, body.own_leg_width_n = mean(
                body.own_leg_width, body.own_leg_width_n, c.width, _SIZE_LIFE
            )
    elif from_side(c) and astray(body, c) < _ASTRAY:
        length = shoe_length(c)
        body.shoe_length, body.shoe_length_n = mean(body.shoe_length, body.shoe_length_n, length, _SHOES_MEMORY)
        if body.sure >= SURE:
            body.own_shoe_length, body.own_shoe_length_n = mean(
                body.own_shoe_length, body.own_shoe_length_n, length, _SIZE_LIFE
            )


@njit(cache=True)
def wears_shoes(body: Any) -> bool:
    """Whether shoes are what was seen of him when he walked: two legs side by side may look like one from its side."""
    return bool(body.own_shoe_length_n >= SHOES_KNOWN)


@njit(cache=True)
def knows_feet(body: Any) -> bool:
    """Whether it is known how wide the legs or how long the shoes are of the one whose name it has."""
    return bool(body.own_leg_width_n >= LEGS_KNOWN or wears_shoes(body))


@njit(cache=True)
def from_side(c: Any) -> bool:
    """Whether the cluster, if a shoe, shows its heel and its toes."""
    return bool(c.cut == 0 and _SIDE_M < c.width < _SHOE_M[1])


@njit(cache=True)
def joined(c: Any, q: Any) -> bool:
    """Whether the cluster is so much wider than what is known of the print that it is not of that alone."""
    return bool(c.width >= _JOINED * q.width + _JOINED_M)


@njit(cache=True)
def astray(body: Any, c: Any) -> float:
    """The sine of the angle between the way the body goes and the way the cluster points, if it is a shoe."""
    return float(abs(body.vx * c.ey - body.vy * c.ex) / max(norm(body.vx, body.vy), 1e-6))


@njit(cache=True)
def shoe_length(c: Any) -> float:
    """How long (m) the shoe is that is seen from its side.

    The ends of what is seen of two discs, toes and heel, with their middles 0.7 of a length apart: aslant it shows less
    than its length, the less the more it points along the beam.
    """
    slope = 2.0 * _TOES * c.slant
    a = (1.0 - _TOES) ** 2 - _TOES**2
    return float(c.width * (np.sqrt(slope * slope + 4.0 * a) - slope) / (2.0 * a))


@njit(cache=True)
def count_shoes(bodies: Any, clusters: Any, of: NDArray[np.int64], t: float, shoes: NDArray[np.float64]) -> None:
    """Learn from everybody who walks whether this laser sees shoes or legs: ``of`` (m,), the prints of the clusters.

    ``shoes`` (2,): of the feet, the share as wide as a shoe from its side, and how many were seen.
    """
    for b in range(bodies.size):
        body = bodies[b]
        if not is_person(body) or body.seen < t or norm(body.vx, body.vy) < WALKS:
            continue
        for i in range(clusters.size):
            c = clusters[i]
            if of[i] >= 0 and not c.cut and (body.a_print == of[i] or body.b_print == of[i]):
                shoes[1] = min(shoes[1] + 1.0, _LONG)
                shoes[0] += ((1.0 if _SHOE_M[0] < c.width < _SHOE_M[1] else 0.0) - shoes[0]) / shoes[1]


@njit(cache=True)
def any_shoe(bodies: Any) -> bool:
    """Whether any of the bodies (n,) shows shoes."""
    shod = False
    for b in range(bodies.size):
        shod = shod or (bodies[b].used and bodies[b].shoe >= SHOES)
    return shod


@njit(cache=True)
def only_legs(shoes: NDArray[np.float64]) -> bool:
    """Whether no shoe was seen among the feet here; ``shoes`` (2,) is what `count_shoes` learns."""
    return bool(shoes[1] >= _FEW and shoes[0] < _NO_SHOE)


@njit(cache=True)
def agree(bodies: Any, shoes: NDArray[np.float64]) -> None:
    """All ``bodies`` (kept, n) show what is seen here, shoes or legs; ``shoes`` (2,) is what `count_shoes` learns."""
    if shoes[1] < _PLENTY:
        return
    for h in range(bodies.shape[0]):
        for b in range(bodies.shape[1]):
            if bodies[h, b].used and shoes[0] > _ALL_SHOES:
                bodies[h, b].shoe = max(bodies[h, b].shoe, SHOES)
            elif bodies[h, b].used and shoes[0] < _ALL_LEGS:
                bodies[h, b].shoe = min(bodies[h, b].shoe, 0.5 * SHOES)
