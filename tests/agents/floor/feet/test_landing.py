"""Whose shoe has landed: by where its owner is expected, and by when a foot that swings comes down."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tms_agents.floor.feet.landing import landing
from tms_agents.floor.scan.segmentation import CLUSTER
from tms_agents.floor.state import BODY, empty

T = 10.0


def walker(heading: float = 0.0, speed: float = 1.0, unsure: float = 0.01):
    body = empty(BODY, 1)[0]
    body["used"] = body["confirmed"] = 1
    body["at"], body["pp"], body["stride"], body["shoe"] = T, unsure, 0.55, 1.0
    body["vx"], body["vy"] = speed * math.cos(heading), speed * math.sin(heading)
    return body


def price(
    body,
    ahead: float,
    aside: float = 0.0,
    heading: float = 0.0,
    *,
    up: float = 0.45,
    age: float = 0.0,
    stood: float = 0.5,
) -> float:
    """What it costs that a shoe so far from the body is its other foot, up for so long.

    The first was under the body, and had ``stood`` for so long (s), when the shoe landed, ``age`` s ago.
    """
    shoe = np.zeros(1, CLUSTER)[0]
    shoe["x"] = ahead * math.cos(heading) - aside * math.sin(heading)
    shoe["y"] = ahead * math.sin(heading) + aside * math.cos(heading)
    since = T - age
    ox, oy = -age * float(body["vx"]), -age * float(body["vy"])
    return float(landing(body, shoe, ox, oy, since - up, since - stood, since))


def test_who_walks_puts_his_shoe_before_him_not_behind_him_or_far_aside() -> None:
    before = price(walker(), 0.25, 0.05)
    assert before < price(walker(), -0.25, 0.05) - 1.0
    assert before < price(walker(), 0.25, 0.6) - 1.0
    assert before < price(walker(), 0.9, 0.05) - 1.0


@pytest.mark.parametrize("up", [0.0, 0.1, 0.2, 0.3])
def test_a_shoe_that_was_on_the_floor_just_now_has_hardly_landed(up: float) -> None:
    assert price(walker(), 0.25, up=0.5) < price(walker(), 0.25, up=up) - 1.0


def test_who_is_known_to_be_here_is_likelier_than_who_may_be_anywhere_and_less_likely_elsewhere() -> None:
    sure, unsure = walker(unsure=0.006), walker(unsure=0.15)
    assert price(sure, 0.25) < price(unsure, 0.25) - 1.0
    assert price(sure, 1.2, 0.8) > price(unsure, 1.2, 0.8) + 1.0


@given(
    heading=st.floats(-math.pi, math.pi),
    speed=st.floats(0.0, 2.0),
    ahead=st.floats(-1.3, 1.3),
    aside=st.floats(-1.3, 1.3),
    up=st.floats(0.0, 1e9),
    unsure=st.floats(1e-4, 0.25),
)
def test_it_is_a_number_and_the_same_from_every_side(
    heading: float, speed: float, ahead: float, aside: float, up: float, unsure: float
) -> None:
    cost = price(walker(0.0, speed, unsure), ahead, aside, up=up)
    assert math.isfinite(cost)
    if speed > 0.1:
        assert price(walker(heading, speed, unsure), ahead, aside, heading, up=up) == pytest.approx(cost, abs=1e-6)


def test_what_landed_some_scans_ago_is_judged_by_where_he_was_then() -> None:
    assert price(walker(), 0.25) == pytest.approx(price(walker(), 0.05, age=0.2), abs=1e-9)
    assert price(walker(), 0.05, age=0.2) < price(walker(), 0.45, age=0.2) - 1.0


@pytest.mark.parametrize("stood", [10.0, 20.0, 80.0])
def test_who_has_stood_twice_as_long_sets_off_half_as_often(stood: float) -> None:
    standing = walker(speed=0.0)
    once, twice = (price(standing, 0.25, stood=seconds) for seconds in (stood, 2.0 * stood))
    assert twice - once == pytest.approx(math.log(2.0))


def test_who_pauses_between_two_ways_sets_off_as_readily_after_nine_seconds_as_after_three() -> None:
    standing = walker(speed=0.0)
    assert price(standing, 0.25, stood=9.0) == price(standing, 0.25, stood=3.0)


def test_who_shows_one_foot_alone_has_not_stood_on_the_other_for_ever() -> None:
    standing = walker(speed=0.0)
    assert price(standing, 0.25, stood=1e9) == price(standing, 0.25, stood=3.0)


@given(turn=st.floats(-math.pi, math.pi), ahead=st.floats(-0.6, 0.6), speed=st.floats(0.0, 1.5))
def test_which_way_the_room_lies_does_not_count(turn: float, ahead: float, speed: float) -> None:
    """Also of who stands, and so has no heading: it was taken for that of the room's x."""

    def cost(heading: float) -> float:
        return price(walker(heading, speed), ahead, 0.2, heading)

    assert cost(turn) == pytest.approx(cost(0.0), abs=1e-6)
