"""The floor plan of a room, and ways through it that keep off walls, furniture and things."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra

from tms_agents.simulation.floor_world.room import Furniture, Wall
from tms_agents.simulation.floor_world.shapes import Bools, Floats, Xy, to_box

_CELL = 0.08
#: Depth of the corridor outside each door.
CORRIDOR = 1.5


@dataclass(frozen=True, kw_only=True, slots=True)
class Door:
    """An opening in the east ("e") or west ("w") wall around ``y``."""

    wall: str
    y: float
    width: float = 0.95


@dataclass(frozen=True, kw_only=True, slots=True)
class Plan:
    """A rectangle of ``width`` by ``depth`` with its corner at the origin, without the ``niche`` in its far corner."""

    width: float
    depth: float
    niche: Xy  # of the north-east corner, (0, 0) for none
    doors: tuple[Door, ...]
    inner: tuple[Wall, ...] = field(default=())

    def outline(self, margin: float = 0.0) -> list[Xy]:
        """Corners of the floor, counter-clockwise."""
        w, d, (nx, ny), m = self.width, self.depth, self.niche, margin
        if nx == 0 or ny == 0:
            return [(-m, -m), (w + m, -m), (w + m, d + m), (-m, d + m)]
        return [(-m, -m), (w + m, -m), (w + m, d - ny + m), (w - nx + m, d - ny + m), (w - nx + m, d + m), (-m, d + m)]

    def contains(self, xy: Xy, margin: float = 0.0) -> bool:
        """On the floor of the room and not nearer to its walls than ``margin``."""
        x, y = xy
        if not (margin <= x <= self.width - margin and margin <= y <= self.depth - margin):
            return False
        nx, ny = self.niche
        return not (nx > 0 and ny > 0 and x > self.width - nx - margin and y > self.depth - ny - margin)

    def walls(self) -> list[Wall]:
        """Walls with gaps for the doors, and a long corridor outside, in whose length a beam echoes from nothing."""
        corners = self.outline()
        walls: list[Wall] = list(self.inner)
        for a, b in zip(corners, corners[1:] + corners[:1], strict=True):
            side = "e" if a[0] == b[0] == self.width else "w" if a[0] == b[0] == 0 else ""
            cuts = sorted(
                (door.y - door.width / 2, door.y + door.width / 2) for door in self.doors if door.wall == side
            )
            if not side or not cuts:
                walls.append(Wall(a, b))
                continue
            low = min(a[1], b[1])
            for start, end in cuts:
                walls.append(Wall((a[0], low), (a[0], start)))
                low = end
            walls.append(Wall((a[0], low), (a[0], max(a[1], b[1]))))
        for side in {door.wall for door in self.doors}:
            x = self.width + CORRIDOR if side == "e" else -CORRIDOR
            walls.append(Wall((x, -12.0), (x, self.depth + 12.0)))
            near = self.width if side == "e" else 0.0
            walls += [Wall((near, -12.0), (near, 0.0)), Wall((near, self.depth), (near, self.depth + 12.0))]
        return walls

    def gate(self, door: Door) -> list[Xy]:
        """Half a metre on both sides of an opening."""
        x = self.width if door.wall == "e" else 0.0
        low, high = door.y - door.width / 2, door.y + door.width / 2
        return [(x - 0.5, low), (x + 0.5, low), (x + 0.5, high), (x - 0.5, high)]

    def outside(self, door: Door, rng: np.random.Generator) -> Xy:
        """A place in the corridor, out of sight of most of the room."""
        x = self.width + CORRIDOR / 2 if door.wall == "e" else -CORRIDOR / 2
        return (x, door.y + rng.choice([-1, 1]) * rng.uniform(0.9, 1.4))


class Ways:
    """Where a body of radius ``radius`` can be, and the best way from here to there."""

    def __init__(self, plan: Plan, furniture: Iterable[Furniture], things: Iterable[tuple[Xy, float]], radius: float):
        self._x = np.arange(-CORRIDOR + 0.1, plan.width + CORRIDOR - 0.1, _CELL)
        self._y = np.arange(-1.5, plan.depth + 1.5, _CELL)
        grid = np.stack(np.meshgrid(self._x, self._y, indexing="ij"), axis=-1)
        clear = np.full(grid.shape[:2], 9.0)
        for wall in plan.walls():
            np.minimum(clear, _to_segment(grid, wall.a, wall.b), out=clear)
        for piece in furniture:
            np.minimum(clear, to_box(grid, piece.pose, piece.width, piece.depth), out=clear)
        for xy, size in things:
            np.minimum(clear, np.hypot(grid[..., 0] - xy[0], grid[..., 1] - xy[1]) - size / 2, out=clear)
        x, y = grid[..., 0], grid[..., 1]
        sides = {door.wall for door in plan.doors}
        walkable = (x > 0) & (x < plan.width) & (y > 0) & (y < plan.depth)
        walkable |= ((x < 0) & ("w" in sides)) | ((x > plan.width) & ("e" in sides))
        self.clearance = clear
        self.free: Bools = walkable & (clear > radius)
        self._graph: csr_array | None = None

    def is_free(self, xy: Xy) -> bool:
        i, j = self._cell(xy)
        return 0 <= i < len(self._x) and 0 <= j < len(self._y) and bool(self.free[i, j])

    def room_at(self, xy: Xy) -> float:
        """Metres to whatever is nearest; 0 where nobody can be."""
        i, j = self._cell(xy)
        inside = 0 <= i < len(self._x) and 0 <= j < len(self._y)
        return float(self.clearance[i, j]) if inside else 0.0

    def nearest_free(self, xy: Xy) -> Xy:
        """The free place nearest to this one."""
        free = np.argwhere(self.free)
        gaps = np.hypot(self._x[free[:, 0]] - xy[0], self._y[free[:, 1]] - xy[1])
        i, j = free[int(np.argmin(gaps))]
        return (float(self._x[i]), float(self._y[j]))

    def path(self, start: Xy, goal: Xy) -> list[Xy] | None:
        """Corners of a way that ends exactly at ``goal`` where that is free; None where there is none."""
        a = start if self.is_free(start) else self.nearest_free(start)
        b = goal if self.is_free(goal) else self.nearest_free(goal)
        n = len(self._y)
        source, target = (i * n + j for i, j in (self._cell(a), self._cell(b)))
        if self._graph is None:
            self._graph = self._edges()
        cost, before = dijkstra(self._graph, indices=target, return_predecessors=True)
        if not np.isfinite(cost[source]):
            return None
        cells, at = [], source
        while at != target:
            cells.append((float(self._x[at // n]), float(self._y[at % n])))
            at = int(before[at])
        return self._pulled([a, *cells[1:], b])

    def _pulled(self, points: Sequence[Xy]) -> list[Xy]:
        """Without the corners that a straight line can skip."""
        out, i = [points[0]], 0
        while i < len(points) - 1:
            k = min(len(points) - 1, i + 40)
            while k > i + 1 and not self._sees(points[i], points[k]):
                k -= 1
            out.append(points[k])
            i = k
        return out[1:]

    def _sees(self, a: Xy, b: Xy) -> bool:
        steps = max(2, int(math.dist(a, b) / (_CELL / 2)))
        u = np.linspace(0, 1, steps)
        i = np.round((a[0] + u * (b[0] - a[0]) - self._x[0]) / _CELL).astype(int)
        j = np.round((a[1] + u * (b[1] - a[1]) - self._y[0]) / _CELL).astype(int)
        return bool(self.free[i.clip(0, len(self._x) - 1), j.clip(0, len(self._y) - 1)].all())

    def _cell(self, xy: Xy) -> tuple[int, int]:
        return round((xy[0] - self._x[0]) / _CELL), round((xy[1] - self._y[0]) / _CELL)

    def _edges(self) -> csr_array:
        """Eight neighbours; near obstacles a metre costs up to thrice as much."""
        index = np.arange(self.free.size).reshape(self.free.shape)
        price = 1 + 2 * np.clip(0.5 - self.clearance, 0, 0.5) / 0.5
        rows, columns, costs = [], [], []
        for di, dj in ((1, 0), (0, 1), (1, 1), (1, -1)):
            a = (slice(0, self.free.shape[0] - di), slice(max(0, -dj), self.free.shape[1] - max(0, dj)))
            b = (slice(di, None), slice(max(0, dj), self.free.shape[1] + min(0, dj)))
            both = self.free[a] & self.free[b]
            cost = _CELL * math.hypot(di, dj) * (price[a] + price[b])[both] / 2
            rows += [index[a][both], index[b][both]]
            columns += [index[b][both], index[a][both]]
            costs += [cost, cost]
        shape = (self.free.size, self.free.size)
        return csr_array((np.concatenate(costs), (np.concatenate(rows), np.concatenate(columns))), shape=shape)


def _to_segment(points: Floats, a: Xy, b: Xy) -> Floats:
    ax, ay = points[..., 0] - a[0], points[..., 1] - a[1]
    dx, dy = b[0] - a[0], b[1] - a[1]
    u = np.clip((ax * dx + ay * dy) / max(dx * dx + dy * dy, 1e-12), 0, 1)
    return np.hypot(ax - u * dx, ay - u * dy)
