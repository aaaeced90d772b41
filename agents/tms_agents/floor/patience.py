"""How long what rests is watched before it is told as a thing: longer, the more it looks like somebody's foot."""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from tms_agents.floor.prints import HARDLY
from tms_agents.floor.shine import strangeness

#: What a hand has put there is watched for so long (s) if it is as wide as a shoe from its side (m), so near somebody (m)
#: that it may be under him, as bright as the feet (standard deviations) of somebody beside it (m), was his foot just now,
#: or has hardly ever been seen whole.
_GIVEN_S, _SIDE_M, _UNDER_M, _LIKE, _BESIDE_M = 12.0, 0.17, 0.3, 1.0, 0.6
#: Of somebody behind somebody else one sees a leg in part, for as long as both stand there: most of them move a foot
#: within this time (s). What is black or glossy is hardly ever seen whole either, and silent in so many scans.
_PART_S, _MUTES = 20.0, 6
#: Where somebody stood for so long (s) he may still stand so long (s) after he was taken for somebody else beside.
_HIS_S, _STILL_S = 20.0, 60.0
#: Where somebody stood who was lost sight of, or found to be nowhere, he may stand for so long (s).
_LOST_S = 15.0
#: Beside somebody who is there until now (s): for so long (s). What is so much of the time a part of something else:
#: for so long (s).
_NOW_S, _THERE_S = 0.2, 12.0
_JOINED, _LONG_S = 0.3, 25.0
#: What became of the one whose foot it was: nobody's, he is at hand, lost, or both his feet are seen (until now, s) so
#: far away (m).
_NOBODY, _HERE, _LOST, _LEFT = 0, 1, 2, 3
_SEEN_S, _FAR_M = 0.5, 0.9


@njit(cache=True)
def patience(q: Any, bodies: Any, t: float, scattered: NDArray[np.float64]) -> float:
    """For how long (s) a print that seems to be a thing has to rest, given the ``bodies`` (n,) there are.

    ``scattered`` (3,) is what `shine.scatter` has learned.
    """
    hardly = q.hits > HARDLY * q.whole and q.mutes < _MUTES
    if q.given:
        foot = q.width > _SIDE_M or t - q.owned < _NOW_S or _may_be_foot(q, bodies, scattered)
        return _GIVEN_S if hardly or foot else 0.0
    if q.attached > _JOINED:
        return _LONG_S
    there = _THERE_S if t - q.busy < _NOW_S else 0.0
    owner = _owner(q, bodies, t)
    if owner == _LEFT:
        return there
    if q.owned - q.first > _HIS_S and t - q.owned < _STILL_S:
        return np.inf
    if hardly:
        return _PART_S
    return max(there, _LOST_S if owner == _LOST else 0.0)


@njit(cache=True)
def _may_be_foot(q: Any, bodies: Any, scattered: NDArray[np.float64]) -> bool:
    """Whether somebody is so near the print that he may stand on it, or it is as bright as his feet."""
    for b in range(bodies.size):
        body = bodies[b]
        if not body.used or not body.confirmed or body.stale or body.robot:
            continue
        away = np.hypot(body.x - q.x, body.y - q.y)
        if away < _UNDER_M or (away < _BESIDE_M and strangeness(body, q, scattered) < _LIKE):
            return True
    return False


@njit(cache=True)
def _owner(q: Any, bodies: Any, t: float) -> int:
    """What became of the one whose foot the print was taken for last."""
    if q.whose < 0:
        return _NOBODY
    for b in range(bodies.size):
        body = bodies[b]
        if not body.used or not body.confirmed or body.stale or body.label != q.whose:
            continue
        seen = t - min(body.a_seen, body.b_seen) < _SEEN_S
        return _LEFT if seen and np.hypot(body.x - q.x, body.y - q.y) > _FAR_M else _HERE
    return _LOST
