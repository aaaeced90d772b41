"""People in the way are told from things that stay, come back, or are thin; on drives with people and without."""

from __future__ import annotations

import numba
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tms_agents.simulation.building import Drive, carmen, drive
from tms_agents.slam import Log, Settings, build_map
from tms_agents.slam.geometry import transform
from tms_agents.slam.logs_carmen import parse_carmen
from tms_agents.slam.motion import OdometryNoise
from tms_agents.slam.witnesses import people_by_odometry, people_by_path

ANGLES = np.linspace(-np.pi / 2, np.pi / 2, 181)


@pytest.fixture(scope="module")
def crowd():
    return drive("block", Drive(seed=1, step_m=0.5, step_rad=0.3, people=5.0, legs=False))


def watched(nearer: dict[int, float], of: int, period_s: float = 1.0, beams: slice = slice(85, 97)) -> Log:
    """``of`` scans of a robot that stands in a room of 5 m; in some, ``beams`` end nearer."""
    ranges = np.full((of, 181), 5.0)
    for n, r in nearer.items():
        ranges[n, beams] = r
    still = np.zeros((of, 3))
    return Log(period_s * np.arange(of), still, still[:, :2], ranges, ANGLES, 80.0, np.zeros(3))


def found_in(log: Log, n: int) -> np.ndarray:
    key = np.array([n])
    return people_by_path(log, key, [log.points(n)], np.zeros((1, 3)))[0]


def everywhere(log: Log, path: np.ndarray) -> list[np.ndarray]:
    keys = np.arange(len(log))
    return people_by_path(log, keys, [log.points(n) for n in keys], path)


def test_who_walks_by_is_a_person_and_the_room_is_none():
    assert np.flatnonzero(found_in(watched({4: 2.0}, 9), 4)).tolist() == list(range(85, 97))
    assert not found_in(watched({4: 2.0}, 9), 3).any()


@pytest.mark.parametrize("stood", [range(4, 10), range(0, 6), range(9, 15)])
def test_who_stands_for_a_while_is_one_all_the_time(stood):
    log = watched(dict.fromkeys(stood, 2.0), 15)
    assert all(found_in(log, n)[85:97].all() for n in stood)


def test_what_stays_is_none():
    assert not found_in(watched(dict.fromkeys(range(15), 2.0), 15), 7).any()


def test_what_was_moved_while_nobody_looked_is_none():
    log = watched(dict.fromkeys(range(8, 16), 2.0), 16)
    away = np.where(np.arange(16) < 8, 0.0, 600.0)
    parked = Log(log.t + away, log.odometry, log.driven, log.ranges, log.angles, log.range_max, log.laser)
    assert not any(found_in(parked, n).any() for n in range(16))


def test_a_thin_thing_that_some_beams_miss_is_none():
    log = watched(dict.fromkeys(range(0, 15, 2), 2.0), 15, beams=slice(90, 91))
    assert not found_in(log, 6).any()


def test_what_is_as_long_as_a_door_is_none():
    assert not found_in(watched({4: 2.0}, 9, beams=slice(70, 110)), 4).any()


def test_nothing_behind_is_not_known_to_be_free():
    log = watched({4: 2.0}, 9)
    log.ranges[:4, 80:100] = log.ranges[5:, 80:100] = 0.0
    assert not found_in(log, 4).any()


def test_one_scan_alone_says_nothing():
    assert not found_in(watched({0: 2.0}, 1), 0).any()


def test_lasers_that_count_the_other_way_round():
    log = watched({4: 2.0}, 9, beams=slice(20, 32))
    other = Log(log.t, log.odometry, log.driven, log.ranges[:, ::-1], ANGLES[::-1], 80.0, log.laser)
    np.testing.assert_array_equal(found_in(other, 4)[::-1], found_in(log, 4))


@settings(max_examples=4)
@given(seed=st.integers(100, 10_000))
def test_in_a_building_without_people_hardly_a_beam_is_one(seed):
    driven = drive("block", Drive(seed=seed, step_m=0.6))
    log = parse_carmen(carmen(driven))
    found = np.concatenate(everywhere(log, driven.truth))
    assert np.mean(found) < 0.004


def test_a_crowd_is_found_and_walls_are_not(crowd):
    log = parse_carmen(carmen(crowd))
    keys = np.arange(len(log))
    truth = np.concatenate([crowd.people[n][log.returned(n)] for n in keys])
    assert truth.mean() > 0.1
    scans = [log.points(n) for n in keys]
    for masks, recall in (
        (people_by_path(log, keys, scans, crowd.truth), 0.9),
        (people_by_odometry(log, keys, scans, OdometryNoise()), 0.5),
    ):
        found = np.concatenate(masks)
        assert np.mean(found[truth]) > recall
        assert np.mean(found[~truth]) < 0.002


def test_any_number_of_threads_finds_the_same(crowd):
    log = parse_carmen(carmen(crowd))
    one = np.concatenate(everywhere(log, crowd.odometry))
    numba.set_num_threads(min(2, numba.config.NUMBA_NUM_THREADS))
    np.testing.assert_array_equal(np.concatenate(everywhere(log, crowd.odometry)), one)


def test_the_map_of_a_crowded_building_is_that_of_an_empty_one(crowd):
    log = parse_carmen(carmen(crowd))
    left = {}
    for people in (True, False):
        result = build_map(log, Settings(particles=8, seed=1, people=people))
        left[people] = _occupied_by_people(crowd, log, result)
    assert left[True] < 0.1 * left[False]


def _occupied_by_people(crowd, log, result) -> int:
    """Cells that the map shows as occupied where a person was met."""
    cells = set()
    probabilities = result.grid.probabilities()
    for n in range(len(log)):
        met = crowd.people[n][log.returned(n)]
        places = transform(result.poses[n], log.points(n)[met])
        x, y = np.floor((places - result.grid.origin) / result.grid.resolution).astype(int).T
        inside = (x >= 0) & (y >= 0) & (x < probabilities.shape[1]) & (y < probabilities.shape[0])
        cells.update((b, a) for a, b in zip(x[inside], y[inside], strict=True) if probabilities[b, a] > 0.65)
    return len(cells)
