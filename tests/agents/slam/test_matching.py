"""A scan finds its place: near by, after a slip of the wheels, and anywhere in a large window."""

from __future__ import annotations

import numpy as np
import pytest

from tms_agents.slam.branch_and_bound import LEVELS, best_pose, fill_pyramids
from tms_agents.slam.filter import drawn
from tms_agents.slam.gridmap import render
from tms_agents.slam.matching import SHARE, linearise, match_all
from tms_agents.slam.tiles import SIDE, TiledMaps

ORIGIN = np.zeros(2)


@pytest.fixture(scope="module")
def room():
    """A room with a corner cut in, and what a scan in its middle sees."""
    wall = np.concatenate(
        [_line((-3, -2), (3, -2)), _line((3, -2), (3, 1)), _line((3, 1), (1, 1)), _line((1, 1), (1, 2.5)),
         _line((1, 2.5), (-3, 2.5)), _line((-3, 2.5), (-3, -2))]
    )  # fmt: skip
    return render(np.zeros((1, 3)), [wall], ORIGIN, 0.05, 0.5), wall


def matched(room, prior, poor_share=0.85):
    maps, points = room
    poses, hessians, results = np.empty((1, 3)), np.empty((1, 3, 3)), np.empty((1, 3))
    precision = np.diag([1 / 0.1**2, 1 / 0.1**2, 1 / 0.1**2])[None]
    match_all(
        maps.distance.directory, maps.distance.cells, maps.metres, maps.frame, points, prior[None], prior[None],
        precision, 0.1, 1.0, poor_share, maps.occupancy.directory, maps.occupancy.cells, poses, hessians, results,
    )  # fmt: skip
    return poses[0], hessians[0], results[0]


@pytest.mark.parametrize("prior", [(0.15, -0.1, 0.08), (-0.1, 0.2, -0.1), (0.0, 0.0, 0.0)])
def test_near_by(room, prior):
    pose, hessian, result = matched(room, np.array(prior))
    np.testing.assert_allclose(pose, 0.0, atol=0.02)
    assert result[SHARE] > 0.95
    assert (np.linalg.eigvalsh(hessian) > 100).all()


def test_after_a_slip_only_the_search_finds_it(room):
    priors = [np.array([x, y, turn]) for x in (-0.45, 0.45) for y in (-0.45, 0.45) for turn in (-0.45, 0.45)]
    lost = [matched(room, prior, poor_share=0.0)[0] for prior in priors]
    found = [matched(room, prior)[0] for prior in priors]
    assert np.hypot(*np.array(lost)[:, :2].T).max() > 0.2
    np.testing.assert_allclose(found, 0.0, atol=0.06)


def test_the_gradient_is_that_of_the_cost(room):
    maps, points = room
    pose, precision = np.array([0.06, 0.03, 0.02]), np.eye(3)
    gradient, hessian, result = np.empty(3), np.empty((3, 3)), np.empty(3)

    def cost(at):
        return linearise(
            maps.distance.directory[0], maps.distance.cells, maps.metres, maps.frame, points, at, np.zeros(3),
            precision, 0.1, 1.0, hessian, gradient, result,
        )  # fmt: skip

    numeric = [(cost(pose + step) - cost(pose - step)) / 2e-6 for step in 1e-6 * np.eye(3)]
    cost(pose)
    np.testing.assert_allclose(gradient, numeric, rtol=0.02, atol=1.0)


def test_draws_have_the_covariance_of_the_match():
    hessian = np.array([[400.0, 50.0, 10.0], [50.0, 100.0, 5.0], [10.0, 5.0, 900.0]])
    normals = np.random.default_rng(0).standard_normal((40_000, 3))
    deviations = drawn(np.broadcast_to(hessian, (40_000, 3, 3)), normals)
    np.testing.assert_allclose(np.cov(deviations.T) @ hessian, np.eye(3), atol=0.05)


@pytest.mark.parametrize("seed", range(6))
def test_branch_and_bound_is_as_good_as_looking_everywhere(seed):
    random = np.random.default_rng(seed)
    scores = (random.random((60, 70)) ** 8 * 255).astype(np.uint8)
    points = random.uniform(-2.0, 2.0, (25, 2))
    centre = np.array([3.5, 3.0, 0.3])
    found = np.empty(3)
    best = best_pose(pyramid(scores), ORIGIN, 10.0, points, centre, 1.5, 0.2, 0.1, 0.0, found)
    everywhere = max(
        _score(scores, points, centre + np.array([dx / 10, dy / 10, turn * 0.1]))
        for dx in range(-15, 16) for dy in range(-15, 16) for turn in range(-2, 3)
    )  # fmt: skip
    # Its lattice may reach beyond the window by less than a cell of the coarsest level, so it may find more.
    assert best >= everywhere - 1e-9
    assert best == pytest.approx(_score(scores, points, found))


def test_nothing_good_enough_is_nothing():
    found = np.empty(3)
    empty = pyramid(np.zeros((40, 40), dtype=np.uint8))
    assert best_pose(empty, ORIGIN, 10.0, np.ones((5, 2)), np.zeros(3), 1.0, 0.1, 0.05, 0.3, found) == 0.0


def pyramid(scores):
    """Of scores (H, W), by way of tiles whose squared distances are the scores themselves."""
    tiles = TiledMaps(1, 0, -(-scores.shape[0] // SIDE), -(-scores.shape[1] // SIDE))
    height, width = tiles.directory.shape[1:]
    wanted = np.arange(height * width, dtype=np.int32)[None]
    tiles.make_writable(wanted, np.array([height * width], dtype=np.int32))
    for y, x in np.ndindex(scores.shape):
        tiles.cells[tiles.directory[0, y // SIDE, x // SIDE], y % SIDE * SIDE + x % SIDE] = scores[y, x]
    pad = 1 << (LEVELS - 1)
    levels = np.zeros((1, LEVELS, SIDE * height + pad, SIDE * width + pad), dtype=np.uint8)
    fill_pyramids(tiles.directory, tiles.cells, np.arange(256, dtype=np.uint8), 1, levels)
    return levels[0]


def _score(scores, points, pose):
    c, s = np.cos(pose[2]), np.sin(pose[2])
    rotated = points @ np.array([[c, s], [-s, c]])
    cells = np.floor((rotated + pose[:2]) * 10 + 1e-9).astype(int)
    x, y = cells.T
    inside = (x >= 0) & (y >= 0) & (x < scores.shape[1]) & (y < scores.shape[0])
    return scores[y[inside], x[inside]].sum() / 255 / len(points)


def _line(a, b):
    """In the middle of cells."""
    return np.linspace(a, b, 60) + 0.025
