"""What it costs that a cluster is nobody's foot, but somebody new, a thing, or nothing; and the table of all costs."""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from tms_agents.floor.feet.bodies import STAND_M, WIDE_M, narrow, scant
from tms_agents.floor.feet.build import LONGEST_SHOE_M, any_shoe
from tms_agents.floor.feet.likelihood import LEG_M, feet, too_wide, waits
from tms_agents.floor.feet.one_foot import FRESH_S, UNLIKELY
from tms_agents.floor.feet.prints import thin
from tms_agents.floor.norm import norm
from tms_agents.floor.scan.clustered import ClusteredScan
from tms_agents.floor.scan.segmentation import BRIDGE

Array = NDArray[np.float64]

#: What it costs (negative log likelihood) that a cluster is nobody's foot who is known.
#: It is a foot of somebody new, who begins with it; up to so much less the longer it has lain there.
_NOBODY, _THING = 11.0, 6.0
#: It is too narrow for a foot, or joined to the background; the same where so little comes back that it may be one.
_CLUTTER, _SCANT = 4.0, 7.5
#: It is a foot of somebody who is followed already, but not believed yet.
_TENTATIVE = 5.0
#: It has rested there and been nobody's; the same of what is too thin for a foot.
_RESTS, _THIN = 2.0, 0.4
#: Who has stood for so long (s), and would have stepped so lately (s) off what is still there, rather stands there.
_STOOD_S, _STEPS_S = 3.0, 2.0
#: A shoe that was nobody's just before (within s): less than somebody new, who is paid for once.
_GOES_ON, _BEFORE_S = 5.0, 0.35
#: One that is part of a foot whose middle something hides; between both parts lie so many beams at least, and so many
#: at most if nothing nearer is seen there: something dark did not echo.
_PART, _FEW, _FADED = 2.0, 2, 4


@njit(cache=True)
def costs(scan: ClusteredScan, free: NDArray[np.bool_], bodies: Any, rows: NDArray[np.int64], cost: Array) -> None:
    """Fill ``cost`` (m, 2k + m): negative log likelihoods of the clusters being feet of the bodies ``rows`` (k,).

    A foot goes on standing where it stood, or it has stepped: then it lands near the body. Only a fresh print can be
    a step: what has stood there for long is no foot. The last m columns are for clusters that are nobody's: a fresh
    one is somebody new, which is rare; an old one may well be something that was put down.
    """
    k = rows.size
    for column in range(k):
        feet(scan, free, bodies, rows[column], cost[:, 2 * column : 2 * column + 2])
    spans = np.empty(scan.clusters.size)
    spanned(scan.clusters, spans)
    nobodys(scan, bodies, rows, spans, cost[:, 2 * k :])


@njit(cache=True)
def nobodys(scan: ClusteredScan, bodies: Any, rows: NDArray[np.int64], spans: Array, cost: Array) -> None:
    """Fill ``cost`` (m, m): on its diagonal what it costs that a cluster is a foot of none of the bodies ``rows``.

    ``spans`` (m,) is what `spanned` gives.
    """
    clusters, of, prints, t = scan.clusters, scan.of, scan.prints, scan.t
    m, k = clusters.size, rows.size
    longest = LONGEST_SHOE_M if any_shoe(bodies) else LEG_M
    for i in range(m):
        c = clusters[i]
        cost[i, :] = UNLIKELY
        age = t - prints[of[i]].first if of[i] >= 0 else 0.0
        if scant(c) and age < FRESH_S:
            cost[i, i] = _SCANT
        elif narrow(c) or c.attached:
            cost[i, i] = _CLUTTER
        else:
            cost[i, i] = _NOBODY - _THING * min(max(age - 0.3, 0.0), 1.0)
        if age > FRESH_S and c.width < WIDE_M and not narrow(c) and not c.attached:
            # What was nobody's stays nobody's.
            stands = False
            for column in range(k):
                body = bodies[rows[column]]
                stands = stands or body.a_print == of[i] or body.b_print == of[i] or waits(body, c)
                part = body.robot and norm(c.x - body.x, c.y - body.y) < 0.3 + 0.5 * body.far
                stands = stands or part or _has_left(body, c, prints[of[i]], t)
            if not stands:
                cost[i, i] = _THIN if thin(prints[of[i]]) else _RESTS
        if spans[i] < longest:
            cost[i, i] = min(cost[i, i], _PART)


