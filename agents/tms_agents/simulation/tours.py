"""Buildings and ways through them that are drawn: for judging a mapper on loops that nobody laid out for it."""

from __future__ import annotations

import itertools

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from tms_agents.simulation.building import Plan

_ACROSS_M, _UP_M = (22.0, 100.0), (18.0, 80.0)


def drawn_plan(random: np.random.Generator, length: float = 1900.0) -> Plan:
    """2 to 4 times 2 to 3 crossings at drawn distances, the corridors between them, some of which are left out (every
    crossing stays on a ring), and a way of ``length`` m that takes what was driven least."""
    columns, rows = int(random.integers(2, 5)), int(random.integers(2, 4))
    xs = np.concatenate([[0.0], np.cumsum(random.uniform(*_ACROSS_M, columns - 1))]).round(1)
    ys = np.concatenate([[0.0], np.cumsum(random.uniform(*_UP_M, rows - 1))]).round(1)
    corners = [(float(x), float(y)) for y in ys for x in xs]
    numbers = np.arange(len(corners)).reshape(rows, columns)
    corridors = [(int(a), int(b)) for row in numbers for a, b in itertools.pairwise(row)]
    corridors += [(int(a), int(b)) for column in numbers.T for a, b in itertools.pairwise(column)]
    kept = corridors
    for n in random.permutation(len(corridors)):
        without = [one for one in kept if one != corridors[n]]
        if random.uniform() < 0.5 and _on_rings(without, len(corners)):
            kept = without
    return corners, kept, _way(corners, kept, length, random)


def _on_rings(corridors: list[tuple[int, int]], crossings: int) -> bool:
    """Whether all crossings hang together and none is a dead end."""
    first, second = np.array(corridors).T
    graph = coo_array((np.ones(len(first)), (first, second)), shape=(crossings, crossings))
    ends = np.bincount(np.concatenate([first, second]), minlength=crossings)
    return bool(ends.min() >= 2 and connected_components(graph, directed=False)[0] == 1)


def _way(
    corners: list[tuple[float, float]], corridors: list[tuple[int, int]], length: float, random: np.random.Generator
) -> list[int]:
    driven = dict.fromkeys(corridors, 0)
    at, before, way, total = 0, -1, [0], 0.0
    while total < length:
        options = [one for one in corridors if at in one and before not in one]
        corridor = options[int(np.argmin([driven[one] + random.uniform(0.0, 0.5) for one in options]))]
        driven[corridor] += 1
        to = corridor[1] if corridor[0] == at else corridor[0]
        total += float(np.hypot(*np.subtract(corners[to], corners[at])))
        way.append(to)
        at, before = to, at
    return way
