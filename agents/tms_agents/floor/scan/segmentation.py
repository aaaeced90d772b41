"""From beams to clusters: what belongs together on one surface (adaptive breakpoints)."""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from tms_agents.floor.norm import norm
from tms_agents.floor.scan.background import BACKGROUND, FOREGROUND

Array = NDArray[np.float64]

#: A cluster in the room frame: (x, y) m of the middle of the thing, (width m) across the beams, (n) beams, (near) its
#: range, (first, last) beam, (cut) partly hidden behind something nearer, 2: that is new, (attached) its surface goes
#: on as background: a piece of furniture or wall, (gap) m to the background behind it, (mirror) seen in a mirror (-1:
#: directly), (ex, ey) the line from one end to the other, a unit vector, and the sine between it and the beams (slant),
#: (open) nothing comes back beside it, and nothing is known to be there: there may be more of it, `DARK` if what is
#: known there is silent mostly.
#: Of what is dark not every beam comes back: cut `FADES` beside beams that bring nothing, though they do mostly.
FADES, DARK = 3, 2
CLUSTER = np.dtype(
    [
        ("x", "f8"),
        ("y", "f8"),
        ("width", "f8"),
        ("near", "f8"),
        ("spacing", "f8"),
        ("n", "i8"),
        ("first", "i8"),
        ("last", "i8"),
        ("cut", "i8"),
        ("attached", "i8"),
        ("gap", "f8"),
        ("mirror", "i8"),
        ("ex", "f8"),
        ("ey", "f8"),
        ("slant", "f8"),
        ("open", "i8"),
    ]
)
#: The middle of a thing lies behind the surface seen by this share of its width (discs 0.39, boxes 0.3 to 0.5).
_DEPTH = 0.37
#: A jump between surfaces (m); the parts of one thing behind a thin post are at most so far apart (m, beams).
_EDGE_M, _HIDDEN_M, BRIDGE = 0.08, 0.15, 40
#: Where a surface is seen almost along it, what is beside it, of so few beams, so narrow (m), is a shred of it; at most
#: so many beams between are missing.
_SHRED, _SHRED_M, _LACKING = 2, 0.1, 1
#: A shred is so far before the beam beside it at most (m), and so far behind (m): as the surface bends away smoothly,
#: a little more than so many times as far as that beam is behind the one before it (m), or times the distance of two
#: beams, whichever is more. What is farther behind is the other foot.
_AHEAD_M, _BEHIND_M, _MORE_M, _BENDS, _SPACINGS = 0.1, 0.2, 0.03, 4.0, 7.0
#: So few beams may be a part of what is not known yet.
_SPECK = 2
#: What is seen in a mirror is what is seen directly if it is so near it (m, and share of the width).
_SAME_M, _SAME = 0.06, 0.25
#: A surface goes on so smoothly from beam to beam (m, and per metre of range: noise).
_SMOOTH_M, _SMOOTH_PER_M = 0.006, 0.002
#: What is so little (m) before the background may be taken for it.
_BEFORE_M = 0.1


@njit(cache=True)
def _flickers(ranges: Array, i: int) -> bool:
    """Whether beam i is alone between a nearer and a farther surface: it saw a bit of both."""
    n = ranges.size
    before = ranges[i - 1] if i > 0 else np.inf
    after = ranges[i + 1] if i < n - 1 else np.inf
    r = ranges[i]
    return bool(min(before, after) < r - _EDGE_M and not max(before, after) < r + _EDGE_M)


@njit(cache=True)
def _goes_on(ranges: Array, longest: Array, beside: int, edge: int, end: int) -> bool:
    """Whether the surface seen from beam ``edge`` to ``end`` goes on in the beam ``beside`` it.

    Of what lies right before a wall all beams but one may pass for the wall: it goes on where the wall is, not there.
    """
    slope, r = 0.0, ranges[beside]
    if edge == end and abs(longest[beside] - r) < _BEFORE_M:
        r = longest[beside]
    if edge != end:
        inner = edge + (1 if end > edge else -1)
        slope = ranges[edge] - ranges[inner]
        if np.isnan(slope) or abs(slope) > 0.03:
            slope = 0.0
    return bool(abs(r - ranges[edge] - slope) < _SMOOTH_M + _SMOOTH_PER_M * ranges[edge])


