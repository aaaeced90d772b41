"""Whose feet are whose, where lasers tell brightness: what is as bright as somebody's feet beside him is rather his."""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from tms_agents.floor.feet.brightness import ALIKE, STRANGE, alike, strangeness
from tms_agents.floor.feet.gait import swap
from tms_agents.floor.feet.person import is_person
from tms_agents.floor.feet.strays import nobodys, take
from tms_agents.floor.norm import norm

Array = NDArray[np.float64]

#: Two feet that stand are between these distances from each other (m), and from the body less than this (m); one has
#: stood for so long (s), and is missing when not seen for so long (s).
_BESIDE_M, _STANCE_M, _BODY_M, _STANDS_S, _MISSING_S = 0.06, 0.55, 0.6, 1.0, 0.5
#: What has stood for so long (s) and is so strange is no foot.
_STRANGE_S = 3.0


@njit(cache=True)
def _own(body: Any, prints: Any, x: float, y: float, t: float, scattered: Array) -> int:
    """What is nobody's, beside the foot of the body at (x, y), and as bright as its feet are: the print, or -1."""
    best, least = -1, ALIKE
    for j in range(prints.size):
        q = prints[j]
        if not q.used or q.last < t or q.owner >= 0 or q.revealed or q.attached > 0.5:
            continue
        away = norm(q.x - x, q.y - y)
        off = strangeness(body, q, scattered)
        if _BESIDE_M < away < _STANCE_M and off < least:
            best, least = j, off
    return best


@njit(cache=True)
def exchange(bodies: Any, prints: Any, t: float, scattered: Array) -> int:
    """Give ``bodies`` (n,) their own foot back where what is taken for it is much brighter or darker than their feet.

    It is exchanged for one of the ``prints`` beside it that looks like their feet; where there is none their own foot
    is hidden, and they stand on the other alone. ``scattered`` (3,) is what `brightness.scatter` has learned. How many
    bodies have changed.
    """
    count = 0
    for b in range(bodies.size):
        body = bodies[b]
        if not is_person(body) or body.stale or body.wide > 0.6:
            continue
        for _ in range(2):
            swap(body)
            # The second foot is in question, the first is where it stands.
            if body.a_print < 0 or t - body.a_seen > 0.2:
                continue
            p = prints[body.a_print]
            if t - p.first < _STANDS_S or strangeness(body, p, scattered) > ALIKE:
                continue
            missing = t - body.b_seen > _MISSING_S
            q = prints[max(body.b_print, 0)]
            strange = body.b_print >= 0 and not missing and strangeness(body, q, scattered) > STRANGE
            if not missing and not strange:
                continue
            own = _own(body, prints, body.ax, body.ay, t, scattered)
            if own < 0 and strange and t - q.first > _STRANGE_S and nobodys(q, body.b_land):
                # His own is hidden.
                take(body, q)
                count += 1
                break
            if own < 0 or (missing and (prints[own].whose != body.label or prints[own].given)):
                continue
            if strange:
                q.given = nobodys(q, body.b_land)
            found = prints[own]
            found.given, found.owner = 0, b
            body.b_print, body.b_seen, body.b_since = own, t, found.first
            body.bx, body.by = found.x, found.y
            body.x, body.y = 0.5 * (body.ax + body.bx), 0.5 * (body.ay + body.by)
            count += 1
            break
    return count


@njit(cache=True)
def may_be_his(q: Any, prints: Any, bodies: Any, t: float, scattered: Array) -> bool:
    """Whether the print is as bright as the feet of somebody beside it, who does not show two such feet elsewhere."""
    for b in range(bodies.size):
        body = bodies[b]
        if not is_person(body) or not alike(body, q, scattered):
            continue
        feet, near = 0, norm(body.x - q.x, body.y - q.y) < _BODY_M
        for j, seen in ((body.a_print, body.a_seen), (body.b_print, body.b_seen)):
            if j >= 0 and t - seen < 0.3 and alike(body, prints[j], scattered):
                feet += 1
        if near and (feet < 2 or body.a_print == body.b_print):
            return True
    return False
