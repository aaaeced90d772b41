"""How long what rests is watched before it is told as a thing: longer, the more it looks like somebody's foot."""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from tms_agents.floor.feet.brightness import strangeness
from tms_agents.floor.feet.left_feet import has_left
from tms_agents.floor.feet.person import is_person
from tms_agents.floor.feet.prints import HARDLY
from tms_agents.floor.norm import norm

#: What may be a foot is watched for so long (s): most people move one within this time.
_WATCHED_S = 12.0
#: What a hand has put there may be one if it is as wide as a shoe from its side (m) and somebody is near, so near
#: somebody (m) that it may be under him, as bright as the feet (standard deviations) of somebody beside it (m), or was
#: somebody's just now (s).
_SIDE_M, _UNDER_M, _LIKE, _BESIDE_M, _NOW_S = 0.17, 0.3, 1.0, 0.6, 0.2
#: Of a leg behind somebody else's one sees a part. What is black or glossy is hardly ever seen whole either, and silent
#: in so many scans.
_MUTES = 6
#: What is so much of the time a part of something else is watched for so long (s).
_JOINED, _JOINED_S = 0.3, 25.0
#: Nobody is near who is not nearer (m).
_FAR_M = 0.9
#: What is nobody's foot for so long (s), though everybody near it shows both of his elsewhere, is a thing. It may be a
#: part of one that is moved: what is hardly ever seen whole rests for longer (s).
SPARE_S, _PART_S = 2.0, 4.0
#: Who was beside something so shortly (s) before it came to rest, or began to be seen so shortly before or after that,
#: and so near (m), may have brought it.
_LEFT_S, _BRINGS_S, _BRINGS_M = 1.0, 3.0, 1.0


@njit(cache=True)
def patience(q: Any, bodies: Any, t: float, scattered: NDArray[np.float64]) -> float:
    """For how long (s) a print that seems to be a thing has to rest, given the ``bodies`` (n,) there are.

    ``scattered`` (3,) is what `brightness.scatter` has learned.
    """
    hardly = q.hits > HARDLY * q.whole and q.mutes < _MUTES
    if q.given:
        near = _somebody_near(q, bodies)
        foot = (near and q.width > _SIDE_M) or t - q.owned < _NOW_S or _may_be_foot(q, bodies, scattered)
        part = near and hardly and q.spare < _PART_S
        return _WATCHED_S if foot or part else 0.0
    if q.attached > _JOINED:
        return _JOINED_S
    return _WATCHED_S if t - q.busy < _NOW_S or (hardly and not has_left(q, bodies)) else 0.0


@njit(cache=True)
def _may_be_foot(q: Any, bodies: Any, scattered: NDArray[np.float64]) -> bool:
    """Whether somebody is so near the print that he may stand on it, or it is as bright as his feet."""
    for b in range(bodies.size):
        body = bodies[b]
        if not is_person(body) or body.stale:
            continue
        away = norm(body.x - q.x, body.y - q.y)
        if away < _UNDER_M or (away < _BESIDE_M and strangeness(body, q, scattered) < _LIKE):
            return True
    return False


@njit(cache=True)
def _somebody_near(q: Any, bodies: Any) -> bool:
    """Whether somebody, believed or not, seen or not, is so near that the print may be his leg behind the other one."""
    near = False
    for b in range(bodies.size):
        body = bodies[b]
        near = near or (body.used and not body.robot and norm(body.x - q.x, body.y - q.y) < _FAR_M)
    return near


@njit(cache=True)
def brings(q: Any, bodies: Any) -> bool:
    """Whether somebody was there when the print came to rest, or began to be seen beside it: he may have brought it."""
    if q.busy >= q.rested - _LEFT_S:
        return True
    for b in range(bodies.size):
        body = bodies[b]
        came = is_person(body) and abs(body.first - q.rested) < _BRINGS_S
        if came and norm(body.x0 - q.x, body.y0 - q.y) < _BRINGS_M:
            return True
    return False
