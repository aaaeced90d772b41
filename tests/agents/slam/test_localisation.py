"""Localisation: from anywhere to the right place, back after being carried away, and never sure where nobody can be."""

from __future__ import annotations

import numba
import numpy as np
import pytest

from tms_agents.simulation.building import Drive, carmen, drive
from tms_agents.slam import Settings, build_map
from tms_agents.slam.geometry import between, compose
from tms_agents.slam.known import KnownMap, known_map
from tms_agents.slam.localisation import Localiser
from tms_agents.slam.localisation_settings import LocalisationSettings
from tms_agents.slam.localising import localise
from tms_agents.slam.logs_carmen import parse_carmen

HALF = 85


@pytest.fixture(scope="module")
def made(log):
    """(map of the first round, path of both rounds in it)."""
    result = build_map(log, Settings(particles=8, seed=1))
    grid = result.grid
    return known_map(grid.probabilities(), grid.origin, grid.resolution), result.poses


def followed(made, log, first, end, threads=1, **changes):
    numba.set_num_threads(min(threads, numba.config.NUMBA_NUM_THREADS))
    localiser = Localiser(made[0], LocalisationSettings(particles=8000, **changes), log.laser)
    return localiser, [localiser.process(log.odometry[n], log.driven[n], log.points(n)) for n in range(first, end)]


def off(pose, estimate):
    x, y, turn = between(pose, estimate.best.pose)
    return float(np.hypot(x, y)), float(abs(turn))


@pytest.mark.parametrize("start", [10, HALF, HALF + 25])
def test_a_robot_finds_itself_from_anywhere(made, log, start):
    _, estimates = followed(made, log, start, start + 35)
    assert estimates[0].particles > 500
    assert len(estimates[0].hypotheses) > 1
    assert not estimates[0].localised
    assert estimates[-1].localised
    assert estimates[-1].particles < 200
    for n, estimate in enumerate(estimates):
        metres, turn = off(made[1][start + n], estimate)
        assert not estimate.localised or (metres < 0.3 and turn < 0.1), n


def test_a_start_that_is_told_is_refined(made, log):
    told = tuple((made[1][40] + np.array([0.3, -0.2, 0.1])).tolist())
    _, estimates = followed(made, log, 40, 60, start=told)
    assert off(made[1][40], estimates[0])[0] < 0.3
    assert estimates[-1].localised
    assert off(made[1][59], estimates[-1])[0] < 0.1


def test_any_number_of_threads_gives_the_same_bits_and_the_seed_decides(made, log):
    one, _ = followed(made, log, HALF, HALF + 12)
    two, _ = followed(made, log, HALF, HALF + 12, threads=2)
    other, _ = followed(made, log, HALF, HALF + 12, seed=1)
    np.testing.assert_array_equal(one.poses, two.poses)
    np.testing.assert_array_equal(one.log_weights, two.log_weights)
    assert one.poses.shape != other.poses.shape or not np.array_equal(one.poses, other.poses)


def test_a_kidnapped_robot_doubts_and_finds_itself_again(made, log):
    localiser, estimates = followed(made, log, 20, 50)
    assert estimates[-1].localised
    shift = compose(log.odometry[49], between(log.odometry[110], np.zeros(3)))
    states = []
    for n in range(110, 170):
        odometry = compose(shift, log.odometry[n])
        driven = log.driven[n] - log.driven[110] + log.driven[49]
        estimate = localiser.process(odometry, driven, log.points(n))
        states.append((estimate.localised, off(made[1][n], estimate)[0] < 0.3))
    assert not all(localised for localised, _ in states)
    assert states[-1] == (True, True)
    assert all(right for localised, right in states[20:] if localised)


def test_in_the_map_of_another_building_nothing_is_believed(made):
    other = parse_carmen(carmen(drive("spine", Drive(seed=8)))[:141])
    _, estimates = followed(made, other, 0, 70)
    assert not any(one.localised for one in estimates)


def test_where_four_places_look_alike_all_are_kept():
    """A square room without anything in it."""
    occupancy = np.zeros((120, 120))
    occupancy[[0, 1, -2, -1]] = occupancy[:, [0, 1, -2, -1]] = 1.0
    known = known_map(occupancy, (-3.0, -3.0), 0.05)
    localiser = Localiser(known, LocalisationSettings(), np.zeros(3))
    way = np.zeros(2)
    angles = np.linspace(-2.3, 2.3, 180)
    for n in range(30):
        heading = 0.5 * n
        pose = np.array([1.5 * np.sin(heading), 1.0 - 1.5 * np.cos(heading), heading])
        estimate = localiser.process(pose, way, square(pose, angles))
        way = way + np.array([0.75, 0.5])
        assert not estimate.localised
    assert len(estimate.hypotheses) >= 2
    assert sum(one.weight for one in estimate.hypotheses) == pytest.approx(1.0, abs=0.2)


def square(pose, angles, half=2.9):
    """Points (180, 2) where beams meet the walls, seen from the robot."""
    c, s = np.cos(angles + pose[2]), np.sin(angles + pose[2])
    with np.errstate(divide="ignore"):
        reach = np.minimum((np.sign(c) * half - pose[0]) / c, (np.sign(s) * half - pose[1]) / s)
    return reach[:, None] * np.stack([np.cos(angles), np.sin(angles)], axis=-1)


@pytest.mark.parametrize("points", [np.zeros((0, 2)), np.array([[1.0, 0.0]])])
def test_scans_that_see_nothing_do_no_harm(made, points):
    localiser = Localiser(made[0], LocalisationSettings(particles=500), np.zeros(3))
    for n in range(8):
        estimate = localiser.process(np.array([0.5 * n, 0.0, 0.0]), np.array([0.5 * n, 0.0]), points)
        assert np.isfinite(estimate.best.pose).all()
        assert not estimate.localised


def test_a_log_is_followed_without_a_look_ahead(made, log):
    told: list[int] = []
    settings = LocalisationSettings(particles=8000)
    found = localise(log, made[0], settings, lambda done, of, estimate: told.append(done))
    assert told == list(range(1, len(log) + 1))
    assert found.first is not None
    assert found.believed[-1]
    right = np.hypot(*(found.poses - made[1])[found.believed, :2].T)
    assert np.median(right) < 0.05
    assert found.believed.mean() > 0.7


def test_maps_in_which_nobody_can_be(made):
    from tms_agents.slam.known import MapError

    assert isinstance(made[0], KnownMap)
    with pytest.raises(MapError, match="occupied"):
        known_map(np.zeros((20, 20)), (0.0, 0.0), 0.05)
    with pytest.raises(MapError, match="no free place"):
        known_map(np.where(np.eye(20) > 0, 1.0, np.nan), (0.0, 0.0), 0.05)
