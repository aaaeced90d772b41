"""Nobody leaves his feet behind: if what he stood on is still there, whoever has gone on with his name is another.

A passer hides the feet of somebody who stands; what is seen next to them is the passer, who is taken for him.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from tms_agents.floor.feet.bodies import begin
from tms_agents.floor.feet.brightness import strangeness
from tms_agents.floor.feet.person import is_person
from tms_agents.floor.norm import norm
from tms_agents.floor.scan.segmentation import CLUSTER
from tms_agents.floor.state import NEVER

Array = NDArray[np.float64]

#: A print was his all the time (but s) if he stood on it for so long (s), and it was seen so often; he seemed to leave
#: it so lately (s), and is so far (m) from it.
_STRAYED_S, _STOOD_S, _HITS, _JUST_S, _LATELY_S, _GONE_M = 1.0, 2.0, 20, 0.25, 12.0, 0.45
#: Two feet were left at the same time (within s) and are between these distances from each other (m).
_TOGETHER_S, _FEET_M = 1.5, (0.06, 0.6)
#: The only thing that had been seen of him for so long (s) was a foot, unless it is so strange (standard deviations).
_ALONE_S, _STRANGE = 5.0, 3.0
#: A foot as one sees it: so wide (m), met by so many beams.
_FOOT_M, _BEAMS = 0.1, 8
#: One print is his if it is as bright as his feet, and what walks with his name is so much less (difference of squared
#: standard deviations, twice the log likelihood ratio).
_TELLS = 5.0
#: Who had stood there for so long (s) stays for so long (s): the passer is still beside him.
_ROOTED_S, _HELD_S = 10.0, 3.0
#: Who is put on a print has so much longer (s) to show that it is his foot, and stays there for so long (s).
_PROVES_S, _STAYS_S = 3.0, 8.0
#: Whose foot it was has gone if both his feet were seen (within s) so far away (m).
_SEEN_S, _AWAY_M = 0.5, 0.9


@njit(cache=True)
def has_left(q: Any, bodies: Any) -> bool:
    """Whether whose foot the print was taken for stands or walks elsewhere, or would as he went when last seen."""
    for b in range(bodies.size):
        body = bodies[b]
        his = body.used and body.confirmed and body.label == q.whose
        if his and body.seen - min(body.a_seen, body.b_seen) < _SEEN_S:
            return bool(norm(body.x - q.x, body.y - q.y) > _AWAY_M)
    return False


@njit(cache=True)
def _left(q: Any, body: Any, t: float) -> bool:
    """Whether the print, there now and nobody's, was a foot of the body for long."""
    there = q.used and q.last == t and q.owner < 0 and not q.revealed and q.whose == body.label and q.hits >= _HITS
    ago = t - q.owned
    return bool(
        there
        and q.owned - q.rested > _STOOD_S
        and _JUST_S < ago < _LATELY_S
        and q.idle < ago + _STRAYED_S
        and norm(q.x - body.x, q.y - body.y) > _GONE_M
    )


@njit(cache=True)
def _is_his(body: Any, q: Any, prints: Any, scattered: Array) -> bool:
    """Whether the print alone tells that he has not gone."""
    off = strangeness(body, q, scattered)
    if q.alone > _ALONE_S and not off > _STRANGE:
        return True
    least = np.inf
    for j in (body.a_print, body.b_print):
        now = strangeness(body, prints[j], scattered) if j >= 0 else np.nan
        least = least if np.isnan(now) else min(least, now)
    return bool(least < np.inf and least * least > off * off + _TELLS)


@njit(cache=True)
def _other(body: Any, prints: Any, i: int, t: float) -> int:
    """Which print he left together with print i: his other foot, -1: none."""
    p = prints[i]
    for j in range(prints.size):
        q = prints[j]
        apart = norm(p.x - q.x, p.y - q.y)
        if j != i and _left(q, body, t) and abs(p.owned - q.owned) < _TOGETHER_S and _FEET_M[0] < apart < _FEET_M[1]:
            return j
    return -1


