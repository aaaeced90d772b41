"""Who was near a thing since it was seen last."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from tms_agents.floor.objects.visitors import Visitors
from tms_agents.floor.state import BODY, THING, empty

#: In each scan: is the thing seen, and how far (m) is each of three movers, or is he not there?
SCANS = st.lists(
    st.tuples(st.booleans(), st.lists(st.none() | st.floats(0.0, 3.0), min_size=3, max_size=3)), min_size=1, max_size=12
)


def _room(away: list[float | None]) -> tuple[np.ndarray, np.ndarray]:
    things, bodies = empty(THING, 4), empty(BODY, 8)
    things["used"][2], things["label"][2], things["x"][2] = 1, 77, 5.0
    for k, gap in enumerate(away):
        if gap is not None:
            bodies["used"][k], bodies["confirmed"][k], bodies["label"][k] = 1, 1, 30 - k
            bodies["x"][k] = 5.0 + gap
    return things, bodies


@settings(max_examples=100)
@given(scans=SCANS)
def test_the_nearest_of_everybody_since_the_thing_was_seen(scans: list[tuple[bool, list[float | None]]]) -> None:
    visitors = Visitors(4)
    expected: dict[int, float] = {}
    for t, (seen, away) in enumerate(scans):
        things, bodies = _room(away)
        things["seen"][2] = t if seen else -1.0
        visitors.attend(things, bodies, float(t))
        expected = {} if seen else expected
        for k, gap in enumerate(away):
            if gap is not None and abs(bodies["x"][k] - 5.0) < 1.6:
                expected[30 - k] = min(expected.get(30 - k, np.inf), abs(float(bodies["x"][k]) - 5.0))
    assert visitors.of(2) == expected
    assert list(visitors.of(2)) == sorted(expected)
    again = Visitors(4)
    again.restore(things, visitors.save(things))
    assert again.of(2) == expected


def test_nobody_near_is_forgotten_for_somebody_farther() -> None:
    visitors = Visitors(4)
    things, bodies = _room([])
    things["seen"] = -1.0
    bodies["used"][0], bodies["confirmed"][0] = 1, 1
    for label in range(1, 101):
        bodies["label"][0], bodies["x"][0] = label, 5.0 + 0.01 * label
        visitors.attend(things, bodies, 1.0)
    for label in range(101, 104):
        bodies["label"][0], bodies["x"][0] = label, 5.0
        visitors.attend(things, bodies, 1.0)
    assert set(visitors.of(2)) == {*range(1, 30), 101, 102, 103}


def test_another_thing_in_the_same_place_has_had_no_visitors() -> None:
    visitors = Visitors(4)
    things, bodies = _room([0.5])
    visitors.attend(things, bodies, 1.0)
    assert visitors.of(2) != {}
    visitors.forget(2)
    assert visitors.of(2) == {}
