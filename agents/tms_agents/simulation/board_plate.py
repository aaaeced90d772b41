"""Statics of a shelf board that rests on load cells."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


def load_shares(
    cells: Sequence[tuple[float, float]], stiffness: Sequence[float] | None = None, torsion: float = math.inf
) -> Floats:
    """What each cell carries of the board's load, as a matrix (k, 4) for the vector (F, F x, F y, F x y).

    More than three cells under a board are statically indeterminate: forces and moments alone do not say who carries
    what. Here every cell is a linear spring (equal ones by default) fixed to the board, so that it can also pull; the
    board sinks and tilts as a plane and, unless ``torsion`` is infinite, twists by (x - xm) (y - ym) against its own
    stiffness, which is ``torsion`` times that of the springs against the same twist. A rigid board on four cells lets
    a load on one corner rest on its cell by 3/4 and relieves the far one by 1/4; one without any stiffness gives the
    corner's cell everything. In both the sum is the load and the centre of gravity its position.

    ``cells``: positions in metres. Raises ValueError for fewer than three cells or cells on one line.
    """
    xy = np.asarray(cells, dtype=np.float64)
    if xy.ndim != 2 or xy.shape[0] < 3 or xy.shape[1] != 2:
        raise ValueError("a board needs at least three cells, each at (x, y)")
    springs = np.ones(len(xy)) if stiffness is None else np.asarray(stiffness, dtype=np.float64)
    if springs.shape != (len(xy),) or not np.all(springs > 0):
        raise ValueError("one positive stiffness per cell, please")
    x, y = xy.T
    planes = np.column_stack([np.ones(len(xy)), x, y])
    if np.linalg.matrix_rank(planes, tol=1e-6) < 3:
        raise ValueError("the cells are on one line: the board would tip over")
    if math.isinf(torsion):
        shares: Floats = np.hstack([_spread(planes, springs, np.zeros((3, 3))), np.zeros((len(xy), 1))])
        return shares
    xm, ym = xy.mean(axis=0)
    bent = np.column_stack([planes, (x - xm) * (y - ym)])
    resistance = np.zeros((4, 4))
    resistance[3, 3] = torsion * float(springs @ bent[:, 3] ** 2)
    # From the vector with F x y to the one with F (x - xm) (y - ym).
    centred = np.eye(4)
    centred[3] = [xm * ym, -ym, -xm, 1.0]
    spread: Floats = _spread(bent, springs, resistance) @ centred
    return spread


def _spread(shapes: Floats, springs: Floats, resistance: Floats) -> Floats:
    """Forces of the springs (k, m) for unit loads on the ``shapes`` (k, m) in which the board can yield."""
    pressed = shapes * springs[:, None]
    forces: Floats = pressed @ np.linalg.inv(shapes.T @ pressed + resistance)
    return forces
