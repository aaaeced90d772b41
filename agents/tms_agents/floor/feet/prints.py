"""Prints: places where a cluster stands still. A standing foot is one, and so is a thing that was put down."""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from tms_agents.floor.feet.brightness import STRANGE, strangeness
from tms_agents.floor.feet.build import SHOD, SHOES, joined
from tms_agents.floor.norm import norm
from tms_agents.floor.scan.freespace import FREE, HIDDEN, UNSEEN, WALLED, Sight, clear
from tms_agents.floor.scan.no_echo import blank, silent
from tms_agents.floor.state import NEVER

Array = NDArray[np.float64]

#: A cluster farther (m, plus range noise) from its print begins it anew. A print is dropped when it is not seen for so
#: long (s) though its place is seen to be free, or for so long whatever hides it.
_STATIC_M, _GONE_S, _HIDDEN_S = 0.045, 0.5, 10.0
#: What had rested for so long (s), or had been put there by hand for so long, and comes out again so near (m, and per
#: metre of range) and as wide (share, m) as it was is the same: no foot steps so exactly.
_RESTED_S, _GIVEN_S, _SAME_M, _SAME_PER_M, _AS_WIDE, _WIDTH_M = 1.5, 0.5, 0.02, 0.003, 0.25, 0.015
#: What fewer beams meet flickers at the edge of something.
_SPECK = 1.5
#: And what so many meet is something else.
_GROWN = 4
#: What has been seen for so long (s) while somebody was out of sight is no foot of theirs.
_NOT_HIS_S = 1.0
#: Nor is what had lain there for so long (s) when it was found that they do not stand on what is seen of them.
_BEFORE_S = 2.0
#: No foot is so wide (m).
_WIDE_M = 0.3
#: So many times more often seen than seen whole.
HARDLY = 8
#: What is black or glossy echoes now and then: at least once in this time (s).
_MUTE_S = 3.0
#: The mean place of what does not move stays within this (m, and per metre of range).
_STILL_M, _STILL = 0.008, 0.001
#: Somebody is at a print when the body or a foot is so near (m).
NEAR_M = 0.36
#: Seen so often, a foot is not so thin (m), a leg not so much thinner or wider than it was.
_OFTEN, _THIN_M, _LEG = 10, 0.07, (0.65, 1.6)
#: What was nobody's for a smaller share of the time than this had not stood there before somebody came.
_NOBODYS = 0.1
#: What is so far (m) beside a robot that has rested for so long (s) is no part of it, nor is what has lain still while
#: it drove for so long (s).
_CLEAR_M, _PARKED_S, _DRIVES_S = 0.06, 3.0, 1.0
#: What alone has been seen of somebody for so long (s), and is no more as bright as his feet, is none.
_ALONE_S = 60.0
#: A shoe that looks narrower (m) than from its side cannot hide the other one for so long (s).
_HIDES_M, _HIDES_S = 0.2, 6.0
#: Why what is seen of somebody is no foot (`odd`): it is not like his feet; the other would be seen beside it.
UNLIKE, ALONE = 1, 2
#: Who showed another foot so lately (s) shows two.
_BOTH_S = 0.5
#: Who has moved so far (m) may be somebody.
_WALKED_M = 0.15


@njit(cache=True)
def _same(q: Any, c: Any) -> bool:
    """Whether the cluster is what was at the print before something else hid it."""
    if q.beams < _SPECK or norm(c.x - q.x, c.y - q.y) > _SAME_M + _SAME_PER_M * c.near + (
        0.25 * q.width if c.cut else 0.0
    ):
        return False
    rested = q.last - q.rested > (_GIVEN_S if q.given else _RESTED_S)
    return bool(rested and (c.cut or abs(c.width - q.width) < _AS_WIDE * q.width + _WIDTH_M))


@njit(cache=True)
def _grown(q: Any, c: Any) -> bool:
    """Whether the cluster, all of it in view, is much more than the speck that was seen, whole, where it is."""
    return bool(not c.cut and q.whole > 0 and q.mutes < q.hits and q.beams < _SPECK and c.n >= _GROWN)


@njit(cache=True)
def _passed(q: Any, ranges: Array) -> bool:
    """Whether the beams that met the print end behind it now."""
    passed = ranges[q.first_beam : q.last_beam + 1]
    return bool(np.isfinite(passed).all() and (passed > q.near + _STATIC_M).all())


