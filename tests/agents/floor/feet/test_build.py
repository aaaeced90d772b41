"""What tells how somebody is built: legs or shoes, how long the shoes are, and which way they point."""

from __future__ import annotations

import math

import numpy as np
import pytest
from floor_rooms import WALLS, cast, sweep
from hypothesis import given, settings
from hypothesis import strategies as st

from tms_agents.floor import Sensor
from tms_agents.floor.feet.build import SHOD, SHOES, agree, astray, count_shoes, from_side, legs, shoe_length, size_up
from tms_agents.floor.feet.gait import middle
from tms_agents.floor.scan.background import BACKGROUND, FOREGROUND
from tms_agents.floor.scan.rays import rays
from tms_agents.floor.scan.segmentation import CLUSTER, Segmenter
from tms_agents.floor.state import BODY, empty

SENSOR = Sensor(sweep(1081, math.radians(270.0)), (0.05, 0.05, math.pi / 4))
STEP = np.abs(np.diff(SENSOR.sweep.angles, append=SENSOR.sweep.angles[-1] + 0.003))
EMPTY = cast(SENSOR, [], WALLS)
AT = (1.7, 1.3)


def shoe(length: float, heading: float):
    """The cluster of a shoe at `AT`: all discs between a heel and broader toes."""
    heel, toes = 0.12 * length, 0.18 * length
    long = length - heel - toes
    discs = [
        (
            AT[0] + (share - 0.5) * long * math.cos(heading),
            AT[1] + (share - 0.5) * long * math.sin(heading),
            heel + share * (toes - heel),
        )
        for share in np.linspace(0.0, 1.0, 41)
    ]
    ranges = cast(SENSOR, discs, WALLS)
    states = np.where(ranges < EMPTY - 0.03, FOREGROUND, BACKGROUND).astype(np.int8)
    segment = Segmenter(STEP, math.radians(10.0))
    (found,) = segment(ranges, states, np.zeros(ranges.size, np.bool_), EMPTY, EMPTY, rays(SENSOR, SENSOR.pose, []))
    return found.copy()


def going(heading: float, speed: float = 1.0):
    body = empty(BODY, 1)[0]
    body["used"] = body["confirmed"] = 1
    body["sure"], body["vx"], body["vy"] = 1.0, speed * math.cos(heading), speed * math.sin(heading)
    return body


@settings(deadline=None)
@given(length=st.floats(0.23, 0.31), across=st.floats(0.7, math.pi - 0.7))
def test_a_shoe_is_as_long_as_it_is_from_wherever_its_side_is_seen_and_points_along_itself(
    length: float, across: float
) -> None:
    heading = math.atan2(AT[1] - SENSOR.pose[1], AT[0] - SENSOR.pose[0]) + across
    seen = shoe(length, heading)
    assert from_side(seen)
    # Aslant, one beam that just hits the tip or just misses it is worth 2 cm.
    assert abs(shoe_length(seen) - length) < 0.04
    assert astray(going(heading), seen) == pytest.approx(astray(going(heading + math.pi), seen), abs=1e-9)
    assert astray(going(heading), seen) < 0.3


def test_over_all_the_ways_a_shoe_may_point_its_length_is_off_by_less_than_a_beam_is_wide() -> None:
    away = math.atan2(AT[1] - SENSOR.pose[1], AT[0] - SENSOR.pose[0])
    off = [shoe_length(shoe(0.27, away + across)) - 0.27 for across in np.linspace(0.7, math.pi - 0.7, 60)]
    beam = math.dist(AT, SENSOR.pose[:2]) * STEP[0]
    assert np.sqrt(np.mean(np.square(off))) < beam
    assert abs(np.mean(off)) < 0.5 * beam


def test_a_shoe_seen_from_its_tip_or_half_hidden_tells_no_length() -> None:
    away = math.atan2(AT[1] - SENSOR.pose[1], AT[0] - SENSOR.pose[0])
    assert not from_side(shoe(0.28, away))
    hidden = shoe(0.28, away + 1.5)
    hidden["cut"] = 1
    body = going(away + 1.5)
    size_up(body, hidden)
    assert not from_side(hidden)
    assert body["shoe_length_n"] == 0


