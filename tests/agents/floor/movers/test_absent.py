"""Who is lost in the middle of a room is somewhere in it."""

from __future__ import annotations

import json

import numpy as np
import pytest

from tms_agents.floor.events import Vanished
from tms_agents.floor.feet.brightness import expected
from tms_agents.floor.movers.absent import Absent
from tms_agents.floor.scan.masks import Area
from tms_agents.floor.state import BODY, CONCEALED, PRINT, SEATED, empty

ROOM = [(0.0, -2.0), (9.0, -2.0), (9.0, 6.0), (0.0, 6.0)]
DOOR = [(-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5)]


def person(x: float, y: float, *, label: int = 1, seen: float = 10.0, first: float = 0.0, own: float = 7.0):
    (body,) = empty(BODY, 1)
    body["used"] = body["confirmed"] = 1
    body["label"], body["x"], body["y"], body["x0"], body["y0"] = label, x, y, x, y
    body["seen"], body["first"], body["hits"] = seen, first, 100
    body["own"], body["own_n"], body["look"], body["look_n"] = own, 200, own, 50
    return body


def print_at(x: float, rested: float):
    """As wide as a leg, a part of which is hidden now and then."""
    (print_,) = empty(PRINT, 1)
    print_["x"], print_["y"], print_["rested"], print_["width"] = x, 4.0, rested, 0.1
    print_["hits"], print_["whole"] = 30, 20
    return print_


@pytest.fixture
def absent() -> Absent:
    return Absent(Area([DOOR]), Area([ROOM]))


def test_who_turns_up_again_has_his_name(absent: Absent) -> None:
    assert absent.keep(person(4.0, 4.0, label=3))
    assert absent.find(person(5.0, 4.0, first=12.0), expected())["label"] == 3
    assert absent.find(person(5.0, 4.0, first=12.0), expected()) is None


def test_who_is_lost_at_the_door_has_left(absent: Absent) -> None:
    assert not absent.keep(person(0.7, 0.0))


def test_who_is_lost_beyond_reach_on_this_side_of_the_door_has_not_gone(absent: Absent) -> None:
    assert absent.keep(person(1.2, 0.0, label=3))
    assert absent.find(person(3.0, 0.0, first=13.0), expected())["label"] == 3


def test_who_comes_in_at_the_door_is_somebody_new(absent: Absent) -> None:
    absent.keep(person(2.0, 0.0))
    assert absent.find(person(0.8, 0.0, first=12.0), expected()) is None


@pytest.mark.parametrize(
    ("inside_m", "turned", "own", "same"),
    [
        (0.4, 12.0, 7.0, True),
        (0.4, 17.0, 7.0, False),
        (0.4, 12.0, 5.0, False),
        (0.1, 12.0, 7.0, False),
        (-0.3, 12.0, 7.0, False),
    ],
    ids=["at once", "later", "another", "from the threshold", "from outside"],
)
def test_who_turns_round_in_the_door_keeps_his_name(
    absent: Absent, inside_m: float, turned: float, own: float, same: bool
) -> None:
    one = person(-0.4, 0.0, label=3)
    one["ax"], one["ay"], one["a_seen"], one["b_seen"] = inside_m, 0.0, 10.0, 9.0
    assert (absent.turns(one) is not None) == (inside_m > 0.25)
    found = absent.find(person(0.6, 0.2, first=turned, own=own), expected())
    assert (found is not None and found["label"] == 3) == same


def test_without_doors_people_may_leave_anywhere() -> None:
    open_plan = Absent(Area([]), Area([ROOM]))
    assert not open_plan.keep(person(4.0, 4.0))
    assert not open_plan.turns(person(4.0, 4.0))


@pytest.fixture
def untold() -> Absent:
    """Nothing is told: sight ends at x = 0, where somebody has come, and at x = 8."""
    found = Absent(Area([]), Area([]))
    found.doors.see(np.array([[0.0, -3.0, 0.0, 6.0], [8.0, -3.0, 8.0, 6.0]]))
    found.came(person(0.2, 4.0), alone=True)
    return found


def lost_at(x: float, *, label: int = 3):
    body = person(x, 4.0, label=label)
    body["ax"], body["ay"], body["a_seen"] = x, 4.0, 10.0
    return body


@pytest.mark.parametrize("x", [4.0, 7.8], ids=["in plain sight", "behind something"])
def test_without_doors_who_is_lost_far_from_where_people_come_is_waited_for(untold: Absent, x: float) -> None:
    assert untold.keep(lost_at(x))
    assert untold.find(person(0.3, 4.0, first=40.0), expected()) is None
    assert untold.find(person(x - 0.5, 4.0, first=40.0), expected())["label"] == 3


@pytest.mark.parametrize(("first", "same"), [(12.0, True), (14.0, False)])
def test_without_doors_who_is_lost_where_people_come_may_turn_round_at_once(
    untold: Absent, first: float, same: bool
) -> None:
    assert untold.keep(lost_at(0.3))
    assert untold.find(person(0.3, 4.0, first=first), expected()) is None
    assert (untold.find(person(2.0, 4.0, first=first), expected()) is not None) == same


