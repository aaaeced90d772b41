"""What has become as wide as furniture is a robot, or furniture when it stands; not before it can be told."""

from __future__ import annotations

import numpy as np
import pytest

from tms_agents.floor.feet.bodies import misled
from tms_agents.floor.movers.review import THING, Waits, review
from tms_agents.floor.robots.recognizing import recognize, sizes
from tms_agents.floor.scan.background import BACKGROUND
from tms_agents.floor.state import BODY, NEVER, empty

NOW = 100.0
OPEN = (np.full(101, 8.0), np.full(101, BACKGROUND, np.int8), np.full(101, 8.0), np.zeros(3), -0.5, 0.01)


def wide(share: float, **fields: float) -> np.ndarray:
    """It came from 2 m away, like two feet from afar, took no steps, and was 0.5 m wide in such a share of late."""
    bodies = empty(BODY, 1)
    seen = {"used": 1, "confirmed": 1, "label": 1, "hits": 300, "looks": 300, "both": 90, "seen": NOW, "a_seen": NOW}
    looks = {
        "wide": share,
        "far": 0.5,
        "width": 0.5,
        "x0": 2.0,
        "walked_x": 2.0,
        "x": 4.0,
        "ax": 4.0,
        "quality": 1.0,
        "b_seen": -1e9,
    }
    for name, value in (seen | looks | {"a_print": -1, "b_print": -1, "told_x": 4.0, "rest_x": 4.0} | fields).items():
        bodies[name] = value
    return bodies


def test_a_robot_that_comes_near_is_told_before_it_is_taken_for_furniture() -> None:
    """The share in which it was wide grows from scan to scan."""
    for share in np.arange(0.3, 1.0, 0.01):
        bodies = wide(share)
        if recognize(bodies, *sizes(())):
            break
        assert not misled(bodies[0])
    assert bodies["robot"][0] == 1


@pytest.mark.parametrize(("walked_x", "robot"), [(2.0, True), (3.5, False)])
def test_who_walked_and_is_wide_since_is_a_robot_only_if_it_goes_on(walked_x: float, robot: bool) -> None:
    """Who pushes something is one thing with it for a while, and leaves it there."""
    bodies = wide(0.9, both=20, own_stance_n=5, walked_x=walked_x)
    assert recognize(bodies, *sizes(())) == robot


def test_what_is_wide_and_no_robot_is_furniture() -> None:
    assert misled(wide(0.7, pushed=0.9)[0])
    assert not misled(wide(0.7, both=10)[0])


@pytest.mark.parametrize(("rests_s", "furniture"), [(8.0, True), (0.5, False)])
def test_what_goes_is_not_parked_however_long_ago_it_landed(rests_s: float, furniture: bool) -> None:
    bodies, actions = wide(0.6, both=10, a_since=NOW - 9.0, rest_at=NOW - rests_s), np.zeros(1, np.int64)
    waits = Waits(confirm_s=0.5, confirm_m=0.3, leave_s=1.0, hidden_s=60.0, stale_s=1.0)
    review(bodies, NOW, 0.1, OPEN, waits, actions, False, True, False)
    assert (actions[0] == THING) == furniture


def is_thing(rests_s: float, **fields: float) -> bool:
    """Whether who came on two feet and rests for so long, all seen in the open, is found to be a thing."""
    feet = {
        "far": 0.3,
        "both": 200,
        "own_stance_n": 20,
        "b_seen": NOW,
        "bx": 4.0,
        "by": 0.2,
        "b_print": 1,
        "a_print": 0,
    }
    bodies = wide(0.0, **(feet | {"suspected": NEVER, "rest_at": NOW - rests_s, "spacing": 0.02} | fields))
    actions = np.zeros(1, np.int64)
    waits = Waits(confirm_s=0.5, confirm_m=0.3, leave_s=1.0, hidden_s=60.0, stale_s=1.0)
    review(bodies, NOW, 0.1, OPEN, waits, actions, False, True, False)
    return bool(actions[0] == THING)


LEGS = {"own_leg_width": 0.09, "own_leg_width_n": 60}


@pytest.mark.parametrize(
    ("width", "rests_s", "stay_s", "fields", "thing"),
    [
        (0.22, 8.5, 8.5, LEGS, True),
        (0.22, 7.5, 9.0, LEGS, False),
        (0.22, 1.0, 10.5, LEGS, True),
        (0.19, 20.0, 20.0, LEGS, False),
        (0.22, 20.0, 20.0, LEGS | {"own_leg_width": 0.11}, False),
        (0.22, 20.0, 20.0, LEGS | {"own_leg_width_n": 10}, False),
        (0.22, 20.0, 20.0, LEGS | {"spacing": 0.05}, False),
    ],
    ids=[
        *("rests", "not for long", "now here, now there", "as wide as two legs of his", "of whose legs are thick"),
        *("whose legs nobody knows", "beams are far apart"),
    ],
)
def test_nobody_who_stands_is_wider_than_both_his_legs(
    width: float, rests_s: float, stay_s: float, fields: dict[str, float], thing: bool
) -> None:
    assert is_thing(rests_s, width=width, stay=stay_s, stay_x=4.0, **fields) == thing


@pytest.mark.parametrize(
    ("width", "rests_s", "began", "thing"),
    [
        (0.16, 5.0, 90.0, True),
        (0.03, 5.0, 90.0, True),
        (0.16, 5.0, NEVER, False),
        (0.16, 5.0, 60.0, False),
        (0.16, 3.0, 90.0, False),
        (0.12, 20.0, 90.0, False),
    ],
    ids=["wider", "thinner", "nobody began who may be he", "long ago", "not for long", "like his"],
)
def test_where_somebody_began_who_may_be_he_a_leg_unlike_his_is_a_thing(
    width: float, rests_s: float, began: float, thing: bool
) -> None:
    assert is_thing(rests_s, width=width, suspected=began, **LEGS) == thing


@pytest.mark.parametrize(
    ("fields", "thing"),
    [
        ({}, True),
        ({"suspected": NEVER}, False),
        ({"width": 0.12}, False),
        ({"single": 1.0}, False),
        ({"rest_at": NOW - 5.0}, False),
    ],
    ids=["left", "nobody began who may be he", "a shoe from its side", "the other one was just seen", "not for long"],
)
def test_and_so_is_one_shoe_alone_that_is_as_thin_as_none(fields: dict[str, float], thing: bool) -> None:
    shoe = {"shoe": 0.9, "own_shoe_length_n": 20, "own_shoe_length": 0.27, "width": 0.08, "single": 3.0}
    alone = {"b_seen": NOW - 3.0, "a_since": NOW - 7.0, "suspected": 90.0}
    assert is_thing(7.0, **(shoe | alone | fields)) == thing