@njit(cache=True)
def follow(
    clusters: Any,
    of: NDArray[np.int64],
    prints: Any,
    sensor: int,
    t: float,
    sight: Sight,
) -> None:
    """Match ``clusters`` (m,) with ``prints``, nearest pair first; ``of`` (m,) becomes the print of each cluster."""
    m, p = clusters.size, prints.size
    of[:] = -1
    near = np.full(m, np.inf)
    which = np.full(m, -1)
    taken = np.zeros(p, np.bool_)
    for _ in range(m):
        best, best_k = np.inf, -1
        for k in range(m):
            if of[k] >= 0:
                continue
            c = clusters[k]
            if which[k] == -1 or (which[k] >= 0 and taken[which[k]]):
                near[k], which[k] = np.inf, -2
                for j in range(p):
                    if not prints[j].used or taken[j]:
                        continue
                    d = norm(c.x - prints[j].x, c.y - prints[j].y)
                    gate = 0.05 + 0.006 * c.near + 0.25 * min(max(c.width, prints[j].width), 0.4)
                    if d < gate and d < near[k]:
                        near[k], which[k] = d, j
            if which[k] >= 0 and near[k] < best:
                best, best_k = near[k], k
        if best_k < 0:
            break
        of[best_k] = which[best_k]
        taken[which[best_k]] = True
    for k in range(m):
        c = clusters[k]
        j = of[k]
        if j < 0:
            for i in range(p):
                if not prints[i].used:
                    j = i
                    break
            if j < 0:
                continue
            of[k] = j
            taken[j] = True
            q = prints[j]
            q.used, q.first, q.rested, q.hits, q.looks, q.mutes, q.whole, q.covered = 1, t, t, 0, 0, 0, 0, 0
            q.x, q.y, q.width, q.spread, q.beams = c.x, c.y, c.width, 0.0, c.n
            q.last, q.silent, q.hidden = t, NEVER, NEVER
            q.still_x, q.still_y, q.still = c.x, c.y, t
            q.attached = c.attached
            q.owner, q.whose, q.owned, q.busy, q.revealed, q.given = -1, -1, NEVER, NEVER, 0, 0
            q.idle, q.alone = 0.0, 0.0
        q = prints[j]
        off = norm(c.x - q.x, c.y - q.y)
        if _grown(q, c):
            q.idle = 0.0
        if off > _STATIC_M + 0.006 * c.near and not c.cut and q.hits > 0 and not joined(c, q):
            q.first, q.rested = t, t
            q.hits, q.looks, q.mutes, q.whole, q.covered, q.spread = 0, 0, 0, 0, 0, 0.0
            q.x, q.y, q.width, q.beams = c.x, c.y, c.width, c.n
            q.revealed, q.idle = 0, 0.0
        if t - max(q.last, q.silent) > _GONE_S and _same(q, c):
            # Somebody may stand there now, but if it is nobody's foot it has been there all the time.
            if q.width < _WIDE_M:
                q.first = t
        elif t - max(q.last, q.silent) > _GONE_S:
            q.first, q.rested, q.idle = t, t, 0.0
            q.hits, q.looks, q.mutes, q.whole, q.covered, q.spread = 0, 0, 0, 0, 0, 0.0
        q.hits += 1
        q.looks += 1
        q.last = t
        q.covered += c.cut == 2
        q.attached += max(0.05, 1.0 / q.hits) * (c.attached - q.attached)
        q.sensor, q.first_beam, q.last_beam = sensor, c.first, c.last
        # What is black or glossy is hardly ever seen whole: all that is seen of it counts.
        hardly = c.cut and (q.whole == 0 or q.hits > HARDLY * q.whole)
        if not c.cut or hardly:
            if not c.cut:
                q.whole += 1
            gain = 0.05 if hardly and q.whole > 0 else max(0.05, 1.0 / max(q.whole, 1))
            q.x += gain * (c.x - q.x)
            q.y += gain * (c.y - q.y)
            q.width += gain * (c.width - q.width)
            q.spread += gain * (off - q.spread)
            q.beams += gain * (c.n - q.beams)
            q.near, q.spacing = c.near, c.spacing
        off = norm(q.x - q.still_x, q.y - q.still_y)
        if off > (_STILL_M + _STILL * c.near) * (1.0 if q.whole > 4 else 2.0):
            q.still_x, q.still_y, q.still = q.x, q.y, t
    for j in range(p):
        q = prints[j]
        if not q.used or taken[j]:
            continue
        if t - q.last > _HIDDEN_S:
            q.used = 0
        elif silent(q.x, q.y, 0.5 * q.width, sight):
            q.silent = t
            if sensor == q.sensor:
                q.mutes += 1
            if t - q.last > _MUTE_S:
                q.used = 0
        else:
            view = clear(q.x, q.y, 0.5 * q.width, sight)
            # In the gap between two walls only the beam that met it tells that it is not there now.
            passed = view == WALLED and q.beams < _SPECK and sensor == q.sensor and _passed(q, sight[0])
            faint = view == UNSEEN and blank(q.x, q.y, 0.5 * q.width, sight)
            if (sensor == q.sensor and (view == FREE or faint)) or passed:
                q.looks += 1
            if view == HIDDEN:
                q.hidden = t
            elif view == FREE and t - max(q.last, q.silent) > _GONE_S:
                q.used = 0


@njit(cache=True)
def lay_before(q: Any, body: Any) -> bool:
    """Whether the print was there when the body was found to be nowhere but on what does not move: it is no foot."""
    nowhere = body.stale and not body.robot and max(body.a_seen, body.b_seen) <= NEVER
    return bool(nowhere and q.rested < body.seen - _BEFORE_S)