def test_without_doors_who_goes_where_people_come_has_left_seconds_later(untold: Absent) -> None:
    untold.keep(lost_at(0.3, label=4))
    untold.keep(lost_at(4.0, label=5))
    assert untold.gone(15.0) == [Vanished(15.0, 4, 10.0, 15.0)]
    assert untold.gone(71.0) == [Vanished(71.0, 5, 10.0, 71.0)]


def test_who_was_waited_for_in_vain_may_be_who_comes_in_the_middle_of_the_room(untold: Absent) -> None:
    untold.keep(lost_at(4.0))
    untold.gone(71.0)
    untold.came(person(5.0, 4.0), alone=True)
    assert untold.keep(lost_at(5.0))
    again = Absent(Area([]), Area([]))
    again.restore(json.loads(json.dumps(untold.save())))
    again.came(person(2.0, 4.0), alone=True)
    assert again.inside(person(2.0, 4.0))


def test_a_glimpse_is_nobody(absent: Absent) -> None:
    glimpse = person(4.0, 4.0)
    glimpse["hits"] = 10
    assert not absent.keep(glimpse)


def test_who_is_too_far_away_or_looks_otherwise_is_somebody_else(absent: Absent) -> None:
    absent.keep(person(4.0, 4.0))
    assert absent.find(person(9.0, 4.0, first=11.0), expected()) is None
    assert absent.find(person(4.5, 4.0, first=11.0, own=6.0), expected()) is None
    assert absent.find(person(4.5, 4.0, first=11.0), expected()) is not None


@pytest.mark.parametrize(
    ("fields", "same"),
    [
        ({}, True),
        ({"first": 17.0}, False),  # by then he sits
        ({"x0": 0.8, "y0": 0.0}, False),  # at the door
        ({"own": 6.0, "look": 6.0}, False),
        ({"wide": 0.5}, False),
    ],
)
def test_who_only_passed_the_bed_out_of_sight_keeps_his_name(
    absent: Absent, fields: dict[str, float], same: bool
) -> None:
    bodies = empty(BODY, 3)
    bodies[1], bodies[2] = person(4.0, 4.0, label=3), person(5.0, 4.0, label=4)
    bodies["stale"] = 0, SEATED, CONCEALED
    new = person(6.0, 4.0, first=13.0)
    for name, value in fields.items():
        new[name] = value
    assert absent.rises(bodies, new, expected()) == (1 if same else None)


def test_without_doors_who_sits_stays_where_he_is() -> None:
    bodies = empty(BODY, 1)
    bodies[0] = person(4.0, 4.0)
    bodies["stale"] = SEATED
    assert Absent(Area([]), Area([ROOM])).rises(bodies, person(5.0, 4.0, first=12.0), expected()) is None


@pytest.mark.parametrize(
    ("fields", "same"),
    [
        ({}, True),
        ({"robot": 1}, False),
        ({"stale": SEATED, "seen": 3.0}, False),
        ({"stale": 0}, False),
        ({"x": 0.5}, False),
        ({"own": 5.0}, False),
    ],
    ids=["hidden", "a robot", "sat down long ago", "seen", "too far", "another"],
)
def test_who_begins_in_the_middle_of_the_room_is_who_was_hidden(
    absent: Absent, fields: dict[str, float], same: bool
) -> None:
    bodies = empty(BODY, 3)
    bodies[1] = person(3.0, 4.0)
    bodies["stale"] = CONCEALED
    for name, value in fields.items():
        bodies[name][1] = value
    assert absent.comes_out(bodies, person(7.0, 4.0, first=14.0), expected()) == (1 if same else None)


def test_who_comes_in_by_the_door_is_nobody_who_is_hidden(absent: Absent) -> None:
    bodies = empty(BODY, 1)
    bodies[0] = person(2.0, 0.0)
    bodies["stale"] = CONCEALED
    assert absent.comes_out(bodies, person(0.8, 0.0, first=14.0), expected()) is None


def test_of_two_the_one_who_looks_like_it(absent: Absent) -> None:
    absent.keep(person(4.0, 4.0, label=1, own=7.3))
    absent.keep(person(4.2, 4.0, label=2, own=7.1))
    assert absent.find(person(4.0, 4.0, first=11.0, own=7.1), expected())["label"] == 2


def test_who_does_not_turn_up_has_left(absent: Absent) -> None:
    absent.keep(person(4.0, 4.0, label=5))
    assert absent.gone(65.0) == []
    assert absent.gone(71.0) == [Vanished(71.0, 5, 10.0, 71.0)]
    assert absent.gone(72.0) == []