@pytest.mark.parametrize(("turned", "speed", "learned"), [(0.0, 1.0, True), (1.2, 1.0, False), (0.0, 0.2, False)])
def test_lengths_are_learned_of_who_walks_the_way_his_shoe_points(turned: float, speed: float, learned: bool) -> None:
    heading = 2.3
    body = going(heading + turned, speed)
    for _ in range(5):
        size_up(body, shoe(0.28, heading))
    assert (body["shoe_length_n"] == 5) == learned
    assert not learned or body["own_shoe_length"] == pytest.approx(0.28, abs=0.02)


@pytest.mark.parametrize(("sure", "learned"), [(1.0, True), (0.3, False)])
def test_what_is_known_of_a_name_is_learned_while_it_is_sure(sure: float, learned: bool) -> None:
    body = going(2.3)
    body["sure"] = sure
    size_up(body, shoe(0.28, 2.3))
    assert body["shoe_length_n"] == 1
    assert (body["own_shoe_length_n"] == 1) == learned


@pytest.mark.parametrize(
    ("width", "speed", "cut", "shod"),
    [(0.24, 1.0, 0, True), (0.11, 1.0, 0, False), (0.24, 0.0, 0, False), (0.24, 1.0, 1, False)],
)
def test_shoes_are_told_from_legs_by_everybody_who_walks(width: float, speed: float, cut: int, shod: bool) -> None:
    bodies, clusters, shoes = empty(BODY, 2), np.zeros(2, CLUSTER), legs()
    bodies["used"] = bodies["confirmed"] = 1
    bodies["vx"], bodies["a_print"], bodies["b_print"] = speed, (0, 1), -1
    clusters["width"], clusters["cut"] = width, cut
    for _ in range(10):
        count_shoes(bodies, clusters, np.arange(2), 0.0, shoes)
    assert (shoes[0] > SHOD) == shod


@pytest.mark.parametrize("backwards", [False, True])
def test_who_has_just_put_down_a_shoe_goes_where_it_points(backwards: bool) -> None:
    """A step and a stride straight on along x; the shoe, whichever end was seen first, has turned to the left."""
    body = going(0.0)
    body["shoe"] = 1.0
    body["a_seen"] = body["a_stood"] = body["a_land"] = body["b_seen"] = body["b_stood"] = 1.0
    body["a_px"], body["a_py"], body["a_ox"], body["a_oy"] = 0.6, 0.0, -0.6, 0.0
    body["b_px"], body["b_py"], body["b_land"] = 0.0, 0.0, 0.6
    before = middle(body, 1.0)
    turned = math.radians(30.0) + math.pi * backwards
    body["ex"], body["ey"], body["e_at"] = math.cos(turned), math.sin(turned), 1.0
    after = middle(body, 1.0)
    assert before[:3] == after[:3]
    assert before[4] == 0.0
    assert math.atan2(after[4], after[3]) == pytest.approx(math.radians(15.0), abs=math.radians(6.0))
    assert after[5] < before[5]


@pytest.mark.parametrize(
    ("share", "seen", "kind"), [(0.6, 500, "shoes"), (0.01, 500, "legs"), (0.3, 500, "either"), (0.6, 100, "either")]
)
def test_all_show_what_is_known_to_be_seen(share: float, seen: int, kind: str) -> None:
    bodies = empty(BODY, (2, 2))
    bodies["used"] = 1
    bodies["shoe"] = [[0.05, 0.8], [0.5, 0.0]]
    agree(bodies, np.array([share, seen]))
    shod = (bodies["shoe"] >= SHOES).tolist()
    assert (
        shod == {"shoes": [[True] * 2] * 2, "legs": [[False] * 2] * 2, "either": [[False, True], [True, False]]}[kind]
    )
