"""The place of a thing from the whole way on which its load came."""

from __future__ import annotations

import numpy as np
import pytest

from tms_agents.cabinet.geometry import Geometry
from tms_agents.cabinet.placing import Way, place, refine

BOARD = Geometry(((0.04, 0.047), (0.425, 0.047), (0.04, 0.27), (0.425, 0.27)), 0.465, 0.317)
SHARES = np.linalg.pinv(BOARD.moments)
SD_G, BLOCK_S, REST_BLOCKS = 4.0, 0.08, 6


def way(rng: np.random.Generator, weight: float, xy: np.ndarray, seconds: float, early: int = 1) -> Way:
    """A hand lowers it, pressing, and touches a centimetre off first; it seems at rest ``early`` blocks too soon."""
    rising = round(seconds / BLOCK_S)
    s = np.minimum((np.arange(rising + REST_BLOCKS) + 0.5) / rising, 1.0)
    force = weight * np.minimum(s / 0.7, 1.0) + (0.2 * weight + 20) * np.sin(np.pi * s**2)
    at = xy + rng.normal(0, 0.01, 2) * (1 - s)[:, None]
    clean = np.column_stack([force, force[:, None] * at]) @ SHARES.T
    level = rng.normal(0, SD_G / 5, 4)
    means = clean + SD_G * rng.standard_normal(clean.shape) - level
    t = BLOCK_S * (np.arange(len(s)) + 0.5)
    return Way(0.0, BLOCK_S * len(s), t, means, np.full(means.shape, SD_G**2), rising - early, np.full(4, SD_G**2 / 25))


def trials(weight: float, seconds: float, early: int = 1) -> tuple[float, float, float]:
    """Root mean squares (m) of the errors of the end's mean and of ``place``; its mean normalised square."""
    rng, squares = np.random.default_rng(7), []
    for _ in range(200):
        xy = rng.uniform([0.1, 0.1], [0.36, 0.22])
        came = way(rng, weight, xy, seconds, early)
        placed = place(came, BOARD)
        assert placed is not None
        moments = BOARD.moments @ came.means[came.tail :].mean(axis=0)
        error = np.array(placed.xy) - xy
        squares.append(
            [
                ((moments[1:] / moments[0] - xy) ** 2).sum(),
                (error**2).sum(),
                float((error**2 / np.array(placed.variance)).mean()),
            ]
        )
    end, whole, honest = np.mean(squares, axis=0)
    return float(np.sqrt(end)), float(np.sqrt(whole)), float(honest)


def test_the_way_tells_where_a_light_thing_stands() -> None:
    end, whole, honest = trials(60.0, 1.6)
    assert whole < 0.85 * end
    assert 0.6 < honest < 1.5


def test_the_edge_on_which_a_heavy_thing_came_down_is_no_part_of_its_place() -> None:
    end, whole, honest = trials(2000.0, 1.6, early=5)
    assert whole < 0.6 * end
    assert honest < 1.5


def test_a_level_known_better_later_sharpens_the_place() -> None:
    rng = np.random.default_rng(3)
    xy = np.array([0.2, 0.15])
    came = way(rng, 100.0, xy, 1.0)
    placed = place(came, BOARD)
    assert placed is not None
    load = SHARES @ np.array([100.0, *(100.0 * xy)])
    at, variance = refine(came, placed.tail, load, np.full(4, 0.1), BOARD)
    assert (variance < placed.variance).all()
    assert at == pytest.approx(xy, abs=4 * float(np.sqrt(variance.max())))


def test_too_short_a_way_tells_nothing() -> None:
    short = Way(0.0, 0.2, np.array([0.05, 0.15]), np.ones((2, 4)), np.ones((2, 4)), 0, np.ones(4))
    assert place(short, BOARD) is None
