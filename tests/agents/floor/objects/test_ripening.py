"""When what rests is told as a thing or learned as furniture, and when it waits."""

from __future__ import annotations

import numpy as np
import pytest
from floor_prints import NOW, resting

from tms_agents.floor import Appeared, FloorSettings
from tms_agents.floor.feet.brightness import expected
from tms_agents.floor.objects.objects import Objects
from tms_agents.floor.objects.ripening import FURNITURE, OBJECT, joins
from tms_agents.floor.state import BODY, THING, empty


def told(
    prints: np.ndarray,
    kind: int = OBJECT,
    *,
    robots: bool = False,
    robot_m: float = 0.8,
    unseen_s: float = 0.0,
    intact: bool = False,
) -> bool:
    """Whether it is; where there are ``robots`` one stands so far away and was last seen so long ago.

    ``intact``: nothing has gone from the room.
    """
    objects, bodies = Objects(empty(THING, 1), FloorSettings()), empty(BODY, 1)
    if robots:
        objects.robot_at = NOW - 10.0
        bodies["used"] = bodies["machine"] = 1
        bodies["x"], bodies["y"], bodies["seen"] = prints["x"] + robot_m, prints["y"], NOW - unseen_s
    return objects.ripe(prints, bodies, NOW, expected(), intact) == [(0, kind)]


@pytest.mark.parametrize(
    ("attached", "stayed_s", "whole", "kind"),
    [(0.6, 2.0, 300, OBJECT), (0.6, 0.5, 300, FURNITURE), (0.6, 2.0, 100, FURNITURE), (0.9, 2.0, 300, FURNITURE)],
)
def test_what_somebody_put_down_close_to_a_wall_is_a_thing_though_it_often_seems_a_part_of_it(
    attached: float, stayed_s: float, whole: int, kind: int
) -> None:
    assert told(resting(30.0, attached=attached, whole=whole, busy=NOW - 30.0 + stayed_s), kind)


@pytest.mark.parametrize(
    ("attached", "intact", "kind"), [(0.8, True, OBJECT), (0.8, False, FURNITURE), (0.95, True, FURNITURE)]
)
def test_what_is_new_at_a_wall_is_a_thing_where_nothing_has_gone_from_the_room(
    attached: float, intact: bool, kind: int
) -> None:
    """Furniture that is pushed to a wall has left its place."""
    assert told(resting(30.0, attached=attached), kind, intact=intact)


@pytest.mark.parametrize(
    ("person", "robot", "revealed", "seen_s", "joined"),
    [(1, 0, 0, 0.0, True), (0, 0, 0, 0.0, False), (1, 1, 0, 0.0, False), (1, 0, 1, 0.0, False), (1, 0, 0, 1.0, False)],
)
def test_something_is_joined_to_the_room_where_somebody_may_have_put_it(
    person: int, robot: int, revealed: int, seen_s: float, joined: bool
) -> None:
    prints, bodies = resting(3.0, attached=0.6, revealed=revealed), empty(BODY, 2)
    prints["last"] = NOW - seen_s
    bodies["used"][0], bodies["confirmed"][0], bodies["robot"][0] = person, 1, robot
    assert joins(prints, bodies, NOW) == joined
    prints["attached"] = 0.4
    assert not joins(prints, bodies, NOW)


@pytest.mark.parametrize(
    ("fields", "known"),
    [
        ({}, True),
        ({"spare": 0.2}, False),  # nobody showed both feet for long
        ({"whole": 5}, False),  # it may have been a part of a foot
        ({"rested": NOW - 1.7}, False),  # not for a second
        ({"last": NOW - 0.3}, False),  # it may have been a foot that is lifted
        ({"busy": NOW}, False),  # he is still there
        ({"hidden": NOW - 0.6}, False),  # nothing hides it: it may have been taken
    ],
)
def test_what_lay_there_beside_two_feet_is_told_though_it_is_hidden_when_he_has_gone(
    fields: dict[str, float], known: bool
) -> None:
    assert told(resting(4.0, **({"last": NOW - 1.0, "hidden": NOW, "spare": 0.5, "busy": NOW - 2.5} | fields))) == known


