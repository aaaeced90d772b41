"""Where the cells of a board are, what an antenna covers, what a thing weighs: the fixed facts of a cabinet."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
#: Covariance of (x, y) as (var_x, cov_xy, var_y), m^2.
Covariance = tuple[float, float, float]


@dataclass(frozen=True)
class Geometry:
    """A rigid board on load cells; frame in metres, the board is the rectangle from (0, 0) to (width, depth).

    Raises:
        ValueError: fewer than three cells, cells on one line, or a cell off the board.
    """

    cells: tuple[tuple[float, float], ...]
    width: float
    depth: float
    #: (3, k): ones, x, y of the cells; times grams it gives load and moments.
    moments: Array = field(init=False, repr=False, compare=False)
    #: (k - 3, k), orthonormal: what is left of a load vector beside load and moments (the twist of the board).
    twist: Array = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        cells = np.asarray(self.cells, dtype=float).reshape(-1, 2)
        if not (np.isfinite(cells).all() and self.width > 0 and self.depth > 0):
            raise ValueError("a board needs finite cell positions and a positive width and depth")
        moments = np.vstack([np.ones(len(cells)), cells.T])
        if len(cells) < 3 or np.linalg.matrix_rank(moments) < 3:
            raise ValueError("a board needs at least three cells that are not on one line")
        if (cells < -1e-9).any() or (cells > np.array([self.width, self.depth]) + 1e-9).any():
            raise ValueError("every cell must be on the board, between (0, 0) and (width, depth)")
        object.__setattr__(self, "moments", moments)
        object.__setattr__(self, "twist", np.linalg.svd(moments)[2][3:])

    @property
    def count(self) -> int:
        """Number of cells, k."""
        return len(self.cells)


@dataclass(frozen=True)
class Zone:
    """What one antenna covers: a polygon on the board, or all of it."""

    name: str
    polygon: tuple[tuple[float, float], ...] | None = None

    def covers(self, xy: tuple[float, float], margin_m: float = 0.0) -> bool:
        """Whether ``xy`` is in the zone or at most ``margin_m`` outside it."""
        if self.polygon is None:
            return True
        corners = np.asarray(self.polygon, dtype=float)
        edges = np.roll(corners, -1, axis=0) - corners
        to = np.asarray(xy) - corners
        # Even-odd rule: how many edges does a ray to the right cross?
        above = corners[:, 1] > xy[1]
        crossing = above != np.roll(above, -1)
        rise = np.where(edges[:, 1] == 0, 1.0, edges[:, 1])
        right = to[:, 0] < edges[:, 0] * to[:, 1] / rise
        if np.count_nonzero(crossing & right) % 2:
            return True
        along = np.clip((to * edges).sum(1) / np.maximum((edges**2).sum(1), 1e-12), 0.0, 1.0)
        return bool(np.hypot(*(to - along[:, None] * edges).T).min() <= margin_m)


@dataclass(frozen=True)
class KnownWeight:
    """What an object weighs, from the object database or from an earlier stay."""

    mean_g: float
    sd_g: float
