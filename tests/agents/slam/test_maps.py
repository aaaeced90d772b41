"""Rays and distance fields against plain computations on whole arrays."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.ndimage import distance_transform_edt

from tms_agents.slam.geometry import transform
from tms_agents.slam.maps import Maps
from tms_agents.slam.occupancy import EVEN, UNKNOWN
from tms_agents.slam.tiles import TiledMaps

LASER = np.array([0.1, 0.05])


def random_scans(seed: int, count: int, maps: int) -> list[tuple[np.ndarray, np.ndarray]]:
    """Walls that come and go, seen from here and there."""
    random = np.random.default_rng(seed)
    found = []
    for _ in range(count):
        poses = np.column_stack([random.uniform(-2, 2, (maps, 2)), random.uniform(-3, 3, maps)])
        angles = np.sort(random.uniform(-np.pi, np.pi, 40))
        ranges = random.choice([1.0, 2.0, 3.0]) + random.uniform(0, 0.3, 40)
        found.append((poses, LASER + ranges[:, None] * np.stack([np.cos(angles), np.sin(angles)], axis=-1)))
    return found


@settings(max_examples=15)
@given(seed=st.integers(0, 10_000), count=st.integers(1, 12), resolution=st.sampled_from([0.05, 0.1, 0.03]))
def test_the_field_is_the_distance_to_the_nearest_occupied_cell(seed, count, resolution):
    maps = Maps(3, resolution, 0.5)
    random = np.random.default_rng(seed)
    for poses, points in random_scans(seed, count, 3):
        maps.integrate(poses, points, LASER)
        if random.random() < 0.3:
            maps.resample(random.integers(0, 3, 3).astype(np.int32))
    for n in range(3):
        occupied = maps.occupancy.dense(n) > EVEN
        expected = np.full(occupied.shape, maps.radius**2)
        if occupied.any():
            expected = np.minimum(expected, np.round(distance_transform_edt(~occupied) ** 2))
        np.testing.assert_array_equal(maps.distance.dense(n), expected)


def test_all_at_once_is_scan_by_scan():
    scans = random_scans(7, 6, 3)
    one, other = Maps(3, 0.05, 0.5), Maps(3, 0.05, 0.5)
    for poses, points in scans:
        one.integrate(poses, points, LASER)
    other.integrate_all([np.array([p[n] for p, _ in scans]) for n in range(3)], [[q for _, q in scans]] * 3, LASER)
    assert other.distance.tiles_used == 0
    other.measure()
    shift = np.round((one.frame[:2] - other.frame[:2]) / 0.05).astype(int)
    for n in range(3):
        for mine, its in ((one.occupancy, other.occupancy), (one.distance, other.distance)):
            found = {tuple(cell + shift): mine.dense(n)[*cell[::-1]] for cell in _told(mine, n)}
            assert found == {tuple(cell): its.dense(n)[*cell[::-1]] for cell in _told(its, n)}


def _told(tiles: TiledMaps, n: int) -> np.ndarray:
    """(x, y) of the cells of map ``n`` that say something."""
    return np.argwhere(tiles.dense(n) != tiles.blank)[:, ::-1]


def test_walls_appear_and_vanish_so_the_field_is_told_of_both():
    maps = Maps(1, 0.05, 0.5)
    here = np.zeros((1, 3))
    near, far = np.array([[1.0, 0.0]]), np.array([[2.0, 0.0]])
    maps.integrate(here, near, np.zeros(2))
    assert _distance(maps, (1.0, 0.0)) == 0.0
    for _ in range(10):
        maps.integrate(here, far, np.zeros(2))
    assert _distance(maps, (1.0, 0.0)) == maps.metres[255]
    assert _distance(maps, (2.0, 0.0)) == 0.0


def test_beams_free_the_cells_they_pass_and_no_others():
    maps = Maps(1, 0.05, 0.5)
    pose = np.array([[0.3, -0.2, 0.7]])
    points = np.array([[3.0, 0.4], [2.5, -1.0], [-1.5, 2.0]])
    maps.integrate(pose, points, LASER)
    start, ends = transform(pose[0], LASER[None])[0], transform(pose[0], points)
    dense = maps.occupancy.dense(0)
    cells = np.argwhere(dense != UNKNOWN)[:, ::-1]
    centres = maps.frame[:2] + (cells + 0.5) * 0.05
    away = np.full(len(cells), np.inf)
    for end in ends:
        share = np.clip((centres - start) @ (end - start) / np.sum((end - start) ** 2), 0, 1)
        away = np.minimum(away, np.hypot(*(start + share[:, None] * (end - start) - centres).T))
    assert away.max() < 0.05
    assert np.count_nonzero(dense > EVEN) == 3
    assert len(cells) >= int(np.hypot(*(ends - start).T).max() / 0.05)


def test_a_wall_seen_at_a_grazing_angle_stays():
    maps = Maps(1, 0.05, 0.5)
    wall = np.column_stack([np.linspace(0.5, 4.0, 200), np.full(200, 0.12)])
    for _ in range(20):
        maps.integrate(np.zeros((1, 3)), wall, np.zeros(2))
    assert max(_distance(maps, tuple(point)) for point in wall) == pytest.approx(0.0)


def _distance(maps: Maps, point: tuple[float, float]) -> float:
    x, y = np.floor((np.array(point) - maps.frame[:2]) * maps.frame[2]).astype(int)
    return float(maps.metres[maps.distance.dense(0)[y, x]])
