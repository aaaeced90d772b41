"""Whether a place is seen to be taken, seen to be free, or hidden: a hidden thing is never given up."""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from tms_agents.floor.norm import norm
from tms_agents.floor.scan.background import BACKGROUND, BEYOND, FOREGROUND, NO_ECHO

Array = NDArray[np.float64]
Point = tuple[float, float]
#: What a sensor sees now: how far (n,) m, the state of each beam (n,) as `background.classify` gives it, how far it
#: looks where the background is not mostly silent (n,) m, inf elsewhere; its pose (3,), and where its first beam points
#: and how far from beam to beam, rad.
Sight = tuple[Array, NDArray[np.int8], Array, Array, float, float]

#: What a scan says of a place: it is not in view, something is met there, something nearer hides it, beams pass it, it
#: is behind a wall, nothing at all comes back from there. PAST: something hides most of a thing, but the beams that
#: always met the rest of it pass now.
UNSEEN, HIT, HIDDEN, FREE, WALLED, SILENT, PAST = 0, 1, 2, 3, 4, 5, 6

#: What echoes less often is black or glossy.
QUIET = 0.9
#: Where nothing echoes behind it, a thing is missing when nothing echoes any more, if it did so reliably.
_RELIABLE = 0.93
#: So many beams beside those to a thing tell whether something dark stands before it.
_BESIDE = 2
#: Where the background is silent less often than this, silence shows that something black or glossy is there.
_MUTE = 0.3

#: A surface goes on so smoothly from beam to beam (m, and per metre of range); no object is wider than this (m).
_SMOOTH_M, _SMOOTH, _WIDEST_M = 0.015, 0.006, 0.28

#: Beams that tell a shape; a face slants if its ends are so differently far (share of the width); two faces stand out
#: before the line between their ends by so much (mean, share of its length).
_PROFILE, _SLANT, _CORNER = 6, 0.13, 0.25
#: Which part of a half hidden thing shows is known after so many looks that met it, of which a look past it takes back
#: so many; how fast that part follows; of what echoes less often than the last it is not asked.
_STEADY, _SELDOM, _PART, _ECHOES = 30, 3, 0.2, 0.8
#: So many beams beside a thing do not show the background alone; they show the thing at its range (m).
_GUARD, _GOES_ON_M = 2, 0.1
#: One thing as one scan sees it: the verdict, beams on it, where it seems to be and how wide, and whether all of it and
#: nothing else was seen.
LOOK = np.dtype(
    [("verdict", "i8"), ("n", "i8"), ("x", "f8"), ("y", "f8"), ("width", "f8"), ("clean", "i8"), ("spacing", "f8")]
)


@njit(cache=True)
def index_of(bearing: float, first: float, step: float, n: int) -> float:
    """Index (fraction) of the beam at ``bearing`` rad, of n from ``first`` every ``step`` rad, were they all round."""
    middle = first + 0.5 * step * (n - 1)
    off: float = bearing - middle
    off -= 2.0 * np.pi * np.round(off / (2.0 * np.pi))
    return off / step + 0.5 * (n - 1)


@njit(cache=True)
def beam_of(bearing: float, first: float, step: float, n: int) -> float:
    """As `index_of`; NaN where there is no beam."""
    index = index_of(bearing, first, step, n)
    if index < -0.5 or index > n - 0.5:
        return float(np.nan)
    return index


