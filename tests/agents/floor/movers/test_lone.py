"""One foot alone is no person, but nobody vanishes in plain sight."""

from __future__ import annotations

import numpy as np
import pytest

from tms_agents.floor.feet.brightness import expected
from tms_agents.floor.feet.prints import ALONE, UNLIKE, attend
from tms_agents.floor.movers.lone import count_lone
from tms_agents.floor.scan.background import FOREGROUND, UNKNOWN
from tms_agents.floor.state import BODY, PRINT, empty

NOW = 100.0
#: A sweep of beams along the x axis that sees nothing but walls 9 m off.
_BEAMS = 181
_POSE = np.array([-3.0, 0.0, 0.0])
_STEP = np.pi / (_BEAMS - 1)


def counted(other: dict[str, float] | None = None, *, open_m: float = 9.0, **fields: float) -> float:
    """For how long (s) somebody is one foot alone after one second more: the other one was seen 0.6 m off, 5 s ago.

    He came step by step; ``other`` is somebody else. The laser, 3 m off, sees ``open_m`` far.
    """
    bodies = empty(BODY, 2)
    values = {"used": 1, "confirmed": 1, "seen": NOW, "hits": 900, "both": 400, "own_stance_n": 20, "width": 0.1}
    values |= {"a_seen": NOW, "a_since": NOW - 9.0, "a_print": 0, "b_seen": NOW - 5.0, "b_print": -1, "by": 0.6}
    values |= {"a_land": NOW - 9.0, "b_land": NOW - 6.0, "first": NOW - 60.0}
    for name, value in (values | fields).items():
        bodies[name][0] = value
    for name, value in (other or {}).items():
        bodies[name][1] = value
    ranges = np.full(_BEAMS, open_m)
    states = np.full(_BEAMS, FOREGROUND if open_m < 3.0 else UNKNOWN, np.int8)
    count_lone(bodies, 0, NOW, 1.0, (ranges, states, ranges, _POSE, -np.pi / 2, _STEP))
    return float(bodies["lone"][0])


def test_who_was_in_sight_all_the_time_is_still_there() -> None:
    assert counted() == pytest.approx(0.1)
    assert counted(odd=UNLIKE) == pytest.approx(0.1)


@pytest.mark.parametrize(
    "fields",
    [
        {"a_since": NOW - 2.0},  # he was out of sight for three seconds
        {"by": 1.2},  # nobody leaves a foot so far behind
        {"own_stance_n": 0},  # he has hardly walked
        {"b_seen": -1e9},  # he was found to be nowhere before
    ],
)
def test_who_may_have_gone_is_not(fields: dict[str, float]) -> None:
    assert counted(**fields) == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("fields", "may_be_he"),
    [
        ({}, True),
        ({"first": NOW - 30.0}, False),  # was there before
        ({"x0": 2.0}, False),  # began elsewhere
        ({"robot": 1}, False),
    ],
)
def test_somebody_who_began_beside_him_since_may_be_he(fields: dict[str, float], may_be_he: bool) -> None:
    new = {"used": 1, "first": NOW - 4.0, "x0": 0.7, "x": 3.0}
    assert counted(new | fields) == pytest.approx(1.0 if may_be_he else 0.1)


@pytest.mark.parametrize(("both", "hidden"), [(400, True), (3, False)])
def test_of_whom_two_feet_were_hardly_ever_seen_none_is_hidden(both: int, hidden: bool) -> None:
    assert counted(open_m=1.0, both=both, own_stance_n=0) == pytest.approx(0.0 if hidden else 1.0)


@pytest.mark.parametrize(
    ("fields", "alone"),
    [
        ({"by": 1.2}, True),
        ({}, False),  # he may stand on both, side by side
        ({"by": 1.2, "shoe": 0.0}, False),  # legs are wide for a while when one hides the other
        ({"by": 1.2, "own_stance_n": 0}, False),  # nobody who walked: a robot, maybe
    ],
)
def test_what_is_wide_is_no_pair_of_shoes_if_the_other_one_was_a_step_away(
    fields: dict[str, float], alone: bool
) -> None:
    assert (counted(**{"width": 0.26, "shoe": 1.0} | fields) > 0.0) == alone


def test_what_could_not_hide_the_other_foot_is_alone_though_he_was_in_sight() -> None:
    assert counted(odd=ALONE) == pytest.approx(2.5)


def test_one_print_taken_for_either_foot_in_turn_is_not_two_parts_of_a_thing() -> None:
    stands = {"by": 0.02, "b_seen": NOW - 0.2, "b_since": NOW - 9.0, "b_land": NOW - 9.0}
    assert counted(b_print=1, **stands) > 0.0
    assert counted(b_print=0, **stands) == 0.0


@pytest.mark.parametrize(("apart", "shoe", "thing"), [(0.02, 1.0, True), (0.06, 1.0, False), (0.02, 0.0, False)])
def test_both_shoes_at_one_place_are_a_thing(apart: float, shoe: float, thing: bool) -> None:
    stands = {"by": apart, "b_seen": NOW - 0.2, "b_since": NOW - 9.0, "b_land": NOW - 9.0, "b_print": 0}
    assert counted(shoe=shoe, **stands) == pytest.approx(1.0 if thing else 0.0)


@pytest.mark.parametrize(("idle", "older"), [(1.5, 0.0), (20.0, 20.0)])
def test_what_was_nobodys_for_a_moment_had_not_stood_there_before(idle: float, older: float) -> None:
    bodies, prints = empty(BODY, 1), empty(PRINT, 1)
    bodies["used"] = bodies["confirmed"] = 1
    bodies["seen"] = bodies["a_seen"] = prints["last"] = NOW
    bodies["b_seen"], bodies["b_print"] = NOW - 3.0, -1
    prints["used"], prints["first"], prints["rested"], prints["idle"] = 1, NOW - 60.0, NOW - 60.0, idle
    attend(prints, bodies, NOW, 0.1, expected(), np.zeros(2))
    assert bodies["older"][0] == older