@pytest.mark.parametrize(("owned_s", "busy_s", "known"), [(15.0, 14.0, True), (15.0, 8.0, False), (40.0, 8.0, True)])
def test_what_is_wide_and_was_taken_for_a_foot_is_none_when_nobody_has_been_near_for_long(
    owned_s: float, busy_s: float, known: bool
) -> None:
    """It has been there for 20 s; what it was before that does not matter."""
    bin_ = resting(20.0, width=0.25, owned=NOW - owned_s, busy=NOW - busy_s)
    assert told(bin_) == known


def test_what_is_hidden_is_not_learned_as_a_part_of_the_wall_until_it_is_seen_again() -> None:
    before = {"attached": 0.95, "spare": 0.5, "busy": NOW - 8.0}
    assert not told(resting(12.0, last=NOW - 1.0, hidden=NOW, **before), FURNITURE)
    assert told(resting(12.0, **before), FURNITURE)


def test_a_thing_that_is_told_while_it_is_hidden_was_seen_before() -> None:
    prints, objects = resting(4.0, last=NOW - 1.0, x=1.0), Objects(empty(THING, 1), FloorSettings())
    told = objects.born(0, prints, empty(BODY, 1), lambda: 7, NOW)
    assert [(event.label, event.t, event.since) for event in told if isinstance(event, Appeared)] == [
        (7, NOW, NOW - 4.0)
    ]
    assert [label.seen_at for label in objects.labels()] == [NOW - 1.0]


def test_what_is_as_wide_as_a_shoe_from_its_side_waits() -> None:
    assert told(resting(1.5))
    assert not told(resting(1.5, width=0.22))
    assert told(resting(4.5, width=0.22))


def test_it_waits_for_longer_where_somebody_stood_on_it() -> None:
    assert not told(resting(20.0, width=0.22, owned=NOW - 5.0, busy=NOW - 5.0))
    assert told(resting(20.0, width=0.12, owned=NOW - 5.0, busy=NOW - 5.0))
    assert told(resting(30.0, width=0.22, owned=NOW - 12.0, busy=NOW - 12.0))


@pytest.mark.parametrize(("absorb_s", "furniture"), [(2.0, True), (8.0, False)])
def test_how_long_what_is_wide_rests_until_it_is_furniture_is_a_setting(absorb_s: float, furniture: bool) -> None:
    objects = Objects(empty(THING, 1), FloorSettings(absorb_s=absorb_s))
    found = objects.ripe(resting(5.0, width=0.3), empty(BODY, 1), NOW, expected())
    assert found == ([(0, FURNITURE)] if furniture else [])


def test_what_a_hand_put_behind_something_is_no_part_of_a_robot() -> None:
    assert not told(resting(8.0, covered=81), robots=True)
    assert told(resting(8.0, covered=81, given=1), robots=True)


@pytest.mark.parametrize(("away", "unseen_s", "known"), [(0.8, 0.0, False), (2.0, 0.0, True), (2.0, 5.0, False)])
def test_what_a_robot_cannot_have_come_to_is_no_part_of_it(away: float, unseen_s: float, known: bool) -> None:
    prints = resting(8.0, covered=81)
    assert told(prints, robots=True, robot_m=away, unseen_s=unseen_s) == known


@pytest.mark.parametrize(("seconds", "known"), [(50.0, False), (70.0, True)])
def test_what_lies_behind_something_for_a_minute_is_no_part_of_a_robot_though_people_pass(
    seconds: float, known: bool
) -> None:
    """Whoever passes hides it for a moment: it is where it was when it comes out again."""
    prints = resting(seconds, covered=round(10 * seconds), busy=NOW - 15.0)
    prints["first"] = NOW - 10.0
    assert told(prints, robots=True) == known


@pytest.mark.parametrize(("whole", "known"), [(20, True), (5, False)])
def test_what_a_hand_put_in_full_view_is_no_part_of_a_robot(whole: int, known: bool) -> None:
    """It is told before somebody, or the robot, stands before it."""
    assert told(resting(2.0, busy=NOW, given=1, whole=whole), robots=True) == known
