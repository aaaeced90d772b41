"""A path that tore where the filter came back is whole again once only the newest scans are its map."""

from __future__ import annotations

import numpy as np
import pytest

from tms_agents.slam import Settings
from tms_agents.slam.backend import close_loops
from tms_agents.slam.geometry import between, compose, wrapped
from tms_agents.slam.keyframes import KeyScans
from tms_agents.slam.light.scans import calibrated, light_scans
from tms_agents.slam.recent import recent_path


@pytest.fixture(scope="module")
def keys(log):
    return KeyScans(log.odometry, log.driven, [log.points(n) for n in range(len(log))], log.laser[:2])


def led(first, steps):
    path = [first]
    for step in steps:
        path.append(compose(path[-1], step))
    return np.array(path)


def jumped(truth):
    """Two metres too far at once, as a particle jumps onto an older part of its map."""
    steps = between(truth[:-1], truth[1:])
    steps[150] += [2.0, 0.0, 0.0]
    return led(truth[0], steps)


def stood(truth):
    """For ten scans it stands, as if the wheels slipped."""
    steps = between(truth[:-1], truth[1:])
    steps[150:160] = 0.0
    return led(truth[0], steps)


@pytest.mark.parametrize("torn", [jumped, stood])
def test_steps_are_right_again(driven, keys, torn):
    truth = driven.truth
    found = recent_path(torn(truth), keys, Settings())
    np.testing.assert_array_equal(found[0], truth[0])
    error = between(found[:-1], found[1:]) - between(truth[:-1], truth[1:])
    assert np.hypot(error[:, 0], error[:, 1]).max() < 0.12
    assert np.abs(wrapped(error[:, 2])).max() < 0.03


def test_loops_close_over_a_torn_path(driven, keys):
    path = stood(driven.truth)
    error = between(path[:150], path[-1]) - between(driven.truth[:150], driven.truth[-1])
    assert np.hypot(error[:, 0], error[:, 1]).min() > 3.0
    closed = close_loops(path, keys, Settings())
    off = between(closed.path[:150], closed.path[-1]) - between(driven.truth[:150], driven.truth[-1])
    assert np.hypot(off[:, 0], off[:, 1]).max() < 0.25
    assert closed.moved == pytest.approx(np.hypot(*(closed.path - path)[:, :2].T).max())


def test_along_a_flat_corridor_colours_take_a_jump_back(coloured):
    recording, log = coloured
    numbers = np.arange(0, len(log), 4)
    truth = recording.truth[numbers]
    steps = between(truth[:-1], truth[1:])
    steps[40] += [0.9, 0.0, 0.0]
    keys = KeyScans(log.odometry[numbers], log.driven[numbers], [log.points(int(n)) for n in numbers], log.laser[:2])
    path = led(truth[0], steps)
    found = recent_path(path, keys, Settings(), light_scans(log, numbers, calibrated(log)))
    error = between(found[35:40], found[45]) - between(truth[35:40], truth[45])
    assert np.hypot(error[:, 0], error[:, 1]).max() < 0.12