@njit(cache=True)
def thin(q: Any) -> bool:
    """Whether the print, seen whole, is too thin for a shoe and for most legs."""
    return bool(_whole(q) and q.width < _THIN_M)


@njit(cache=True)
def unlike_foot(body: Any, q: Any) -> bool:
    """Whether the print, seen whole, is too thin for a shoe, or as wide as no leg of the body."""
    if body.shoe >= SHOES:
        return thin(q)
    return bool(_whole(q) and body.leg > 0.0 and not _LEG[0] < q.width / body.leg < _LEG[1])


@njit(cache=True)
def _whole(q: Any) -> bool:
    """Whether all of the print has been seen often."""
    return bool(q.hits >= _OFTEN and q.whole >= 0.5 * q.hits)


@njit(cache=True)
def _hides_none(q: Any, other_seen: float, t: float) -> bool:
    """Whether the print, if a shoe, is seen from its tip or heel: it cannot have hidden the other one for so long.

    Of what is partly hidden nobody knows how wide it is.
    """
    alone = t - max(q.rested, other_seen) > _HIDES_S
    return bool(alone and q.width < _HIDES_M and 2 * q.whole > q.hits)


@njit(cache=True)
def lift(bodies: Any, prints: Any) -> None:
    """Feet of ``bodies`` (n,) whose print is no more stand on none: in its place of ``prints`` another may begin."""
    for b in range(bodies.size):
        body = bodies[b]
        if body.used and body.a_print >= 0 and not prints[body.a_print].used:
            body.a_print = -1
        if body.used and body.b_print >= 0 and not prints[body.b_print].used:
            body.b_print = -1


@njit(cache=True)
def attend(prints: Any, bodies: Any, t: float, dt: float, scattered: Array, shoes: Array) -> None:
    """Note at which prints somebody is: whose foot stands there (owner), and when somebody was last near (busy).

    ``scattered`` (3,) is what `brightness.scatter` has learned, ``shoes`` (2,) what `build.count_shoes` has.
    """
    shod = shoes[0] > SHOD
    for b in range(bodies.size):
        body = bodies[b]
        body.still = 0.0
        if body.used and body.a_print >= 0 and body.b_print >= 0 and max(t - body.a_seen, t - body.b_seen) < 0.5:
            body.still = t - max(prints[body.a_print].still, prints[body.b_print].still)
        body.older, body.odd = 0.0, 0
        j = body.a_print if body.a_seen >= body.b_seen else body.b_print
        if body.used and j >= 0:
            body.odd = UNLIKE if unlike_foot(body, prints[j]) else 0
            if prints[j].idle > _NOBODYS * (t - prints[j].rested):
                body.older = prints[j].idle
            alone = t - prints[j].first > _ALONE_S and t - min(body.a_seen, body.b_seen) > _ALONE_S
            if alone and strangeness(body, prints[j], scattered) > STRANGE:
                body.odd = UNLIKE
            if shod and _hides_none(prints[j], min(body.a_seen, body.b_seen), t):
                body.odd = ALONE
    for j in range(prints.size):
        q = prints[j]
        if not q.used:
            continue
        q.owner = -1
        nobodys = q.last == t
        for b in range(bodies.size):
            body = bodies[b]
            if not body.used:
                continue
            if body.a_print == j or body.b_print == j:
                nobodys = False
            if body.stale and q.last == t and t - q.first > _NOT_HIS_S:
                # What has been seen there for a while is no foot of one who is not seen.
                body.a_print = -1 if body.a_print == j else body.a_print
                body.b_print = -1 if body.b_print == j else body.b_print
            if not body.confirmed:
                # Somebody who is not believed yet, but has walked.
                walked = norm(body.x - body.x0, body.y - body.y0) > _WALKED_M and t - body.seen < 0.3
                if walked and norm(body.x - q.x, body.y - q.y) < NEAR_M:
                    q.busy = t
                continue
            if body.a_print == j or body.b_print == j:
                q.owner, q.whose = b, body.label
                q.owned = t
                first = body.a_print == j
                other, seen = (body.b_print, body.b_seen) if first else (body.a_print, body.a_seen)
                if q.last == t:
                    q.alone = 0.0 if other != j and t - seen < _BOTH_S else q.alone + dt
                q.busy = t
            if body.stale:
                continue
            d = norm(body.x - q.x, body.y - q.y)
            parked = t - body.rest_at > _PARKED_S and d > 0.5 * (body.far + q.width) + _CLEAR_M
            if body.machine and (parked or body.rest_at - q.first > _DRIVES_S):
                continue
            reach = NEAR_M + (0.3 if body.robot else 0.0)
            if t - body.a_seen < 0.6 and body.a_print != j:
                d = min(d, norm(body.ax - q.x, body.ay - q.y))
            if t - body.b_seen < 0.6 and body.b_print != j:
                d = min(d, norm(body.bx - q.x, body.by - q.y))
            if d < reach:
                q.busy = t
        if nobodys:
            q.idle += dt
