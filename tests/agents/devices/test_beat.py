"""The uneven beat: one moment in every period, and no shaking near its rate that passes for a slow swing."""

import math
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tms_agents.devices.beat import BEAT_S, moment, next_moment, on_the_beat

numbers = st.integers(0, 10**12)


@given(numbers, st.sampled_from([0.005, 0.02, 0.05, 1.0]))
def test_each_period_has_one_moment(number, period_s):
    assert number * period_s <= moment(number, period_s) < (number + 1) * period_s


@given(st.integers(0, 10**9), st.sampled_from([0.005, 0.02, 0.05, 1.0]))
def test_the_moments_follow_one_another(number, period_s):
    first = moment(number, period_s)
    assert math.isclose(next_moment(first, period_s), moment(number + 1, period_s))
    between = (first + moment(number + 1, period_s)) / 2
    assert math.isclose(next_moment(between, period_s), moment(number + 1, period_s))


def test_a_timer_that_rings_a_little_early_is_on_the_beat():
    assert math.isclose(next_moment(moment(50) - 1e-6), moment(51))


@given(st.floats(0, 1e6), st.floats(BEAT_S, 10))
def test_long_waits_end_on_the_beat_and_short_ones_do_not(now, wait_s):
    rung = on_the_beat(now, wait_s)
    assert now - 1e-4 < rung < now + 2 * BEAT_S
    assert any(math.isclose(rung, moment(math.floor(rung / BEAT_S) + d), rel_tol=1e-12) for d in (-1, 0, 1))
    assert on_the_beat(now, 0.019) == now


@pytest.mark.parametrize("number", range(1, 400, 7))
def test_a_moment_on_the_beat_is_not_put_off(number):
    assert math.isclose(on_the_beat(moment(number), 0.1), moment(number))


@pytest.mark.parametrize("hz", [49.7, 49.95, 50.0, 50.1, 99.9, 100.0, 150.2])
def test_shaking_near_the_rate_averages_out(hz):
    def means_of_seconds(t):
        return np.sin(2 * np.pi * hz * t + 1.0).reshape(-1, 50).mean(axis=1)

    numbers = range(100_000)
    uneven = means_of_seconds(np.array([moment(number) for number in numbers]))
    assert np.sqrt(np.mean(uneven**2)) < 0.03
    assert np.abs(means_of_seconds(BEAT_S * np.array(numbers))).max() > 0.8


def test_gaps_leave_time_for_an_answer():
    gaps = [later - earlier for earlier, later in pairwise(moment(number) for number in range(5000))]
    assert min(gaps) >= BEAT_S / 4 - 1e-9
    assert sum(gaps) / len(gaps) == pytest.approx(BEAT_S, rel=1e-3)
