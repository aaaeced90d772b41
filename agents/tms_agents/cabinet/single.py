"""A board that is one scale: the estimator sees a board whose whole load is on one cell in its middle.

Position then is always the middle, whatever the estimator says of it; how far off that may be is the size of the board.
"""

from __future__ import annotations

from collections.abc import Sequence

from tms_agents.cabinet.geometry import Covariance, Geometry


def single_geometry(width: float, depth: float) -> Geometry:
    """Three cells, the second and third of which never carry anything."""
    return Geometry(((width / 2, depth / 2), (0.0, 0.0), (width, 0.0)), width, depth)


def single_loads(grams: Sequence[float]) -> list[float]:
    """Of one cell -> of three."""
    return [grams[0], 0.0, 0.0]


def anywhere(width: float, depth: float) -> Covariance:
    """Of a thing that stands anywhere on the board, all places equally probable."""
    return (width**2 / 12, 0.0, depth**2 / 12)
