"""The best pose of a point cloud in a large window, found without looking at most of it.

Correlative search over a pyramid in which a cell of level h holds the best score of the 2^h x 2^h cells from it on
(Olson 2009; Hess et al. 2016, section V): no pose inside a node scores higher than the node, so nodes below the best
pose found so far are left out.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit, prange

from tms_agents.slam.geometry import Bytes, Floats, Ints
from tms_agents.slam.sharing import queue, take
from tms_agents.slam.tiles import MASK, SHIFT, SIDE

LEVELS = 6


@njit(cache=True, parallel=True)
def fill_pyramids(directory: Ints, squared: Bytes, scores: Bytes, pool: int, levels: Bytes) -> None:
    """Pyramids of N distance fields, tiles (N, H, W), into ``levels`` (N, LEVELS, H' + pad, W' + pad) of zeros.

    Cells of level 0 are ``pool`` x ``pool`` of the field, with the best of their ``scores`` (256,) by squared distance
    in cells, 255 = best; pad = 2^(LEVELS-1) cells below and to the left stay 0.
    """
    pad = 1 << (levels.shape[1] - 1)
    line = queue(len(directory))
    for begin in prange(len(directory)):
        n = take(line, begin)
        while n < len(directory):
            for ty in range(directory.shape[1]):
                for tx in range(directory.shape[2]):
                    tile = directory[n, ty, tx]
                    if tile == 0:
                        continue
                    for place in range(SIDE * SIDE):
                        score = scores[squared[tile, place]]
                        y = pad + ((ty << SHIFT) + (place >> SHIFT)) // pool
                        x = pad + ((tx << SHIFT) + (place & MASK)) // pool
                        if score > levels[n, 0, y, x]:
                            levels[n, 0, y, x] = score
            for h in range(1, levels.shape[1]):
                _coarser(levels[n, h - 1], 1 << (h - 1), levels[n, h])
            n = take(line, n)


@njit(cache=True)
def _coarser(fine: Bytes, half: int, coarse: Bytes) -> None:
    """The best of each cell and those ``half`` cells above, to the right, and both."""
    height, width = fine.shape
    for y in range(height):
        up = min(y + half, height - 1)
        for x in range(width):
            coarse[y, x] = max(fine[y, x], fine[up, x]) if y + half < height else fine[y, x]
        for x in range(width - half):
            coarse[y, x] = max(coarse[y, x], coarse[y, x + half])


@njit(cache=True, parallel=True)
def best_poses(
    levels: Bytes,
    which: Ints,
    origin: Floats,
    scale: float,
    clouds: Floats,
    lengths: Ints,
    centres: Floats,
    windows: Floats,
    turns: Floats,
    turn_step: float,
    least: float,
    found: Floats,
    scores: Floats,
) -> None:
    """`best_pose` of clouds (A, M, 2), of which the first ``lengths`` (A,) points count, in pyramid ``which[a]`` each;
    ``found`` (A, 3) and ``scores`` (A,) are written."""
    line = queue(len(which))
    for begin in prange(len(which)):
        a = take(line, begin)
        while a < len(which):
            scores[a] = best_pose(
                levels[which[a]], origin, scale, clouds[a, : lengths[a]], centres[a], windows[a], turns[a], turn_step,
                least, found[a],
            )  # fmt: skip
            a = take(line, a)


@njit(cache=True)
def best_pose(
    levels: Bytes,
    origin: Floats,
    scale: float,
    points: Floats,
    centre: Floats,
    window: float,
    turn: float,
    turn_step: float,
    least: float,
    found: Floats,
) -> float:
    """Mean score 0..1 of the best pose within ``window`` m and ``turn`` rad of ``centre`` (3,); 0 if none is above
    ``least``.

    ``origin`` (2,) m is the lower left corner of level 0 without its pad, ``scale`` cells per m; ``points`` (M, 2).
    """
    count = len(points)
    pad = 1 << (len(levels) - 1)
    reach = math.ceil(window * scale)
    around = math.ceil(turn / turn_step)
    angles = 2 * around + 1
    cells = np.empty((angles, count, 2), dtype=np.int32)
    for a in range(angles):
        theta = centre[2] + (a - around) * turn_step
        cosine, sine = math.cos(theta), math.sin(theta)
        for m in range(count):
            x = centre[0] + cosine * points[m, 0] - sine * points[m, 1] - origin[0]
            y = centre[1] + sine * points[m, 0] + cosine * points[m, 1] - origin[1]
            cells[a, m, 0] = math.floor(x * scale) + pad
            cells[a, m, 1] = math.floor(y * scale) + pad
    top = len(levels) - 1
    stride = 1 << top
    across = (2 * reach) // stride + 1
    total = angles * across * across
    scores = np.empty(total, dtype=np.int64)
    for a in range(angles):
        for i in range(across):
            for j in range(across):
                number = (a * across + i) * across + j
                scores[number] = _score(levels[top], cells[a], -reach + i * stride, -reach + j * stride)
    best = int(least * 255 * count)
    best_a, best_x, best_y = -1, 0, 0
    stack = np.empty((4 * top + 8, 5), dtype=np.int64)
    for number in np.argsort(-scores):
        if scores[number] <= best:
            break
        a = number // (across * across)
        stack[0, 0], stack[0, 1] = top, a
        stack[0, 2] = -reach + (number // across) % across * stride
        stack[0, 3] = -reach + number % across * stride
        stack[0, 4] = scores[number]
        depth = 1
        while depth > 0:
            depth -= 1
            level, a, x, y, score = stack[depth]
            if score <= best:
                continue
            if level == 0:
                best, best_a, best_x, best_y = score, a, x, y
                continue
            half = 1 << (level - 1)
            first = depth
            for k in range(4):
                cx, cy = x + (k & 1) * half, y + (k >> 1) * half
                value = _score(levels[level - 1], cells[a], cx, cy)
                if value > best:
                    place = depth
                    while place > first and stack[place - 1, 4] > value:
                        stack[place] = stack[place - 1]
                        place -= 1
                    stack[place, 0], stack[place, 1], stack[place, 2] = level - 1, a, cx
                    stack[place, 3], stack[place, 4] = cy, value
                    depth += 1
    if best_a < 0:
        return 0.0
    found[0] = centre[0] + best_x / scale
    found[1] = centre[1] + best_y / scale
    found[2] = centre[2] + (best_a - around) * turn_step
    return best / (255.0 * count)


@njit(cache=True)
def _score(level: Bytes, cells: Ints, dx: int, dy: int) -> int:
    total = 0
    for m in range(len(cells)):
        x, y = cells[m, 0] + dx, cells[m, 1] + dy
        if 0 <= x < level.shape[1] and 0 <= y < level.shape[0]:
            total += level[y, x]
    return total
