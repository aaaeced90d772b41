"""Robots: wide, rigid, without steps. Once one has gone its way by itself it stays one, also in parts behind a leg."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from numba import njit

from tms_agents.floor.feet.person import is_person
from tms_agents.floor.norm import norm
from tms_agents.floor.scan.segmentation import keep

#: Sure after so many sightings, such a way (m), and with so few people beside it (share of the way).
_HITS, _WAY_M, _ALONE = 15, 1.0, 0.4
#: Who has taken so many steps may be a person, and what went with one beside it for so much of the way be pushed.
_STEPS, _BESIDE = 2, 0.15
#: A robot's width is told from its beams within this (m).
_MARGIN_M = 0.06
#: A foot is seen within this (m) of where it was, if that is so long ago (s) at most.
_FOOT_M, _FOOT_S = 0.15, 0.35


@njit(cache=True)
def recognize(bodies: Any, least: float, most: float) -> int:
    """Mark the robots among ``bodies`` (n,), between ``least`` and ``most`` m wide; how many are new."""
    found = 0
    for b in range(bodies.size):
        body = bodies[b]
        if not body.used or not body.confirmed:
            continue
        if body.machine:
            body.robot = 1
            body.wide = max(body.wide, 0.7)
            body.lone = 0.0
            continue
        # Far away it fell apart, as if into two feet, but took no steps.
        rigid = body.both < 0.1 * body.hits or (body.own_stance_n < _STEPS and body.pushed < _BESIDE)
        alone = body.pushed < _ALONE and body.from_furniture <= 0 and rigid
        if body.wide < 0.6 or body.hits < _HITS or not alone or not least - _MARGIN_M < body.far < most + _MARGIN_M:
            continue
        if norm(body.x - body.walked_x, body.y - body.walked_y) > _WAY_M:
            body.machine, body.robot, body.from_furniture = 1, 1, -1
            found += 1
    return found


@njit(cache=True)
def has_robot(bodies: Any) -> bool:
    """Whether any of the ``bodies`` (n,) is a robot for certain."""
    found = False
    for b in range(bodies.size):
        found = found or (bodies[b].used == 1 and bodies[b].machine == 1)
    return found


@njit(cache=True)
def _foot(c: Any, bodies: Any, t: float) -> bool:
    """Whether the foot of a person was just where the cluster is."""
    for b in range(bodies.size):
        body = bodies[b]
        if not is_person(body):
            continue
        a_near = t - body.a_seen < _FOOT_S and norm(c.x - body.ax, c.y - body.ay) < _FOOT_M
        if a_near or (t - body.b_seen < _FOOT_S and norm(c.x - body.bx, c.y - body.by) < _FOOT_M):
            return True
    return False


@njit(cache=True)
def gather(clusters: Any, bodies: Any, most: float, t: float) -> int:
    """Join what is seen of each robot to one of the ``clusters`` (m,), up to ``most`` m wide; how many are left."""
    m: int = clusters.size
    for b in range(bodies.size):
        body = bodies[b]
        if not body.used or not body.machine or body.footprint or t - body.seen > 2.0:
            continue
        dt = t - body.at
        x, y = body.x + dt * body.vx, body.y + dt * body.vy
        reach = 0.5 * min(body.far, most) + _MARGIN_M
        whole, kept = -1, 0
        for k in range(m):
            c = clusters[k]
            part = c.width <= most + _MARGIN_M and norm(c.x - x, c.y - y) < reach and not _foot(c, bodies, t)
            if part and whole >= 0:
                w = clusters[whole]
                share = c.n / (w.n + c.n)
                w.x += share * (c.x - w.x)
                w.y += share * (c.y - w.y)
                w.near += share * (c.near - w.near)
                w.width = min(w.width + c.width, most)
                w.n += c.n
                w.first, w.last = min(w.first, c.first), max(w.last, c.last)
                w.cut, w.attached = 1, 0
                continue
            if part:
                whole = kept
                if c.width < 0.7 * body.far:
                    c.cut = 1
                c.attached = 0
            kept = keep(clusters, kept, k)
        m = kept
    return m


def sizes(robots: Sequence[tuple[float, float]]) -> tuple[float, float]:
    """How wide robots look, m, from and to; without known ``robots`` (width, length) like those for rooms."""
    if not robots:
        return 0.3, 0.9
    return min(min(size) for size in robots), max(math.hypot(*size) for size in robots)


def may_be_robot(body: Any, robots: Sequence[tuple[float, float]]) -> bool:
    """Whether who is new, and mostly wide, is as wide as one of the ``robots``, or any, where none is known."""
    least, most = sizes(robots)
    if robots:
        return bool(0.7 * least < body["far"] < 1.2 * most and body["wide"] > 0.3)
    return bool(body["wide"] > 0.5)