@njit(cache=True)
def middle_of(ranges: Array, rays: Array, o: int, a: int, b: int, x: float, y: float, width: float) -> Point:
    """Where the middle of a thing is whose surface, beams a to b, has the mean (x, y) m.

    Behind a disc's surface by 0.39 of its width: its ends are farther off, both alike. A box that shows two faces ends
    at two opposite corners, and its middle is between them; of what shows one face nobody knows how deep it is, boxes
    are seldom as deep as long: 0.3.
    """
    n = b - a + 1
    third = n // 3
    m = (a + b) // 2
    dx, dy = rays[m, o + 2], rays[m, o + 3]
    share = 0.36
    if n >= _PROFILE:
        one, two, three = 0.0, 0.0, 0.0
        for i in range(third):
            one += ranges[a + i] / third
            two += ranges[a + third + i] / third
            three += ranges[b - i] / third
        if np.isfinite(one + two + three):
            if abs(three - one) > _SLANT * width:
                ax, ay = rays[a, o] + ranges[a] * rays[a, o + 2], rays[a, o + 1] + ranges[a] * rays[a, o + 3]
                bx, by = rays[b, o] + ranges[b] * rays[b, o + 2], rays[b, o + 1] + ranges[b] * rays[b, o + 3]
                length = max(norm(bx - ax, by - ay), 1e-6)
                nx, ny = (ay - by) / length, (bx - ax) / length
                if nx * dx + ny * dy < 0.0:
                    nx, ny = -nx, -ny
                # How far the surface stands out before the line between its ends: by a corner, or not at all.
                bulge = ((0.5 * (ax + bx) - x) * nx + (0.5 * (ay + by) - y) * ny) / length
                back = 0.3 * min(length, 0.5) * (1.0 - min(max(bulge / _CORNER, 0.0), 1.0))
                return 0.5 * (ax + bx) + back * nx, 0.5 * (ay + by) + back * ny
            share = 0.39 if 0.5 * (one + three) - two > 0.07 * width else 0.3
    shift = share * min(width, 0.5)
    return x + shift * dx, y + shift * dy


@njit(cache=True)
def _cut(ranges: Array, a: int, b: int) -> bool:
    """Whether something nearer hides what may lie on beyond the beams a to b."""
    for edge, side in ((a, -1), (b, 1)):
        for i in (edge + side, edge + 2 * side):
            if 0 <= i < ranges.size and ranges[i] < ranges[edge] - 0.05:
                return True
    return False


@njit(cache=True)
def _past(ranges: Array, states: NDArray[np.int8], at: float, behind: float) -> bool:
    """Whether the beam (fraction) ``at`` ends farther off than ``behind`` m."""
    i = int(np.round(at))
    return bool(0 <= i < ranges.size and states[i] != NO_ECHO and ranges[i] > behind)


