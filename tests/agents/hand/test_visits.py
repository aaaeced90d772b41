"""Visits: laws on arbitrary reports."""

from __future__ import annotations

import itertools
from datetime import UTC, datetime, timedelta

from hypothesis import given
from hypothesis import strategies as st

from tms_agents.hand.visits import Visits

ZERO = datetime(2026, 1, 1, tzinfo=UTC)


def at(seconds: float) -> datetime:
    return ZERO + timedelta(seconds=seconds)


def begins(gap_s: float, *reports: tuple[float, float]) -> list[bool]:
    visits = Visits(gap_s)
    return [visits.see("z", "T", at(first), at(last)) for first, last in reports]


def test_a_tag_in_view_is_one_visit():
    assert begins(2, (0, 0), (1.9, 1.9), (3.8, 3.8), (5.9, 5.9)) == [True, False, False, True]


def test_the_gap_counts_from_the_last_sight_of_a_long_report():
    assert begins(2, (0, 60), (61, 120), (180, 240)) == [True, False, True]


def test_growing_reports_of_one_visit():
    """A reader that accumulates: first seen stays, last seen grows."""
    assert begins(2, (0, 5), (0, 10), (0, 60), (61, 61)) == [True, False, False, False]


def test_a_clock_set_back_begins_a_new_visit():
    assert begins(2, (3600, 3600), (0, 0), (1, 1)) == [True, True, False]


def test_zones_and_tags_are_apart():
    visits = Visits(2)
    assert [visits.see(zone, tag, at(0), at(0)) for zone in "ab" for tag in "XY"] == [True] * 4


@given(st.lists(st.floats(0, 1000), min_size=1, max_size=50), st.floats(0.1, 50))
def test_number_of_visits_is_the_number_of_long_gaps(times, gap):
    times.sort()
    moments = [at(time) for time in times]
    long = sum(b - a > timedelta(seconds=gap) for a, b in itertools.pairwise(moments))
    assert sum(begins(gap, *((time, time) for time in times))) == 1 + long


def test_memory_is_bounded():
    visits = Visits(1)
    for n in range(30_000):
        visits.see("z", f"T{n}", at(n), at(n))
    assert len(visits) <= 10_001