@njit(cache=True)
def _has_left(body: Any, c: Any, q: Any, t: float) -> bool:
    """Whether the body, that stood on both feet, would just have stepped off the print, which is still there."""
    a, b = body.a_land, body.b_land
    landed, before, x, y = (a, b, body.a_ox, body.a_oy) if a > b else (b, a, body.b_ox, body.b_oy)
    stood = landed - max(q.first, before) > _STOOD_S
    return bool(stood and t - landed < _STEPS_S and norm(c.x - x, c.y - y) < STAND_M and not body.robot)


@njit(cache=True)
def known(scan: ClusteredScan, bodies: Any, cost: Array) -> None:
    """Lower the ``cost`` (m, m) of being nobody's of clusters that go on with somebody new who is not believed yet."""
    clusters, t = scan.clusters, scan.t
    for i in range(clusters.size):
        c = clusters[i]
        for b in range(bodies.size):
            body = bodies[b]
            if body.used and not body.confirmed and t - body.seen < 0.5:
                near = min(norm(c.x - body.ax, c.y - body.ay), norm(c.x - body.bx, c.y - body.by))
                near = max(min(near, norm(c.x - body.x, c.y - body.y)) - 0.1, 0.0)
                value = _TENTATIVE + 0.5 * (near / 0.2) ** 2
                if value < cost[i, i] and not _beside(body, bodies, c):
                    cost[i, i] = value


@njit(cache=True)
def goes_on(scan: ClusteredScan, bodies: Any, nobodys_at: Array, cost: Array) -> None:
    """Lower the ``cost`` (m, m) of being nobody's of clusters on prints that were so just before, if people wear shoes.

    ``nobodys_at`` (p,) is when each print was nobody's last, in the hypothesis of these ``bodies`` (n,).
    Else a hypothesis in which somebody unknown stands there costs more with every scan, until it is given up, and
    one of his neighbours has his feet.
    """
    if not any_shoe(bodies):
        return
    of, prints, t = scan.of, scan.prints, scan.t
    for i in range(of.size):
        p = of[i]
        if p >= 0 and nobodys_at[p] >= prints[p].first and t - nobodys_at[p] < _BEFORE_S:
            cost[i, i] = min(cost[i, i], _GOES_ON)


@njit(cache=True)
def _beside(body: Any, bodies: Any, c: Any) -> bool:
    """Whether a mover that is believed is so near that its feet may be taken for another body: not what it pushes."""
    if body.from_furniture == 1:
        return False
    for b in range(bodies.size):
        other = bodies[b]
        near = other.used and other.confirmed and norm(other.x - body.x, other.y - body.y) < 0.6
        if near and too_wide(other, c) == 0.0:
            return True
    return False


@njit(cache=True)
def spanned(clusters: Any, spans: Array) -> None:
    """Fill ``spans`` (m,): how long a foot (m) would be of which a cluster is the smaller part, its middle hidden.

    Infinity where it can be a part of none.
    """
    for i in range(clusters.size):
        c = clusters[i]
        spans[i] = np.inf
        for o in range(clusters.size):
            p = clusters[o]
            between = max(c.first - p.last, p.first - c.last) - 1
            if not _FEW <= between <= BRIDGE:
                continue
            if o == i or p.mirror != c.mirror or p.width < c.width or (p.width == c.width and o > i):
                continue
            if (c.cut != 0 and p.cut != 0) or between <= _FADED:
                spans[i] = min(spans[i], norm(c.x - p.x, c.y - p.y) + 0.5 * (c.width + p.width))
