"""Who begins to be seen far from every door was there before: somebody who seems to stand beside may be only a thing,
which that person has put down before going on."""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit

from tms_agents.floor.feet.person import is_person
from tms_agents.floor.norm import norm

#: So far (m) from where somebody or a foot of his is one may begin who was he, and farther, this fast (m/s), the longer
#: (s, at most) ago both his feet were seen.
_AWAY_M, _SPEED, _GONE_S = 1.2, 1.2, 3.0
#: Who was seen so lately (s) seems to be there.
_THERE_S = 0.5
#: What seems to be a foot of the old one landed no later (s) after the new one began.
_PUT_S = 0.5
#: What has taken so many steps was a person.
_STEPS = 3
#: What somebody has stood on for so long (s) is his foot.
_STANDS_S = 20.0


@njit(cache=True)
def suspect(bodies: Any, index: int, t: float) -> None:
    """Note of all ``bodies`` (n,) that may be things which the new one at ``index`` has left: ``suspected``."""
    new = bodies[index]
    for b in range(bodies.size):
        body = bodies[b]
        if b == index or not may_have_been(body) or body.stale or t - body.seen > _THERE_S:
            continue
        if t - landed(body) > _STANDS_S:
            continue
        away = min(norm(new.x0 - body.ax, new.y0 - body.ay), norm(new.x0 - body.bx, new.y0 - body.by))
        away = min(away, norm(new.x0 - body.x, new.y0 - body.y))
        gone_s = min(max(0.0, new.first - min(body.a_seen, body.b_seen)), _GONE_S)
        if away < _AWAY_M + _SPEED * gone_s:
            body.suspected = new.first


@njit(cache=True)
def may_have_been(body: Any) -> bool:
    """Whether it is a person, or has become as wide as a robot after it had come on two feet."""
    return bool(is_person(body) or (body.used and body.confirmed and not body.machine and body.own_stance_n >= _STEPS))


@njit(cache=True)
def suspected(body: Any) -> bool:
    """Whether the body has stood on what is seen of it now since before somebody began who may be who it was."""
    return bool(landed(body) < body.suspected + _PUT_S)


@njit(cache=True)
def landed(body: Any) -> float:
    """When (s) the foot came where it is that was seen last."""
    return float(body.a_land if body.a_seen >= body.b_seen else body.b_land)


def began(bodies: Any, body: Any, thing: bool) -> int:
    """Which of ``bodies`` (n,) is who the body was, if it is `suspected` to be a thing now; -1: none.

    A ``thing`` for certain may have been moved since.
    """
    if not (thing or suspected(body)):
        return -1
    there = (bodies["used"] == 1) & (bodies["confirmed"] == 1) & (bodies["label"] > body["label"])
    found = np.flatnonzero(there & (bodies["first"] == body["suspected"]))
    return int(found[0]) if found.size else -1
