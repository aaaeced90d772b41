"""How well poses of an object fit what beams and tag reader said during one visit."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from tms_agents.slam.geometry import Floats, compose
from tms_agents.slam.semidynamic.antenna import read_odds
from tms_agents.slam.semidynamic.evidence import CELL_M, Place, Worth
from tms_agents.slam.semidynamic.models import Antenna, ObjectModel
from tms_agents.slam.semidynamic.recesses import flanked, goes_on
from tms_agents.slam.semidynamic.shapes import Shape

#: Nobody reads a tag through a wall: what is nowhere seen, but was read, costs so much.
_UNSEEN, _SEEN_ENOUGH = -3.0, 2.0


@dataclass(frozen=True, slots=True, eq=False)
class Heard:
    """Rounds of one antenna at ``poses`` (R, 3) that all ``read`` the tag or all did not, each for ``weight``."""

    antenna: Antenna
    poses: Floats
    read: bool
    weight: float = 1.0


@dataclass(frozen=True, slots=True, eq=False)
class Sight:
    """One visit as evidence: what the cells of ``place`` say, and what the reader said."""

    place: Place
    cells: Worth
    heard: Sequence[Heard]

    @property
    def was_read(self) -> bool:
        return any(one.read and len(one.poses) for one in self.heard)

    def score(self, model: ObjectModel, shape: Shape, poses: Floats) -> Floats:
        """Log-likelihood (N,) of poses (N, 3), up to a constant."""
        return self.seen(shape, poses) + self.read(model, poses)

    def seen(self, shape: Shape, poses: Floats) -> Floats:
        """What the beams say (N,)."""
        found = np.empty(len(poses))
        cells = self.cells
        _sums(
            poses, shape.outline, shape.normals, shape.beyond, shape.edges, shape.inside, shape.hinged, cells.seen,
            cells.always, cells.towards, cells.through, cells.inside, cells.wall, cells.surface, self.place.corner,
            CELL_M, found,
        )  # fmt: skip
        if not self.was_read:
            return found
        return found + _UNSEEN * np.clip(1 - found / _SEEN_ENOUGH, 0, 1)

    def read(self, model: ObjectModel, poses: Floats) -> Floats:
        """What the reader says (N,)."""
        tags = compose(poses, np.broadcast_to(model.tag, poses.shape))
        found: Floats = np.zeros(len(poses))
        for one in self.heard:
            found += one.weight * read_odds(one.antenna, one.poses, tags, read=one.read)
        return found


@njit(cache=True)
def _sums(
    poses: Floats,
    outline: Floats,
    normals: Floats,
    beyond: Floats,
    edges: NDArray[np.int64],
    inside: Floats,
    hinged: bool,
    seen: Floats,
    always: Floats,
    towards: Floats,
    through: Floats,
    deep: Floats,
    wall: NDArray[np.bool_],
    surface: Floats,
    corner: Floats,
    cell: float,
    found: Floats,
) -> None:
    height, width = seen.shape
    for n in range(poses.shape[0]):
        c, s = np.cos(poses[n, 2]), np.sin(poses[n, 2])
        left, low = poses[n, 0] - corner[0], poses[n, 1] - corner[1]
        total, usual = 0.0, 0.0
        for m in range(outline.shape[0]):
            x = int((left + c * outline[m, 0] - s * outline[m, 1]) / cell)
            y = int((low + s * outline[m, 0] + c * outline[m, 1]) / cell)
            if 0 <= x < width and 0 <= y < height:
                total += through[y, x]
                if seen[y, x] + always[y, x] > 0.0:
                    nx, ny = c * normals[m, 0] - s * normals[m, 1], s * normals[m, 0] + c * normals[m, 1]
                    # What faces away is seen by nobody; at a slant there are fewer beams, which says nothing.
                    facing = min(max(4.0 * (nx * towards[y, x, 0] + ny * towards[y, x, 1]), 0.0), 1.0)
                    total += seen[y, x] * facing
                    usual += always[y, x] * facing
            last = m + 1 == outline.shape[0] or edges[m + 1] != edges[m]
            if last and not hinged and usual > 0.0:
                past = flanked(poses[n], beyond[edges[m]], wall, corner, cell) if edges[m] >= 0 else 0.0
                total += usual * max(1.0 - 2.0 * past, 0.0)
                usual = 0.0
        for m in range(inside.shape[0]):
            x = int((left + c * inside[m, 0] - s * inside[m, 1]) / cell)
            y = int((low + s * inside[m, 0] + c * inside[m, 1]) / cell)
            if 0 <= x < width and 0 <= y < height:
                total += deep[y, x]
        if usual > 0.0:
            past = goes_on(poses[n], outline, normals, beyond, towards, wall, surface, corner, cell)
            total += usual * max(1.0 - 2.0 * past, 0.0)
        found[n] = total
