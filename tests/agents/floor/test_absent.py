"""Who is lost in the middle of a room is somewhere in it."""

from __future__ import annotations

import json

import pytest

from tms_agents.floor.absent import Absent
from tms_agents.floor.events import Vanished
from tms_agents.floor.masks import Area
from tms_agents.floor.shine import expected
from tms_agents.floor.state import BODY, PRINT, empty

DOOR = [(-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5)]


def person(x: float, y: float, *, label: int = 1, seen: float = 10.0, first: float = 0.0, own: float = 7.0):
    (body,) = empty(BODY, 1)
    body["used"] = body["confirmed"] = 1
    body["label"], body["x"], body["y"], body["x0"], body["y0"] = label, x, y, x, y
    body["seen"], body["first"], body["hits"] = seen, first, 100
    body["own"], body["own_n"], body["look"], body["look_n"] = own, 200, own, 50
    return body


@pytest.fixture
def absent() -> Absent:
    return Absent(Area([DOOR]))


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


def test_without_doors_people_may_leave_anywhere() -> None:
    assert not Absent(Area([])).keep(person(4.0, 4.0))


def test_a_glimpse_is_nobody(absent: Absent) -> None:
    glimpse = person(4.0, 4.0)
    glimpse["hits"] = 10
    assert not absent.keep(glimpse)


def test_who_is_too_far_away_or_looks_otherwise_is_somebody_else(absent: Absent) -> None:
    absent.keep(person(4.0, 4.0))
    assert absent.find(person(9.0, 4.0, first=11.0), expected()) is None
    assert absent.find(person(4.5, 4.0, first=11.0, own=6.0), expected()) is None
    assert absent.find(person(4.5, 4.0, first=11.0), expected()) is not None


def test_of_two_the_one_who_looks_like_it(absent: Absent) -> None:
    absent.keep(person(4.0, 4.0, label=1, own=7.3))
    absent.keep(person(4.2, 4.0, label=2, own=7.1))
    assert absent.find(person(4.0, 4.0, first=11.0, own=7.1), expected())["label"] == 2


def test_who_does_not_turn_up_has_left(absent: Absent) -> None:
    absent.keep(person(4.0, 4.0, label=5))
    assert absent.gone(25.0) == []
    assert absent.gone(31.0) == [Vanished(31.0, 5, 10.0, 31.0)]
    assert absent.gone(32.0) == []


def test_who_is_waited_for_is_so_after_a_restart(absent: Absent) -> None:
    absent.keep(person(4.0, 4.0, label=5))
    absent.keep(person(7.0, 4.0, label=6))
    again = Absent(Area([DOOR]))
    again.restore(json.loads(json.dumps(absent.save())))
    assert again.find(person(4.5, 4.0, first=12.0), expected())["label"] == 5
    assert again.gone(31.0) == [Vanished(31.0, 6, 10.0, 31.0)]


def test_nobody_is_saved_too(absent: Absent) -> None:
    absent.restore(absent.save())
    assert absent.gone(1e6) == []


@pytest.mark.parametrize(("away", "since", "stands"), [(0.5, 12.0, True), (0.5, 2.0, False), (3.0, 12.0, False)])
def test_what_came_where_somebody_was_lost_may_be_his_foot(
    absent: Absent, away: float, since: float, stands: bool
) -> None:
    absent.keep(person(4.0, 4.0))
    (print_,) = empty(PRINT, 1)
    print_["x"], print_["y"], print_["rested"] = 4.0 + away, 4.0, since
    assert absent.stands(print_) == stands
