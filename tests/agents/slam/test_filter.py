"""The filter as a whole: true to the building, the same for any number of threads, another for another seed."""

from __future__ import annotations

import numba
import numpy as np
import pytest

from tms_agents.slam import ParticleFilter, Settings, build_map
from tms_agents.slam.geometry import between
from tms_agents.slam.keyframes import key_scans, poses_of_all


def run(log, scans, threads=1, **changes):
    numba.set_num_threads(min(threads, numba.config.NUMBA_NUM_THREADS))
    particles = ParticleFilter(Settings(particles=8, **changes), log.laser)
    for n in range(scans):
        particles.process(log.odometry[n], log.driven[n], log.points(n))
    return particles


def revisit_error(truth, poses):
    """Mean error (m) of the relative pose between visits of the same place."""
    errors = []
    for n in range(len(truth) // 2):
        later = np.arange(n + 40, len(truth))
        other = later[np.argmin(np.hypot(*(truth[later, :2] - truth[n, :2]).T))]
        error = between(between(truth[n], truth[other]), between(poses[n], poses[other]))
        errors.append(np.hypot(*error[:2]))
    return float(np.mean(errors))


def test_any_number_of_threads_gives_the_same_bits(log):
    one, two = run(log, 60, threads=1), run(log, 60, threads=2)
    np.testing.assert_array_equal(one.path(), two.path())
    np.testing.assert_array_equal(one.log_weights, two.log_weights)
    for n in range(8):
        np.testing.assert_array_equal(one.maps.occupancy.dense(n), two.maps.occupancy.dense(n))
        np.testing.assert_array_equal(one.maps.distance.dense(n), two.maps.distance.dense(n))


def test_the_seed_decides(log):
    again, other = run(log, 20), run(log, 20, seed=1)
    np.testing.assert_array_equal(run(log, 20).path(), again.path())
    assert not np.array_equal(again.path(), other.path())


def test_the_building_is_mapped_and_loops_close(driven, log):
    result = build_map(log, Settings(particles=10, seed=2))
    odometry = revisit_error(driven.truth, driven.odometry)
    assert odometry > 0.5
    assert revisit_error(driven.truth, result.poses) < 0.06
    occupied = np.argwhere(result.grid.probabilities() > 0.65)[:, ::-1]
    found = (occupied + 0.5) * result.grid.resolution + np.array(result.grid.origin)
    near = _distance_to_walls(driven.walls, _into_truth(driven.truth[0], found))
    assert np.mean(near < 0.1) > 0.97


def test_scans_between_keys_are_led_by_odometry(log):
    keys = key_scans(log, 2.0, 1.0)
    path = log.odometry[keys] + np.array([3.0, 0.0, 0.0])
    poses = poses_of_all(log, keys, path)
    np.testing.assert_allclose(between(poses[keys], path), 0.0, atol=1e-9)
    np.testing.assert_allclose(poses[: keys[-1], :2], log.odometry[: keys[-1], :2] + [3.0, 0.0], atol=1e-6)


def test_every_scan_of_a_log_of_key_scans_is_one(log):
    assert len(key_scans(log, 0.5, 0.25)) == len(log)
    assert len(key_scans(log, 5.0, 3.0)) < len(log) / 2


@pytest.mark.parametrize("points", [np.zeros((0, 2)), np.array([[1.0, 0.0]])])
def test_scans_that_see_nothing_do_no_harm(points):
    particles = ParticleFilter(Settings(particles=3), np.zeros(3))
    for n in range(4):
        particles.process(np.array([0.5 * n, 0.0, 0.0]), np.array([0.5 * n, 0.0]), points)
    assert np.isfinite(particles.path()).all()


def _into_truth(first, points):
    c, s = np.cos(first[2]), np.sin(first[2])
    return points @ np.array([[c, s], [-s, c]]) + first[:2]


def _distance_to_walls(walls, points):
    least = np.full(len(points), np.inf)
    for x0, y0, x1, y1 in walls:
        a, along = np.array([x0, y0]), np.array([x1 - x0, y1 - y0])
        share = np.clip((points - a) @ along / (along @ along), 0, 1)
        least = np.minimum(least, np.hypot(*(a + share[:, None] * along - points).T))
    return least
