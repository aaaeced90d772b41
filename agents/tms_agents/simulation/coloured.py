"""Places that geometry tells little of: flat corridors and a round hall with coloured panels, or all of one colour.

Walls are (W, 5): x0, y0, x1, y1 m and the reflectance.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from tms_agents.simulation.building import Floats, edges

#: What walls are painted with, and how bright panels on them may be.
PAINT, DARKEST, BRIGHTEST = 0.5, 0.1, 0.95


@dataclass(frozen=True, slots=True, eq=False)
class Place:
    """``walls`` (W, 5) and the corners (C, 2) m of the way through them; odometry is ``off`` so many m at its worst, or
    as chance will have it."""

    walls: Floats
    way: Floats
    off: float | None = None


def corridor(random: np.random.Generator, *, coloured: bool = True, length: float = 42.0, width: float = 2.2) -> Place:
    """Flat walls, driven there and back."""
    outline = np.array([(0, 0, length, 0), (length, 0, length, width), (length, width, 0, width), (0, width, 0, 0)])
    middle = width / 2 + random.uniform(-0.15, 0.15)
    way = np.array([(1.2, middle), (length - 2.0, middle), (1.4, middle)])
    return Place(_panelled(outline, random) if coloured else _plain(outline), way)


def plain_corridor(random: np.random.Generator) -> Place:
    """The same without a colour: nothing tells how far one has come."""
    return corridor(random, coloured=False)


def hall(random: np.random.Generator) -> Place:
    """A round hall, driven through to and fro: geometry does not tell which way one looks."""
    radius = random.uniform(2.7, 3.3)
    angles = np.linspace(0.0, 2 * np.pi, 241)
    corners = radius * np.stack([np.cos(angles), np.sin(angles)], axis=-1)
    reflectance = np.repeat(random.uniform(DARKEST, BRIGHTEST, 80), random.integers(3, 22, 80))[:240]
    reflectance[np.repeat(random.uniform(size=60) < 0.4, 4)] = PAINT
    walls = np.column_stack([corners[:-1], corners[1:], reflectance])
    spokes = np.cumsum(random.uniform(1.6, 2.6, 16))
    places = random.uniform(0.9, 1.5, 16)[:, None] * np.stack([np.cos(spokes), np.sin(spokes)], axis=-1)
    return Place(walls, np.concatenate([[(0.0, 0.0)], places, [(0.0, 0.0)]]))


def room(random: np.random.Generator) -> Place:
    """Furniture in a room, all of one colour: geometry tells everything, light nothing."""
    walls = [(0, 0, 8, 0), (8, 0, 8, 6), (8, 6, 0, 6), (0, 6, 0, 0)]
    for x, y in ((0.6, 3.2), (2.6, 5.4), (7.3, 4.6), (4.2, 3.0), (6.9, 0.7), (2.2, 0.6), (5.2, 5.5)):
        half, deep, turn = random.uniform(0.2, 0.5), random.uniform(0.15, 0.3), random.uniform(-0.5, 0.5)
        c, s = np.cos(turn), np.sin(turn)
        box = [
            (x + c * a - s * b, y + s * a + c * b)
            for a, b in ((-half, -deep), (half, -deep), (half, deep), (-half, deep))
        ]
        walls += [(*p, *q) for p, q in zip(box, box[1:] + box[:1], strict=True)]
    tour = [(1.6, 1.8), (4.0, 1.5), (6.4, 2.2), (6.0, 4.2), (4.2, 4.4), (2.2, 4.0)]
    jittered = np.array(tour) + random.uniform(-0.2, 0.2, (6, 2))
    return Place(_plain(np.array(walls, dtype=np.float64)), np.concatenate([jittered, jittered, jittered[:1]]))


def eight(random: np.random.Generator) -> Place:
    """A figure of eight of corridors, 200 m, with odometry that is 20 m off."""
    half, long, deep = random.uniform(0.95, 1.15), random.uniform(28.0, 31.0), random.uniform(15.0, 17.0)
    xs, ys = (0.0, long, 2 * long), (0.0, deep)
    boxes = [(xs[0] - half, y - half, xs[2] + half, y + half) for y in ys]
    boxes += [(x - half, ys[0] - half, x + half, ys[1] + half) for x in xs]
    turns = [(1, 0), (2, 0), (2, 1), (1, 1), (1, 0), (0, 0), (0, 1), (1, 1), (1, 0), (1.6, 0)]
    way = np.array([(x * long, y * deep) for x, y in turns])
    return Place(_panelled(edges(boxes), random), way, off=20.0)


PLACES: dict[str, Callable[[np.random.Generator], Place]] = {
    "corridor": corridor,
    "plain corridor": plain_corridor,
    "hall": hall,
    "plain room": room,
    "eight": eight,
}


def _plain(outline: Floats) -> Floats:
    return np.column_stack([outline, np.full(len(outline), PAINT)])


def _panelled(outline: Floats, random: np.random.Generator) -> Floats:
    """Every wall cut into paint and panels by turns."""
    walls = []
    for x0, y0, x1, y1 in outline:
        length = float(np.hypot(x1 - x0, y1 - y0))
        place, panel = 0.0, False
        while place < length:
            end = min(length, place + (random.uniform(0.15, 1.9) if panel else random.uniform(0.15, 1.4)))
            a, b = place / length, end / length
            ends = (x0 + a * (x1 - x0), y0 + a * (y1 - y0), x0 + b * (x1 - x0), y0 + b * (y1 - y0))
            walls.append((*ends, random.uniform(DARKEST, BRIGHTEST) if panel else PAINT))
            place, panel = end, not panel
    return np.array(walls)
