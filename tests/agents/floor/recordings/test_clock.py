"""Times of scans: tied to the laser's own clock, always rising, right to a few milliseconds."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from floor_rig import Room, sweep
from hypothesis import example, given
from hypothesis import strategies as st

from tms_agents.clocks import Clocks
from tms_agents.devices.scans import Scan
from tms_agents.floor.recordings.clock import ScanTimes, turn_s

SWEEP = sweep()
RANGES = np.full(len(SWEEP.angles), 2.0)


def scan(device_time_s=None):
    return Scan(SWEEP, RANGES, None, device_time_s)


@given(
    delays=st.lists(st.floats(0.0, 0.5), min_size=30, max_size=60),
    drift=st.floats(-1e-4, 1e-4),
    start=st.floats(0, 1e5),
)
def test_the_lasers_clock_takes_the_shortest_way(delays, drift, start):
    """Whatever the line and the computer delay: as soon as one scan came quickly, times are right."""
    times, quick, turn = ScanTimes(), None, turn_s(SWEEP)
    for n, delay in enumerate(delays):
        made = 1000 + 0.1 * n
        quick = n if quick is None and delay < 0.01 else quick
        device = start + 0.1 * n * (1 + drift)
        (t,) = times.of(made + turn + delay, [scan(device)])
        if quick is not None and n > quick + 6:  # times that were told too late are caught up with, they never go back
            assert t == pytest.approx(made, abs=0.013)


@given(st.lists(st.tuples(st.floats(0, 100), st.one_of(st.none(), st.floats(0, 1e6))), max_size=50))
def test_times_always_rise(scans):
    times, last, arrival = ScanTimes(5.0), 5.0, 0.0
    for wait, device in scans:
        arrival += wait
        for t in times.of(arrival, [scan(device), scan(device)]):
            assert t > last
            last = t


def test_without_a_clock_scans_that_waited_together_are_spread():
    found = ScanTimes().of(100.0, [scan(), scan(), scan()])
    np.testing.assert_allclose(np.diff(found), SWEEP.period_s)
    assert found[-1] == pytest.approx(100.0 - turn_s(SWEEP))


def test_a_laser_that_was_switched_off_and_on_begins_anew():
    times = ScanTimes()
    for n in range(20):
        times.of(100 + 0.1 * n, [scan(5000 + 0.1 * n)])
    (t,) = times.of(110.0, [scan(0.1)])
    assert t == pytest.approx(110.0 - turn_s(SWEEP))


def test_a_clock_that_is_set_does_not_disturb_the_past():
    """What happened is told in step with what was told before, also while the computer's clock was set back."""
    unix, even = [1000.0], [0.0]
    clocks = Clocks(lambda: unix[0], lambda: even[0])
    before = clocks.now()
    assert clocks.in_step(before).timestamp() == 1000.0
    assert clocks.in_step(before - 5.0).timestamp() == 995.0
    unix[0] -= 50.0
    even[0] += 2.0
    for t, told in ((-5.0, 995.0), (0.0, 1000.0), (1.0, 1000.0), (2.0, 1000.0)):
        assert clocks.in_step(before + t).timestamp() == pytest.approx(told)
    assert clocks.ahead_s == pytest.approx(50.0)
    unix[0] += 60.0
    even[0] += 60.0
    assert clocks.in_step(before + 61.0).timestamp() == pytest.approx(unix[0] - 1.0)


@given(st.lists(st.tuples(st.floats(0, 10), st.floats(-1e4, 0)), min_size=1, max_size=20))
@example([(0.0, -0.1), (1.0, -1.0)])  # less than has gone by since it was looked at
def test_what_happened_later_is_not_told_for_earlier(steps):
    """However often the clock is set back: the order of what happened is that of the times told, also of late news."""
    unix, even, told = 1.7e9, 100.0, []
    clocks = Clocks(lambda: unix, lambda: even)
    for elapsed, jump in steps:
        unix, even = unix + elapsed + jump, even + elapsed
        told += [(t, clocks.in_step(t)) for t in (clocks.now() - 3.0, clocks.now() - 0.1, clocks.now())]
    by_time = [at for _, at in sorted(told)]
    assert all(b.timestamp() - a.timestamp() > -0.025 for a, b in itertools.pairwise(by_time))


def test_a_clock_that_was_set_back_between_two_runs_is_said_once(caplog):
    clocks = Clocks.resumed({"t": 500.0, "told": 5000.0}, lambda: 1400.0, lambda: 0.0)
    assert clocks.now() == 1400.0
    assert [clocks.in_step(t).timestamp() for t in (1300.0, 1400.0)] == [4900.0, 5000.0]
    assert clocks.told == 5000.0 and clocks.ahead_s == 3600.0
    assert [one.getMessage().partition(":")[0] for one in caplog.records] == [
        "the clock of this computer is 3600 s behind what was told already"
    ]
    for nothing in ({}, {"t": None, "told": "late"}, {"t": float("nan")}):
        assert Clocks.resumed(nothing, lambda: 1400.0, lambda: 0.0).told == 1400.0


def test_the_room_of_the_tests_is_what_it_says():
    room = Room(noise_m=0.0)
    room.put("thing", 2.5, 2.05, 0.05)
    ranges = room.ranges(SWEEP, (2.5, 0.05, np.pi / 2))
    assert ranges[180] == pytest.approx(1.95, abs=2e-3) and ranges[0] == pytest.approx(2.5, abs=2e-3)
