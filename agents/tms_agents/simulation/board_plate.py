"""Statics of a shelf board that rests on load cells."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


def load_shares(cells: Sequence[tuple[float, float]], stiffness: Sequence[float] | None = None) -> Floats:
    """What each cell carries of the board's load, as a matrix (k, 3) for the vector (F, F x, F y).

    More than three cells under a board are statically indeterminate: forces and moments alone do not say who carries
    what. Here the board is rigid and every cell a linear spring (equal ones by default), fixed to the board so that it
    can also pull. The board then sinks and tilts as a plane, and the shares are linear in the load's position, so loads
    add up; their sum is the load and their centre of gravity its position.

    ``cells``: positions in metres. Raises ValueError for fewer than three cells or cells on one line.
    """
    xy = np.asarray(cells, dtype=np.float64)
    if xy.ndim != 2 or xy.shape[0] < 3 or xy.shape[1] != 2:
        raise ValueError("a board needs at least three cells, each at (x, y)")
    springs = np.ones(len(xy)) if stiffness is None else np.asarray(stiffness, dtype=np.float64)
    if springs.shape != (len(xy),) or not np.all(springs > 0):
        raise ValueError("one positive stiffness per cell, please")
    planes = np.column_stack([np.ones(len(xy)), xy])  # a plane's height at each cell, for its three coefficients
    if np.linalg.matrix_rank(planes, tol=1e-6) < 3:
        raise ValueError("the cells are on one line: the board would tip over")
    pressed = planes * springs[:, None]
    shares: Floats = pressed @ np.linalg.inv(planes.T @ pressed)
    return shares
