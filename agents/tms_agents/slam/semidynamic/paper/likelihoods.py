"""Likelihoods of a scan for many particles: P(L|D), rays traced to an object's outline, and P(L|X), ends in the grid.

Beams beside each other are no independent witnesses: each scan counts as a few beams, however many there are.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit

from tms_agents.slam.distance import field_at
from tms_agents.slam.geometry import Bytes, Floats, Ints, inverse
from tms_agents.slam.semidynamic.models import ObjectModel
from tms_agents.slam.semidynamic.paper.grid import RewrittenGrid

#: How a beam differs from where its ray meets the outline: scale (m), at most so bad if it ended before (hidden), or
#: went on beyond.
_SCALE_M, _HIDDEN, _THROUGH = 0.05, 2.0, 3.0
#: So many beams a scan counts as; what fewer beams than that meet was hardly seen.
_OBJECT_BEAMS, _SCAN_BEAMS, _FEW = 2.0, 10.0, 8
#: How an end of a beam differs from the nearest surface of the grid (m).
_SIGMA_M = 0.05


@dataclass(frozen=True, slots=True, eq=False)
class Outline:
    """``edges`` (E, 4) m from corner to corner, seen from the tag."""

    edges: Floats

    @classmethod
    def of(cls, model: ObjectModel) -> Outline:
        x, y, turn = inverse(model.tag)
        c, s = np.cos(turn), np.sin(turn)
        pieces = []
        for part in model.parts:
            corners = part @ np.array([[c, s], [-s, c]]) + np.array([x, y])
            pieces.append(np.column_stack([corners, np.roll(corners, -1, axis=0)]))
        return cls(np.concatenate(pieces))


def outline_fits(outline: Outline, tags: Floats, lasers: Floats, beams: Floats) -> Floats:
    """Log P(L|D) (N,) of tag poses (N, 3) seen by lasers at (N, 3); ``beams`` (B, 2): rising angle, range (0: none)."""
    found = np.empty(len(tags))
    _trace(outline.edges, tags, lasers, beams, found)
    return found


def scan_fits(grid: RewrittenGrid, lasers: Floats, beams: Floats) -> Floats:
    """Log P(L|X) (N,) of lasers at (N, 3), from the distances of the ends of ``beams`` (B, 2) to surfaces."""
    maps = grid.maps
    found = np.empty(len(lasers))
    _ends(maps.distance.directory[0], maps.distance.cells, maps.metres, maps.frame, lasers, beams, found)
    return found


@njit(cache=True)
def _trace(edges: Floats, tags: Floats, lasers: Floats, beams: Floats, found: Floats) -> None:
    count = len(beams)
    first, step = beams[0, 0], (beams[count - 1, 0] - beams[0, 0]) / max(count - 1, 1)
    expected = np.full(count, np.inf)
    for n in range(len(tags)):
        c, s = np.cos(lasers[n, 2]), np.sin(lasers[n, 2])
        dx, dy = tags[n, 0] - lasers[n, 0], tags[n, 1] - lasers[n, 1]
        x, y = c * dx + s * dy, c * dy - s * dx
        turn = tags[n, 2] - lasers[n, 2]
        c, s = np.cos(turn), np.sin(turn)
        low, high = count, -1
        for e in range(len(edges)):
            ax, ay = x + c * edges[e, 0] - s * edges[e, 1], y + s * edges[e, 0] + c * edges[e, 1]
            bx, by = x + c * edges[e, 2] - s * edges[e, 3], y + s * edges[e, 2] + c * edges[e, 3]
            if min(ax, bx) < 0.0 and min(ay, by) <= 0.0 <= max(ay, by):
                continue  # crosses the ray straight behind the laser, where angles wrap
            a, b = np.arctan2(ay, ax), np.arctan2(by, bx)
            i, j = int(np.ceil((min(a, b) - first) / step)), int(np.floor((max(a, b) - first) / step))
            cross = ax * by - ay * bx
            for k in range(max(i, 0), min(j, count - 1) + 1):
                u, v = np.cos(beams[k, 0]), np.sin(beams[k, 0])
                across = u * (by - ay) - v * (bx - ax)
                if abs(across) > 1e-9:
                    reach = cross / across
                    if 0.0 < reach < expected[k]:
                        expected[k] = reach
            low, high = min(low, max(i, 0)), max(high, min(j, count - 1))
        total, met = 0.0, 0
        for k in range(low, high + 1):
            if expected[k] < np.inf:
                if beams[k, 1] > 0.0:
                    apart = beams[k, 1] - expected[k]
                    total += min(apart / _SCALE_M, _THROUGH) if apart > 0.0 else min(-apart / _SCALE_M, _HIDDEN)
                    met += 1
                expected[k] = np.inf
        missing = max(_FEW - met, 0)
        found[n] = -_OBJECT_BEAMS * (total + missing * _HIDDEN) / (met + missing)


@njit(cache=True)
def _ends(
    directory: Ints, squared: Bytes, metres: Floats, frame: Floats, lasers: Floats, beams: Floats, found: Floats
) -> None:
    for n in range(len(lasers)):
        total, ended = 0.0, 0
        for k in range(len(beams)):
            if beams[k, 1] <= 0.0:
                continue
            angle = lasers[n, 2] + beams[k, 0]
            x = (lasers[n, 0] + beams[k, 1] * np.cos(angle) - frame[0]) * frame[2]
            y = (lasers[n, 1] + beams[k, 1] * np.sin(angle) - frame[1]) * frame[2]
            apart, _, _ = field_at(directory, squared, metres, frame[2], x, y)
            total += 0.5 * (apart / _SIGMA_M) ** 2
            ended += 1
        found[n] = -_SCAN_BEAMS * total / max(ended, 1)