@njit(cache=True)
def _segment(
    ranges: Array,
    states: NDArray[np.int8],
    claimed: NDArray[np.bool_],
    longest: Array,
    steady: Array,
    rays: Array,
    step: Array,
    grazing: float,
    clusters: Any,
) -> int:
    """Join neighbouring foreground beams to ``clusters`` (max,); how many there are.

    longest, steady: (n,) m, the background, and where it is not mostly silent (inf elsewhere); rays: (n, 10), see
    `tms_agents.floor.scan.rays`; step: (n,) rad to the next beam. Two points belong together if they are nearer than a
    surface at the angle ``grazing`` could be (Borges and Aldon, "Line extraction in 2D range images", 2004); one beam
    between may be missing.
    """
    n = ranges.size
    count = 0
    last = -10
    for i in range(n):
        if states[i] != FOREGROUND or claimed[i]:
            continue
        r = ranges[i]
        mirrored = r > rays[i, 8]
        joined = False
        if _flickers(ranges, i):
            continue
        if count > 0 and (clusters[count - 1].mirror >= 0) == mirrored and i - last <= BRIDGE:
            before = ranges[last]
            angle = step[last] * (i - last)
            reach = min(r, before) * np.sin(angle) / np.sin(max(grazing - angle, 0.02)) + 0.012 + 0.004 * r
            gap = np.sqrt(r * r + before * before - 2.0 * r * before * np.cos(angle))
            if i - last <= 2:
                joined = gap < reach
            elif gap < _HIDDEN_M:
                # A thin leg of a table may stand before the middle of one thing, and a glossy one echoes in parts.
                joined = True
                for b in range(last + 1, i):
                    silent = np.isnan(ranges[b]) or (np.isinf(ranges[b]) and np.isfinite(longest[b]))
                    if not silent and not ranges[b] < min(r, before) - 0.05:
                        joined = False
                        break
        if not joined:
            if count == clusters.size:
                break
            clusters[count].first = i
            clusters[count].n = 0
            clusters[count].x = 0.0
            clusters[count].y = 0.0
            clusters[count].near = 0.0
            clusters[count].mirror = int(rays[i, 9]) if mirrored else -1
            count += 1
        c = clusters[count - 1]
        o = 4 if mirrored else 0
        c.x += rays[i, o] + r * rays[i, o + 2]
        c.y += rays[i, o + 1] + r * rays[i, o + 3]
        c.near += r
        c.n += 1
        c.last = i
        last = i
    for k in range(count):
        c = clusters[k]
        c.x /= c.n
        c.y /= c.n
        c.near /= c.n
        a, b = c.first, c.last
        o = 4 if c.mirror >= 0 else 0
        ax = rays[a, o] + ranges[a] * rays[a, o + 2]
        ay = rays[a, o + 1] + ranges[a] * rays[a, o + 3]
        bx = rays[b, o] + ranges[b] * rays[b, o + 2]
        by = rays[b, o + 1] + ranges[b] * rays[b, o + 3]
        c.spacing = c.near * step[a]
        c.width = norm(ax - bx, ay - by) + c.spacing
        _lies(c, bx - ax, by - ay, rays[(a + b) // 2, o + 2], rays[(a + b) // 2, o + 3])
        c.attached = 0
        if a > 0 and (states[a - 1] == BACKGROUND or claimed[a - 1]) and _goes_on(ranges, longest, a - 1, a, b):
            c.attached = 1
        if b < n - 1 and (states[b + 1] == BACKGROUND or claimed[b + 1]) and _goes_on(ranges, longest, b + 1, b, a):
            c.attached = 1
        c.cut, c.open = 0, 0
        for side in (a - 1, a - 2, b + 1, b + 2):
            if 0 <= side < n and ranges[side] < c.near - 0.1 and not np.isnan(ranges[side]):
                c.cut = max(c.cut, 1 if states[side] == BACKGROUND else 2)
        for side in (a - 1, b + 1):
            if 0 <= side < n and not np.isfinite(ranges[side]) and np.isfinite(steady[side]) and not c.cut:
                c.cut = FADES
            elif 0 <= side < n and np.isinf(ranges[side]) and not np.isfinite(steady[side]):
                c.open = DARK if np.isfinite(longest[side]) else max(c.open, 1)
        middle = (a + b) // 2
        c.gap = longest[middle] - ranges[middle]
        shift = _DEPTH * min(c.width, 0.5)
        c.x += shift * rays[middle, o + 2]
        c.y += shift * rays[middle, o + 3]
    return count


@njit(cache=True)
def _lies(c: Any, dx: float, dy: float, u: float, v: float) -> None:
    """Note which way the cluster points, from end (dx, dy) m to end, and how much across the beam (u, v)."""
    far = norm(dx, dy)
    c.ex, c.ey, c.slant = 0.0, 0.0, 1.0
    if far > 0.0:
        c.ex, c.ey = dx / far, dy / far
        c.slant = abs(u * c.ey - v * c.ex)


@njit(cache=True)
def _without_shreds(ranges: Array, clusters: Any) -> int:
    """Give the shreds among ``clusters`` (m,) to what they are shreds of: how many, at the front, are left.

    The side of a shoe that points at the laser, or of a robot, falls to clusters of one or two beams, each farther
    away than the one before. Their beams belong to the whole; its place and width are those of its face.
    """
    m = clusters.size
    shred = np.zeros(m, np.bool_)
    for k in range(m):
        if clusters[k].n <= _SHRED:
            continue
        for way in (-1, 1):
            o = k + way
            while 0 <= o < m and _is_shred(ranges, clusters[o], clusters[k], way):
                shred[o] = True
                if way > 0:
                    clusters[k].last = clusters[o].last
                else:
                    clusters[k].first = clusters[o].first
                o += way
    kept = 0
    for k in range(m):
        if not shred[k]:
            kept = keep(clusters, kept, k)
    return kept


@njit(cache=True)
def _is_shred(ranges: Array, p: Any, c: Any, way: int) -> bool:
    """Whether p, beside the cluster c in the direction ``way`` (±1) of the beams, is a shred of it."""
    edge, beside = (c.last, p.first) if way > 0 else (c.first, p.last)
    if p.mirror != c.mirror or p.n > _SHRED or p.width > _SHRED_M or way * (beside - edge) - 1 > _LACKING:
        return False
    most = _SPACINGS * c.spacing
    inner = edge - way
    if 0 <= inner < ranges.size and ranges[edge] > ranges[inner]:
        most = max(most, _MORE_M + _BENDS * (ranges[edge] - ranges[inner]))
    return bool(-_AHEAD_M < ranges[beside] - ranges[edge] < min(most, _BEHIND_M))


@njit(cache=True)
def _once(clusters: Any) -> int:
    """Move what is seen directly, or in a mirror alone, to the front of ``clusters`` (m,); how many these are."""
    kept = 0
    for k in range(clusters.size):
        c = clusters[k]
        twice = False
        if c.mirror >= 0:
            for o in range(clusters.size):
                p = clusters[o]
                reach = _SAME_M + _SAME * max(c.width, p.width)
                if p.mirror < 0 and norm(c.x - p.x, c.y - p.y) < reach:
                    twice = True
        # Else one thing would be taken for two feet at one place.
        if not twice:
            kept = keep(clusters, kept, k)
    return kept


@njit(cache=True)
def backed(clusters: Any) -> int:
    """Move what stands before something known, or shows more than `_SPECK` beams, to the front of ``clusters`` (m,).

    How many these are. While a room is learned, what else is seen may be a wall that seldom echoes.
    """
    kept = 0
    for k in range(clusters.size):
        if clusters[k].n > _SPECK or np.isfinite(clusters[k].gap):
            kept = keep(clusters, kept, k)
    return kept


@njit(cache=True)
def keep(clusters: Any, kept: int, k: int) -> int:
    """Move the cluster k after the first ``kept`` of ``clusters`` (m,), which count: how many do now."""
    if kept != k:
        clusters[kept] = clusters[k]
    return kept + 1


class Segmenter:
    """Clusters of one sensor's scans; the array of clusters is reused."""

    def __init__(self, step: Array, grazing_rad: float, most: int = 128) -> None:
        self._step, self._grazing = step, grazing_rad
        self._clusters = np.zeros(most, CLUSTER)

    def __call__(
        self,
        ranges: Array,
        states: NDArray[np.int8],
        claimed: NDArray[np.bool_],
        longest: Array,
        steady: Array,
        rays: Array,
    ) -> Any:
        """The clusters of one scan (m,) of ``CLUSTER``: ranges, states, claimed, longest, steady (n,), rays (n, 10)."""
        count = _segment(ranges, states, claimed, longest, steady, rays, self._step, self._grazing, self._clusters)
        clusters = self._clusters[:count]
        clusters = clusters[: _without_shreds(ranges, clusters)]
        return clusters[: _once(clusters)]