@njit(cache=True)
def _take_back(bodies: Any, prints: Any, t: float, scattered: Array, scratch: Any) -> int:
    count = 0
    for b in range(bodies.size):
        body = bodies[b]
        if not is_person(body):
            continue
        for i in range(prints.size):
            p = prints[i]
            if not _left(p, body, t):
                continue
            other = _other(body, prints, i, t)
            if other < 0 and not _is_his(body, p, prints, scattered):
                continue
            _go_on(bodies, body, t, scratch)
            _stand(body, prints, i, other, t)
            p.owner = b
            if other >= 0:
                prints[other].owner = b
            count += 1
            break
    return count


@njit(cache=True)
def _go_on(bodies: Any, body: Any, t: float, scratch: Any) -> None:
    """Whoever walks where the body is thought to be is somebody new."""
    if body.seen < t:
        return
    for n in range(bodies.size):
        new = bodies[n]
        if not new.used:
            c = scratch[0]
            c.x, c.y, c.width, c.gap, c.n = body.x, body.y, _FOOT_M, np.inf, _BEAMS
            begin(new, c, body.a_print, t)
            new.vx, new.vy = body.vx, body.vy
            new.ax, new.ay, new.a_seen, new.a_since = body.ax, body.ay, body.a_seen, body.a_since
            new.bx, new.by, new.b_seen, new.b_since = body.bx, body.by, body.b_seen, body.b_since
            new.b_print = body.b_print
            return


@njit(cache=True)
def _stand(body: Any, prints: Any, i: int, j: int, t: float) -> None:
    """Put the body back on the prints i and j (-1: the other foot is hidden)."""
    p = prints[i]
    q = prints[j] if j >= 0 else p
    body.ax, body.ay, body.a_print, body.a_seen, body.a_since = p.x, p.y, i, t, p.first
    body.bx, body.by, body.b_print, body.b_seen, body.b_since = q.x, q.y, j, t, q.first
    body.a_px, body.a_py, body.b_px, body.b_py = p.x, p.y, q.x, q.y
    body.a_land, body.a_stood, body.b_land, body.b_stood = p.rested, t, q.rested, t
    body.a_vx, body.a_vy, body.b_vx, body.b_vy = 0.0, 0.0, 0.0, 0.0
    if j < 0:
        body.b_seen = body.b_since = body.b_stood = p.rested
    body.x, body.y, body.vx, body.vy = 0.5 * (p.x + q.x), 0.5 * (p.y + q.y), 0.0, 0.0
    body.pp, body.pv, body.vv = 0.01, 0.0, 0.1
    body.seen, body.clear, body.lone = t, 0.0, 0.0
    body.held = t + _HELD_S if t - p.rested > _ROOTED_S else NEVER


@njit(cache=True)
def _put(everywhere: Any, b: int, prints: Any, i: int, t: float, scratch: Any) -> None:
    p, c = prints[i], scratch[0]
    c.x, c.y, c.width, c.gap, c.n = p.x, p.y, p.width, np.inf, _BEAMS
    body = everywhere[0, b]
    begin(body, c, i, t)
    _stand(body, prints, i, -1, t)
    body.held, body.lone = t + _STAYS_S, -_PROVES_S
    for h in range(1, everywhere.shape[0]):
        everywhere[h, b] = body
    p.owner, p.idle = b, 0.0


_SCRATCH = np.zeros(1, CLUSTER)


def take_back(bodies: Any, prints: Any, t: float, scattered: Array) -> int:
    """Put those of ``bodies`` (n,) whose feet stand where they stood back on these ``prints``: how many there are."""
    count: int = _take_back(bodies, prints, t, scattered, _SCRATCH)
    return count


def put(everywhere: Any, index: int, prints: Any, i: int, t: float) -> None:
    """Somebody new, the body at ``index`` in all hypotheses (h, n), stands on the print i; his other foot is hidden."""
    _put(everywhere, index, prints, i, t, _SCRATCH)
