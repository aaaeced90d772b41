"""What a sweep would measure without any error: the first thing that each beam meets."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numba import njit

from tms_agents.simulation.floor_world.shapes import NOBODY, Bools, Floats, Ints, Pose, Shapes


@dataclass(frozen=True, slots=True, eq=False)
class Cast:
    """Per beam (n,): ``ranges`` m (+inf: nothing), ``cosines`` of the angle of incidence, the owner of what was met,
    its reflectivity and its probability of an echo."""

    ranges: Floats
    cosines: Floats
    owners: Ints
    reflectivity: Floats
    echo: Floats


def cast(shapes: Shapes, pose: Pose, first_angle: float, step: float, count: int, increment_s: float) -> Cast:
    """Sweep from ``pose``; beam i points to ``first_angle + i * step`` and comes ``i * increment_s`` after the first.

    Shapes are where they are at the first beam and move on with their velocities, so a leg is sheared as in reality.
    """
    ranges = np.full(count, np.inf)
    cosines = np.ones(count)
    hit = np.full(count, -1, dtype=np.int64)
    geometry = (pose[0], pose[1], pose[2] + first_angle, step, increment_s)
    _cast(shapes.segments, shapes.circles, *geometry, ranges, cosines, hit)
    materials = np.vstack([shapes.segment_material, shapes.circle_material, np.zeros((1, 3))])
    if (materials[:, 2] > 0).any():
        mirrors = materials[:, 2] > 0
        _reflect(shapes.segments, shapes.circles, mirrors, *geometry, ranges, cosines, hit)
    owners = np.concatenate([shapes.segment_owner, shapes.circle_owner, np.array([NOBODY])])
    met = materials[hit]
    return Cast(ranges, cosines, owners[hit], met[:, 0], met[:, 1])


@njit(cache=True)
def _cast(
    segments: Floats,
    circles: Floats,
    x: float,
    y: float,
    first: float,
    step: float,
    increment: float,
    ranges: Floats,
    cosines: Floats,
    hit: Ints,
) -> None:
    """Nearest hits into ``ranges``, ``cosines`` and ``hit`` (n,); segments are numbered first, then circles.

    Works shape by shape: only the beams that can meet it are looked at.
    """
    count = len(ranges)
    duration = increment * count
    for k in range(len(segments)):
        x0, y0, x1, y1, vx, vy = segments[k]
        start = math.atan2(y0 - y, x0 - x)
        turn = math.atan2(y1 - y, x1 - x) - start
        turn = (turn + math.pi) % (2 * math.pi) - math.pi
        low, high = (start, start + turn) if turn >= 0 else (start + turn, start)
        near = max(0.02, _distance_to_segment(x, y, x0, y0, x1, y1))
        margin = step + math.hypot(vx, vy) * duration / near
        for lap in range(-2, 3):
            i0 = max(0, math.ceil((low - margin + lap * 2 * math.pi - first) / step))
            i1 = min(count - 1, math.floor((high + margin + lap * 2 * math.pi - first) / step))
            for i in range(i0, i1 + 1):
                angle, later = first + i * step, i * increment
                r, cosine = _meet_segment(
                    x, y, math.cos(angle), math.sin(angle), x0 + vx * later, y0 + vy * later, x1 - x0, y1 - y0
                )
                if r < ranges[i]:
                    ranges[i], cosines[i], hit[i] = r, cosine, k
    for k in range(len(circles)):
        cx, cy, radius, vx, vy = circles[k]
        apart = math.hypot(cx - x, cy - y)
        if apart <= radius:
            continue
        middle = math.atan2(cy - y, cx - x)
        margin = math.asin(radius / apart) + step + math.hypot(vx, vy) * duration / (apart - radius + 0.02)
        for lap in range(-2, 3):
            i0 = max(0, math.ceil((middle - margin + lap * 2 * math.pi - first) / step))
            i1 = min(count - 1, math.floor((middle + margin + lap * 2 * math.pi - first) / step))
            for i in range(i0, i1 + 1):
                angle, later = first + i * step, i * increment
                r, cosine = _meet_circle(
                    x, y, math.cos(angle), math.sin(angle), cx + vx * later, cy + vy * later, radius
                )
                if r < ranges[i]:
                    ranges[i], cosines[i], hit[i] = r, cosine, len(segments) + k


@njit(cache=True)
def _reflect(
    segments: Floats,
    circles: Floats,
    mirrors: Bools,
    x: float,
    y: float,
    first: float,
    step: float,
    increment: float,
    ranges: Floats,
    cosines: Floats,
    hit: Ints,
) -> None:
    """Beams that meet a mirror go on once more; a second mirror echoes nothing."""
    for i in range(len(ranges)):
        k = hit[i]
        if k < 0 or k >= len(segments) or not mirrors[k]:
            continue
        angle, later = first + i * step, i * increment
        c, s = math.cos(angle), math.sin(angle)
        px, py = x + ranges[i] * c, y + ranges[i] * s
        tx, ty = segments[k, 2] - segments[k, 0], segments[k, 3] - segments[k, 1]
        length = math.hypot(tx, ty)
        tx, ty = tx / length, ty / length
        along = c * tx + s * ty
        c, s = 2 * along * tx - c, 2 * along * ty - s
        px, py = px + 1e-6 * c, py + 1e-6 * s
        best, cosine, met = np.inf, 1.0, -1
        for j in range(len(segments)):
            x0, y0, x1, y1, vx, vy = segments[j]
            r, inclined = _meet_segment(px, py, c, s, x0 + vx * later, y0 + vy * later, x1 - x0, y1 - y0)
            if j != k and r < best:
                best, cosine, met = r, inclined, j
        for j in range(len(circles)):
            cx, cy, radius, vx, vy = circles[j]
            r, inclined = _meet_circle(px, py, c, s, cx + vx * later, cy + vy * later, radius)
            if r < best:
                best, cosine, met = r, inclined, len(segments) + j
        ranges[i], cosines[i], hit[i] = ranges[i] + best, cosine, met


@njit(cache=True)
def _meet_segment(
    x: float, y: float, c: float, s: float, x0: float, y0: float, dx: float, dy: float
) -> tuple[float, float]:
    """Distance along the ray (c, s) to the segment from (x0, y0) by (dx, dy), and the cosine of incidence."""
    cross = c * dy - s * dx
    if abs(cross) < 1e-12:
        return np.inf, 1.0
    ax, ay = x0 - x, y0 - y
    along = (ax * s - ay * c) / cross
    r = (ax * dy - ay * dx) / cross
    if r <= 0 or along < -1e-9 or along > 1 + 1e-9:  # no beam slips through a corner
        return np.inf, 1.0
    return r, abs(cross) / math.hypot(dx, dy)


@njit(cache=True)
def _meet_circle(x: float, y: float, c: float, s: float, cx: float, cy: float, radius: float) -> tuple[float, float]:
    ax, ay = cx - x, cy - y
    along = ax * c + ay * s
    off = ax * s - ay * c
    under = radius * radius - off * off
    if under < 0 or along <= 0:
        return np.inf, 1.0
    half = math.sqrt(under)
    if along - half <= 0:
        return np.inf, 1.0
    return along - half, half / radius


@njit(cache=True)
def _distance_to_segment(x: float, y: float, x0: float, y0: float, x1: float, y1: float) -> float:
    dx, dy = x1 - x0, y1 - y0
    length2 = dx * dx + dy * dy
    u = 0.0 if length2 == 0 else min(1.0, max(0.0, ((x - x0) * dx + (y - y0) * dy) / length2))
    return math.hypot(x0 + u * dx - x, y0 + u * dy - y)