@njit(cache=True)
def look(
    things: Any,
    ranges: Array,
    states: NDArray[np.int8],
    empty: Array,
    longest: Array,
    rays: Array,
    views: Array,
    pose: Array,
    first: float,
    step: float,
    claimed: NDArray[np.bool_],
    sensor: int,
    looks: Any,
) -> None:
    """What one scan says of each thing, into ``looks``; its beams are marked in ``claimed`` (n,).

    views: (m, 6) reflections, the first the identity; pose: (3,) sensor; first, step: bearings, rad.
    """
    n = ranges.size
    for k in range(things.size):
        thing = things[k]
        out = looks[k]
        out.verdict = UNSEEN
        out.n = 0
        if not thing.used:
            continue
        for v in range(views.shape[0]):
            vx = views[v, 0] * thing.x + views[v, 1] * thing.y + views[v, 4]
            vy = views[v, 2] * thing.x + views[v, 3] * thing.y + views[v, 5]
            away = norm(vx - pose[0], vy - pose[1])
            middle = beam_of(np.arctan2(vy - pose[1], vx - pose[0]) - pose[2], first, step, n)
            if np.isnan(middle) or away < 0.05:
                continue
            half_angle = np.arctan(thing.half / away) / abs(step)
            gate = thing.half + 0.02 + 0.004 * away
            low = max(0, int(np.ceil(middle - half_angle - 1.0)))
            high = min(n - 1, int(np.floor(middle + half_angle + 1.0)))
            inner = max(0.5, 0.75 * half_angle)
            shows = thing.part_by == sensor and thing.part_hits >= _STEADY and thing.rate > _ECHOES
            part = middle + thing.part / (away * abs(step))
            hits, beyond, hidden, total, alien, mute, unheard = 0, 0, 0, 0, 0, 0, 0
            x, y = 0.0, 0.0
            a, b = -1, -1
            o = 4 if v > 0 else 0
            for i in range(low, high + 1):
                mirrored = away > rays[i, 8]
                if mirrored != (v > 0) or (mirrored and int(rays[i, 9]) != v - 1):
                    continue
                r = ranges[i]
                if states[i] == FOREGROUND and abs(r - away) <= gate:
                    x += rays[i, o] + r * rays[i, o + 2]
                    y += rays[i, o + 1] + r * rays[i, o + 3]
                    claimed[i] = True
                    hits += 1
                    if a < 0:
                        a = i
                    b = i
                if abs(i - middle) > inner:
                    continue
                total += 1
                if (
                    states[i] == BEYOND
                    or (states[i] == BACKGROUND and r > away - gate)
                    or (states[i] == FOREGROUND and r > away + gate)
                ):
                    beyond += 1
                elif states[i] == NO_ECHO and empty[i] > 0.5 and thing.rate > _RELIABLE:
                    unheard += 1
                elif states[i] != NO_ECHO and r < away - gate:
                    hidden += 1
                elif states[i] == NO_ECHO and empty[i] < _MUTE and thing.rate < QUIET:
                    mute += 1
            if total == 0:
                continue
            if unheard > 0 and not _nearer(ranges, states, low - _BESIDE, high + _BESIDE, away - gate):
                beyond += unheard
            if hits > 0:
                # More of it than was thought: hidden when it was first seen.
                wide = int(_WIDEST_M / (away * abs(step)))
                for side in (-1, 1):
                    i = b if side > 0 else a
                    last = ranges[i]
                    while 0 <= i + side < n and b - a + 1 < wide:
                        i += side
                        r = ranges[i]
                        if not np.isfinite(r) and np.isfinite(longest[i]):
                            # What is black or glossy echoes in parts.
                            continue
                        known = claimed[i] or (r > rays[i, 8]) != (v > 0)
                        far = abs(r - last) > _SMOOTH_M + _SMOOTH * r
                        if states[i] != FOREGROUND or known or far or abs(i - (b if side > 0 else a)) > wide // 2:
                            break
                        last = r
                        x += rays[i, o] + r * rays[i, o + 2]
                        y += rays[i, o + 1] + r * rays[i, o + 3]
                        claimed[i] = True
                        hits += 1
                        a, b = min(a, i), max(b, i)
                for i in range(low, high + 1):
                    # Something else right beside it.
                    if (i < a or i > b) and states[i] == FOREGROUND and ranges[i] < away + 0.3:
                        alien += 1
                if out.verdict == HIT:
                    # Seen directly already: what a mirror shows is the same thing.
                    continue
                out.verdict = HIT
                out.n = hits
                out.spacing = away * abs(step)
                out.width = (b - a + 1) * out.spacing
                if v == 0 and hidden > 0:
                    aside = (0.5 * (a + b) - middle) * out.spacing
                    if thing.part_by != sensor or abs(aside - thing.part) > out.spacing:
                        thing.part, thing.part_by, thing.part_hits = aside, sensor, 0
                    thing.part += _PART * (aside - thing.part)
                    thing.part_hits = min(thing.part_hits + 1, 2 * _STEADY)
                quiet = thing.rate < QUIET
                # Of what is black or glossy a scan shows a part: how wide it is has been seen in others.
                wide = max(out.width, 2.0 * thing.half) if quiet else out.width
                out.x, out.y = middle_of(ranges, rays, o, a, b, x / hits, y / hits, wide)
                out.clean = 1 if alien == 0 and (quiet or b - a + 1 == hits) and not _cut(ranges, a, b) else 0
                continue
            if out.verdict == HIT:
                continue
            if 2 * beyond >= total and (hidden == 0 or beyond >= 2) and 3 * mute < total:
                # By way of a mirror places are less exact: what hides a thing directly says more.
                if v == 0 or out.verdict == UNSEEN:
                    out.verdict = FREE
            elif v == 0 and shows and _past(ranges, states, part, away + gate):
                out.verdict = PAST
                thing.part_hits -= _SELDOM
            elif out.verdict == UNSEEN and hidden > 0:
                out.verdict = HIDDEN
            elif out.verdict == UNSEEN and (beyond == 0 or mute > 0):
                out.verdict = SILENT