@pytest.mark.parametrize(("seen", "label"), [(10.0, 2), (45.0, 1)])
def test_who_was_lost_of_late_turns_up_rather_than_who_was_lost_before(absent: Absent, seen: float, label: int) -> None:
    absent.keep(person(4.2, 4.0, label=1, seen=seen))
    absent.keep(person(5.0, 4.0, label=2, seen=45.0))
    assert absent.find(person(4.0, 4.0, first=47.0), expected())["label"] == label


def test_who_is_waited_for_is_so_after_a_restart(absent: Absent) -> None:
    absent.keep(person(4.0, 4.0, label=5))
    absent.keep(person(7.0, 4.0, label=6))
    turning = person(0.0, 0.0, label=7)
    turning["ax"], turning["a_seen"], turning["b_seen"] = 0.4, 10.0, 9.0
    absent.turns(turning)
    again = Absent(Area([DOOR]), Area([ROOM]))
    again.restore(json.loads(json.dumps(absent.save())))
    assert again.gone(19.0) == [Vanished(19.0, 7, 10.0, 19.0)]
    assert again.find(person(4.5, 4.0, first=12.0), expected())["label"] == 5
    assert again.gone(71.0) == [Vanished(71.0, 6, 10.0, 71.0)]


def test_nobody_is_saved_too(absent: Absent) -> None:
    absent.restore(absent.save())
    assert absent.gone(1e6) == []


@pytest.mark.parametrize(
    ("away", "since", "stands"),
    [(0.5, 12.0, True), (0.5, 2.0, False), (3.0, 12.0, False)],
)
def test_what_came_where_somebody_was_lost_may_be_his_foot(
    absent: Absent, away: float, since: float, stands: bool
) -> None:
    absent.keep(person(4.0, 4.0))
    print_ = print_at(4.0 + away, since)
    assert (absent.standing(print_, empty(BODY, 1)) is not None) == stands


@pytest.mark.parametrize(
    ("width", "whole", "stands"),
    [(0.1, 20, True), (0.1, 30, False), (0.2, 30, True), (0.05, 20, False), (0.05, 5, True)],
    ids=["hidden now and then", "never hidden", "a shoe", "too thin", "a part"],
)
def test_what_is_in_full_view_or_thin_is_no_foot_of_who_was_lost(
    absent: Absent, width: float, whole: int, stands: bool
) -> None:
    absent.keep(person(4.0, 4.0))
    print_ = print_at(4.5, 12.0)
    print_["width"], print_["whole"] = width, whole
    assert (absent.standing(print_, empty(BODY, 1)) is not None) == stands


@pytest.mark.parametrize(("whose", "both_seen", "may_stand"), [(5, True, False), (6, True, True), (5, False, True)])
def test_what_somebody_else_stood_on_and_has_left_is_no_foot_of_who_was_lost(
    absent: Absent, whose: int, both_seen: bool, may_stand: bool
) -> None:
    absent.keep(person(4.0, 4.0))
    bodies, print_ = empty(BODY, 1), print_at(4.2, 12.0)
    bodies[0] = person(5.5, 4.0, label=5, seen=14.0)
    bodies["a_seen"], bodies["b_seen"] = 14.0, 14.0 if both_seen else 12.0
    print_["whose"] = whose
    assert (absent.standing(print_, bodies) is not None) == may_stand


@pytest.mark.parametrize(
    ("x", "rested", "width", "other", "label"),
    [
        (4.4, 30.0, 0.1, {}, 1),
        (4.6, 30.0, 0.1, {}, 2),
        (4.4, 3.0, 0.1, {}, None),
        (9.0, 30.0, 0.1, {}, None),
        (4.4, 30.0, 0.01, {}, None),
        (4.4, 30.0, 0.1, {"x": 4.8}, None),
        (4.4, 30.0, 0.1, {"x": 4.8, "stale": CONCEALED}, 1),
        (4.4, 30.0, 0.1, {"x": 4.8, "confirmed": 0}, 1),
    ],
    ids=["the nearer", "the other", "before", "far away", "an edge", "beside one", "who is hidden", "not believed"],
)
def test_who_stands_on_what_is_left(
    absent: Absent, x: float, rested: float, width: float, other: dict[str, float], label: int | None
) -> None:
    """However long ago he was lost."""
    absent.keep(person(4.0, 4.0, label=1))
    absent.keep(person(5.0, 4.0, label=2))
    print_ = print_at(x, rested)
    print_["width"] = width
    bodies = empty(BODY, 1)
    bodies[0] = person(1.0, 4.0, label=3)
    for name, value in other.items():
        bodies[name] = value
    found = absent.standing(print_, bodies)
    assert (found and int(found["label"])) == label


def test_who_is_found_is_waited_for_no_more(absent: Absent) -> None:
    absent.keep(person(4.0, 4.0, label=1))
    absent.keep(person(5.0, 4.0, label=2))
    absent.found(absent.standing(print_at(4.4, 30.0), empty(BODY, 1)))
    assert absent.gone(1e6) == [Vanished(1e6, 2, 10.0, 1e6)]
