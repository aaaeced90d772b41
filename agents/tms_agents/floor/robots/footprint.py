"""One robot of known size from scan to scan: followed by its outline, and the way it goes."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from tms_agents.floor.feet.person import is_person
from tms_agents.floor.norm import norm
from tms_agents.floor.scan.outline import ALL, HIDDEN, ON, fit, quality, share_of
from tms_agents.floor.scan.segmentation import keep
from tms_agents.floor.state import NEVER

Array = NDArray[np.float64]

#: It is seen by this share of what can be seen of it.
_FITS = 0.7
#: It is expected within this (m, rad), so much more per second for which it was not seen, a tenth of that if it
#: stood (m), and so much at most; steps of a fit.
_SPREAD_M, _MORE_M, _STOOD, _MOST_M, _ROUNDS = 0.02, 0.3, 0.1, 0.3, 6
_SPREAD, _MORE, _MOST = 0.12, 0.5, 0.5
#: Its velocity follows its way by this share in a scan, and fades so (s) while it is not seen; no robot is faster, and
#: so fast (m/s) it goes.
_GAIN, _COASTS_S, _FAST, _GOES = 0.3, 2.0, 1.5, 0.08
#: How well it fits in the mean, and who was beside it, follow each scan by such a share.
_LATELY, _BESIDE = 0.1, 0.08
#: A person so near its middle (m, more than half its length), seen so lately (s), may push it.
_PUSHES_M, _LATE_S = 0.6, 0.5
#: So wide (share of scans) is no person.
_WIDE = 0.3
#: It began where it is fitted by so many scans.
_BEGUN = 4
#: What is no farther (m) from its outline may be a part of it; share of a cluster's beams on it that makes it one.
_PART_M, _ITS = 0.1, 0.6
#: Variances of a robot whose outline is seen: of its place (m²), with its velocity, and of that (m²/s²).
_PP, _PV, _VV = 0.0004, 0.0, 0.01


@njit(cache=True)
def follow(
    q: Any,
    t: float,
    at: Array,
    how: Array,
    ranges: Array,
    states: NDArray[np.int8],
    rays: Array,
    pose: Array,
    first: float,
    step: float,
) -> bool:
    """Fit a footprint (`state.FOOTPRINT`) to a scan: whether it was seen; ``at`` (3,), ``how`` (6,) are scratch."""
    dt, unseen = t - q.at, t - q.seen
    x, y = q.x + dt * q.vx, q.y + dt * q.vy
    at[0], at[1], at[2] = x, y, q.yaw
    more = _MORE_M if q.going else _STOOD * _MORE_M
    spread_m, spread = min(_SPREAD_M + more * unseen, _MOST_M), min(_SPREAD + _MORE * unseen, _MOST)
    fit(at, q.a, q.b, spread_m, spread, _ROUNDS, how, ranges, states, rays, pose, first, step)
    value = quality(how, 0.0)
    q.at = t
    if value < _FITS:
        keeps = math.exp(-dt / _COASTS_S)
        q.x, q.y, q.vx, q.vy = x, y, keeps * q.vx, keeps * q.vy
        if how[ON] + how[HIDDEN] < 0.5 * how[ALL]:
            q.fits -= _LATELY * q.fits
        return False
    q.x, q.y, q.yaw = at
    if dt > 0.0:
        q.vx += _GAIN * (q.x - x) / dt
        q.vy += _GAIN * (q.y - y) / dt
        speed = norm(q.vx, q.vy)
        if speed > _FAST:
            q.vx, q.vy = _FAST * q.vx / speed, _FAST * q.vy / speed
    q.seen = t
    q.going = norm(q.vx, q.vy) > _GOES
    q.hits += 1
    q.fits += _LATELY * (value - q.fits)
    if q.hits == _BEGUN:
        q.x0, q.y0 = q.x, q.y
    return True


@njit(cache=True)
def accompany(q: Any, bodies: Any, t: float, dt: float) -> None:
    """Note of a footprint that goes whether one of the ``bodies`` (n,) is beside it: then it may be pushed."""
    if not q.going:
        return
    beside = False
    for b in range(bodies.size):
        body = bodies[b]
        person = is_person(body) and body.wide < _WIDE and t - body.seen < _LATE_S
        beside = beside or (person and norm(body.x - q.x, body.y - q.y) < _PUSHES_M + q.a)
    q.pushed += _BESIDE * ((1.0 if beside else 0.0) - q.pushed)
    q.alone = 0.0 if beside else q.alone + dt * norm(q.vx, q.vy)


@njit(cache=True)
def take(q: Any, clusters: Any, ranges: Array, rays: Array, pose: Array, claimed: NDArray[np.bool_], at: Array) -> int:
    """Take what is on the outline out of ``clusters`` (m,), and claim its beams: how many are left."""
    at[0], at[1], at[2] = q.x, q.y, q.yaw
    reach = norm(q.a, q.b) + _PART_M
    kept = 0
    for k in range(clusters.size):
        c = clusters[k]
        near = c.mirror < 0 and norm(c.x - q.x, c.y - q.y) < reach
        if near and share_of(c, at, q.a, q.b, ranges, rays, pose) >= _ITS:
            claimed[c.first : c.last + 1] = True
            continue
        kept = keep(clusters, kept, k)
    return kept


@njit(cache=True)
def drive(hypotheses: Any, index: int, q: Any, t: float) -> None:
    """The body ``index`` of all ``hypotheses`` (h, n) is the robot, and where its footprint is."""
    for h in range(hypotheses.shape[0]):
        body = hypotheses[h, index]
        body.x, body.y, body.vx, body.vy = q.x, q.y, q.vx, q.vy
        body.pp, body.pv, body.vv = _PP, _PV, _VV
        body.at, body.seen = t, t
        body.ax, body.ay, body.a_seen, body.a_print = q.x, q.y, t, -1
        body.b_seen, body.b_print = NEVER, -1
        body.machine, body.robot, body.from_furniture = 1, 1, -1
        body.wide, body.quality = 1.0, 1.0
        body.clear, body.lone, body.single, body.pushed = 0.0, 0.0, 0.0, 0.0
        body.width, body.far = 2.0 * q.a, 2.0 * norm(q.a, q.b)
        body.hits += 1
        body.score += 1.0