@njit(cache=True)
def _nearer(ranges: Array, states: NDArray[np.int8], low: int, high: int, before: float) -> bool:
    """Whether something new stands nearer than ``before`` m: if it is dark, beams that bring nothing met it, too."""
    for i in range(max(low, 0), min(high, ranges.size - 1) + 1):
        if states[i] == FOREGROUND and ranges[i] < before:
            return True
    return False


@njit(cache=True)
def claim(
    clusters: Any,
    of: NDArray[np.int64],
    prints: Any,
    somebodys: NDArray[np.bool_],
    start: int,
    claimed: NDArray[np.bool_],
) -> int:
    """Mark the beams that are somebody or something as ``claimed`` (n,), from cluster ``start`` on.

    The first cluster that has turned out to be furniture ends it, which is told; else it is how many there are.
    """
    for k in range(start, clusters.size):
        c, j = clusters[k], of[k]
        if j >= 0 and prints[j].revealed:
            return k
        # Without room for a print it may be anything.
        if somebodys[k] or j < 0 or (prints[j].hits >= 3 and prints[j].hits > 0.6 * prints[j].looks):
            claimed[c.first : c.last + 1] = True
    return int(clusters.size)


@njit(cache=True)
def guard(ranges: Array, states: NDArray[np.int8], claimed: NDArray[np.bool_]) -> None:
    """Extend ``claimed`` (n,) to what is beside it: at the edge of a thing a beam shows a bit of what is behind, too.

    And where something thin stands before it, a beam shows now that, now the thing, ``ranges`` (n,) m.
    """
    n = states.size
    edge = -9
    for i in range(n):
        if claimed[i] and states[i] == FOREGROUND:
            for k in range(max(i - _GUARD, 0), i):
                claimed[k] |= _belongs(ranges, states, k, i)
            edge = i
        elif i - edge <= _GUARD and _belongs(ranges, states, i, edge):
            claimed[i] = True


@njit(cache=True, inline="always")
def _belongs(ranges: Array, states: NDArray[np.int8], i: int, edge: int) -> bool:
    """Whether beam i, beside a thing that ends at beam ``edge``, may show a bit of it."""
    if states[i] == BEYOND:
        return bool(abs(ranges[i] - ranges[edge]) < _GOES_ON_M)
    return bool(states[i] == BACKGROUND or states[i] == FOREGROUND)


@njit(cache=True)
def clear(x: float, y: float, half: float, sight: Sight) -> int:
    """Whether the sensor looks past (x, y) ± half m.

    FREE, HIDDEN behind something new, WALLED behind the background, else UNSEEN (out of view or reach).
    """
    ranges, states, _, pose, first, step = sight
    n = ranges.size
    away = norm(x - pose[0], y - pose[1])
    middle = beam_of(np.arctan2(y - pose[1], x - pose[0]) - pose[2], first, step, n)
    if np.isnan(middle):
        return UNSEEN
    reach = np.arctan(half / max(away, 0.05)) / abs(step)
    low, high = max(0, int(middle - reach)), min(n - 1, int(middle + reach + 1))
    beyond, hidden, walled, total = 0, 0, 0, 0
    for i in range(low, high + 1):
        if states[i] == 0:
            continue
        total += 1
        if states[i] == FOREGROUND and ranges[i] < away - half:
            hidden += 1
        elif states[i] != NO_ECHO and ranges[i] > away + half:
            beyond += 1
        elif states[i] == BACKGROUND and ranges[i] < away - half:
            walled += 1
    if total == 0:
        return UNSEEN
    if 3 * hidden >= total:
        return HIDDEN
    if 2 * walled >= total:
        return WALLED
    return FREE if 2 * beyond >= total else UNSEEN
