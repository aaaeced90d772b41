"""Where a thing comes to lie that a gripper lets go, and where the gripper is."""

from __future__ import annotations

import math
from datetime import UTC, datetime

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tms_agents.hand.events import Spot
from tms_agents.hand.kinematics import dh_arm
from tms_agents.hand.posture import Posture, Uncertainty
from tms_agents.hand.states import GripperMessage, StateMessage
from tms_agents.hand.surfaces import Surfaces, distance_outside
from tms_schemas.rooms import Room

SQUARE = [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)]


def box(x: float, size: float = 1.0) -> list[tuple[float, float]]:
    return [(x, 0.0), (x + size, 0.0), (x + size, size), (x, size)]


def room(**more: object) -> Room:
    now = datetime(2026, 1, 1, tzinfo=UTC)
    furniture = [
        {"id": "table", "name": "Table", "polygon": box(0), "surfaces": [
            {"id": "top", "polygon": box(0), "z": 0.7}, {"id": "lower", "polygon": box(0), "z": 0.3},
            {"id": "tray", "polygon": box(0.2, 0.3), "z": 0.75}]},
        {"id": "shelf", "name": "Smart", "polygon": box(2), "surfaces": [{"id": "b", "polygon": box(2), "z": 0.9}],
         "agent": "shelf"},
        {"id": "bed", "name": "Bed", "polygon": box(4)},
    ]  # fmt: skip
    fields = {"id": "r", "name": "R", "outline": box(0, 9), "furniture": furniture, "created_at": now}
    return Room.model_validate(fields | {"updated_at": now} | more)


@pytest.mark.parametrize(
    ("xy", "z", "onto", "surface", "watched"),
    [
        ((0.8, 0.8), 0.8, "table", "table/top", False),
        ((0.3, 0.2), 0.85, "table", "table/tray", False),
        ((0.8, 0.8), 0.4, "table", "table/lower", False),
        ((0.8, 0.8), 0.68, "table", "table/top", False),  # kinematics slightly off
        ((1.06, 0.5), 0.8, "table", "table/top", False),  # just beside the edge
        ((0.8, 0.8), None, "table", "table/top", False),
        ((2.5, 0.5), 1.0, "cabinet", None, True),
        ((4.5, 0.5), 0.6, "table", None, False),  # nobody told how high the bed is
        ((1.5, 0.5), 0.2, "floor", None, False),
        ((1.5, 0.5), 1.0, "person", None, True),
        ((2.5, 0.5), 2.0, "person", None, True),
    ],
)
def test_what_is_under_a_gripper(xy, z, onto, surface, watched):
    below = Surfaces(room()).under(Spot(xy, z))
    assert (below.onto, below.surface, below.watched) == (onto, surface, watched)


def test_a_floor_is_watched_where_there_is_a_laser_or_somebody_says_so():
    laser = room(sensors=[{"agent": "laser", "kind": "floor"}])
    spot = Spot((1.5, 0.5), 0.1)
    assert [Surfaces(one, floor_watched=say).under(spot).watched for one, say in
            [(laser, None), (laser, False), (room(), None), (room(), True), (None, None)]] == [
                True, False, False, True, True]  # fmt: skip


@given(st.floats(-2, 3), st.floats(-2, 3))
def test_distance_to_a_square(x, y):
    expected = math.hypot(max(-x, 0, x - 1), max(-y, 0, y - 1))
    assert distance_outside((x, y), SQUARE) == pytest.approx(expected, abs=1e-9)


EYE = np.eye(4)
POSE = st.floats(-3, 3)


def test_a_gripper_in_the_room():
    posture = Posture({"left": dh_arm([("q", "turns", 0.5, 0, 0.9, 0)], EYE, EYE)}, base_z=0.1)
    posture.update(StateMessage(joints={"q": math.pi / 2, "other": 3}, base=(1, 2, math.pi / 2)))
    spot = posture.spot("left", None)
    assert spot.xy == pytest.approx((0.5, 2.0)) and spot.z == pytest.approx(1.0)


def test_ways_not_to_know(caplog):
    posture = Posture({"left": dh_arm([("q", "turns", 0.5, 0, 0, 0)], EYE, EYE), "right": None})
    assert posture.spot("left", None) is None and "no pose of the base" in caplog.text
    posture.update(StateMessage(base=(1, 2, 0)))
    assert posture.spot("left", None) is None and posture.spot("left", None) is None
    # Without an arm it is somewhere at the robot; with a position of its own it is there.
    vague = posture.spot("right", None)
    assert vague.xy == (1, 2) and vague.z is None and vague.cov[0] > 0.1
    own = posture.spot("right", GripperMessage(position=(0.5, 0, 0.8)))
    assert own.xy == (1.5, 2) and own.z == 0.8 and own.cov[0] < 0.01


def test_nonsense_is_no_place(caplog):
    posture = Posture({"h": dh_arm([("q", "slides", 0, 0, 0, 0)] * 30, EYE, EYE)})
    posture.update(StateMessage(joints={"q": 1e4}, base=(0, 0, 0)))
    assert posture.spot("h", None) is None and "its joints put it" in caplog.text


@settings(max_examples=15)
@given(POSE, POSE, POSE, POSE, POSE)
def test_the_covariance_is_that_of_many_noisy_robots(x, y, theta, q1, q2):
    """Against a sample of robots with the same noise."""
    arm = dh_arm([("a", "turns", 0.6, 0.3, 0.2, 0), ("b", "turns", 0.5, 0, 0, 0.4)], EYE, EYE)
    sd = Uncertainty(base_m=0.03, base_rad=0.03, joint=0.02, gripper_m=0.01)
    posture = Posture({"h": arm}, uncertainty=sd)
    posture.update(StateMessage(joints={"a": q1, "b": q2}, base=(x, y, theta)))
    cov = posture.spot("h", None).cov
    found = _sample(np.random.default_rng(0), arm, (x, y, theta), (q1, q2), sd)
    scale = np.trace(found)
    assert np.allclose([cov[0], cov[1], cov[2]], [found[0, 0], found[0, 1], found[1, 1]], atol=0.12 * scale)
    assert cov[0] * cov[2] - cov[1] ** 2 > 0


def _sample(rng, arm, base, states, sd, count: int = 300) -> np.ndarray:
    places = []
    for _ in range(count):
        q = arm.gripper({"a": states[0] + rng.normal(0, sd.joint), "b": states[1] + rng.normal(0, sd.joint)}).xyz
        theta = base[2] + rng.normal(0, sd.base_rad)
        turn = np.array([[math.cos(theta), -math.sin(theta)], [math.sin(theta), math.cos(theta)]])
        places.append(turn @ q[:2] + rng.normal(0, math.hypot(sd.base_m, sd.gripper_m), 2))
    return np.cov(np.array(places).T)
