"""What is as bright as somebody's feet beside him is rather his than what is not, where lasers tell brightness."""

from __future__ import annotations

import math

import numpy as np
import pytest
from floor_rooms import WALLS, Circle, Room, cast, walker

from tms_agents.floor import Appeared, FloorEstimator, FloorEvent, FloorSettings
from tms_agents.floor.feet.brightness import expected, note
from tms_agents.floor.feet.own_feet import exchange
from tms_agents.floor.objects.objects import Objects
from tms_agents.floor.objects.ripening import OBJECT
from tms_agents.floor.scan.segmentation import CLUSTER
from tms_agents.floor.state import BODY, PRINT, THING, empty

NOW = 100.0
#: Logarithm of the brightness of somebody's feet, and of something else.
HIS, OTHER = 7.0, 8.5


def stands(own_n: int = 400) -> np.ndarray:
    """Somebody at the origin, on the prints 0 and 1, whose brightness was seen so often."""
    bodies = empty(BODY, 1)
    bodies["used"] = bodies["confirmed"] = bodies["b_print"] = 1
    bodies["label"], bodies["own"], bodies["own_n"] = 3, HIS, own_n
    bodies["seen"] = bodies["a_seen"] = bodies["b_seen"] = NOW
    bodies["ax"], bodies["bx"], bodies["b_ox"], bodies["b_land"] = -0.1, 0.3, 1e9, NOW - 3.0
    return bodies


def resting(*shines: float) -> np.ndarray:
    """Prints that have rested for three seconds: at the feet of `stands`, and beside the first of them."""
    prints = empty(PRINT, len(shines))
    prints["used"], prints["owner"], prints["whose"], prints["owned"] = 1, -1, 3, NOW
    prints["x"] = (-0.1, 0.3, 0.1)
    prints["owner"][:2] = 0
    prints["first"] = prints["rested"] = NOW - 3.0
    prints["last"], prints["shine"], prints["shine_n"] = NOW, shines, 30
    prints["hits"] = prints["looks"] = prints["whole"] = 30
    prints["width"], prints["beams"], prints["spacing"], prints["silent"] = 0.1, 8.0, 0.012, -1e9
    return prints


@pytest.mark.parametrize(
    ("shines", "own_n", "foot"),
    [((HIS, OTHER, HIS), 400, 2), ((HIS, HIS, HIS), 400, 1), ((HIS, OTHER, OTHER), 400, 1), ((HIS, OTHER, HIS), 9, 1)],
)
def test_a_thing_is_exchanged_for_his_own_foot_beside_it(shines: tuple[float, ...], own_n: int, foot: int) -> None:
    bodies, prints = stands(own_n), resting(*shines)
    assert exchange(bodies, prints, NOW, expected()) == (foot == 2)
    assert (bodies["a_print"][0], bodies["b_print"][0]) == (0, foot)
    assert prints["given"].tolist() == [0, int(foot == 2), 0]


@pytest.mark.parametrize(
    ("shine", "stood", "idle", "foot"),
    [(OTHER, 4.0, 0.0, -1), (OTHER, 2.0, 0.0, 1), (HIS, 4.0, 0.0, 1), (OTHER, 9.0, 0.0, 1), (OTHER, 9.0, 5.0, -1)],
)
def test_a_thing_is_not_his_foot_while_his_own_is_hidden(shine: float, stood: float, idle: float, foot: int) -> None:
    """Unless somebody else had stood there before: then the names may have been exchanged."""
    bodies, prints = stands(), resting(HIS, shine, OTHER)
    prints["first"][1], prints["idle"][1] = NOW - stood, idle
    assert exchange(bodies, prints, NOW, expected()) == (foot < 0)
    assert bodies["b_print"][0] == foot
    assert prints["given"].tolist() == [0, int(foot < 0), 0]
    assert bodies["x"][0] == (bodies["ax"][0] if foot < 0 else 0.0)


@pytest.mark.parametrize(("given", "foot"), [(0, 2), (1, -1)])
def test_a_foot_that_is_missing_is_what_was_his_unless_a_hand_put_it_there(given: int, foot: int) -> None:
    bodies, prints = stands(), resting(HIS, HIS, HIS)
    prints["given"][2], prints["used"][1] = given, 0
    bodies["b_print"], bodies["b_seen"] = -1, NOW - 2.0
    exchange(bodies, prints, NOW, expected())
    assert bodies["b_print"][0] == foot


@pytest.mark.parametrize(
    ("shine", "second_foot", "told"), [(HIS, False, False), (HIS, True, True), (OTHER, False, True)]
)
def test_what_is_as_bright_as_his_only_foot_waits(shine: float, second_foot: bool, told: bool) -> None:
    bodies, prints = stands(), resting(HIS, HIS, shine)
    prints["busy"] = prints["owned"] = NOW - 50.0
    if not second_foot:
        bodies["b_print"], bodies["b_seen"], prints["used"][1] = -1, NOW - 60.0, 0
    objects = Objects(empty(THING, 1), FloorSettings())
    assert objects.ripe(prints, bodies, NOW, expected()) == ([(2, OBJECT)] if told else [])


def test_brightness_is_that_of_what_rests_there_now() -> None:
    prints, clusters, marks = resting(OTHER, OTHER, OTHER), np.zeros(2, CLUSTER), np.full((2, 4), HIS)
    prints["hits"] = (1, 30, 30)
    clusters["cut"], clusters["n"] = (0, 1), (5, 1)
    note(prints, clusters, np.array([0, 1]), marks)
    assert prints["shine"].tolist() == [HIS, OTHER, OTHER]
    assert prints["shine_n"].tolist() == [1, 30, 30]


@pytest.mark.parametrize(("width", "shines"), [(0.12, True), (0.25, False)])
def test_two_feet_in_one_do_not_shine_as_one_of_them(width: float, shines: bool) -> None:
    prints, clusters, marks = resting(HIS, HIS, HIS), np.zeros(1, CLUSTER), np.full((1, 4), OTHER)
    prints["hits"], prints["width"] = 30, 0.1
    clusters["n"], clusters["width"] = 9, width
    note(prints, clusters, np.array([0]), marks)
    assert (prints["shine"][0] != HIS) == shines


def played(circles: list[tuple[float, Circle]], ranges: np.ndarray, room: Room) -> np.ndarray:
    """The light of each beam (n,): of the circle it meets, else of the wall."""
    (sensor,) = room.sensors.values()
    light = np.full(ranges.size, 500.0)
    for brightness, circle in circles:
        light[np.abs(cast(sensor, [circle], ()) - ranges) < 0.03] = brightness
    return light * np.maximum(ranges, 0.3) ** -0.287


def test_a_thing_put_down_while_one_leg_hides_the_other_is_the_thing() -> None:
    """He stands on two legs in a row, puts it beside them, and shifts his weight so that both show again."""
    comes = walker([(9.0, 4.9, 2.2), (12.0, 2.2, 2.2)])
    thing = (2.0, 2.5, 0.06)

    def circles(t: float) -> list[tuple[float, Circle]]:
        if t < 12.0:
            return [(1000.0, one) for one in comes(t)]
        aside = 0.0 if 14.0 < t < 22.0 else 0.16
        legs = [(1000.0, (2.15, 2.15, 0.05)), (1000.0, (2.33 + aside, 2.33 - aside, 0.05))]
        return legs + ([(3000.0, thing)] if t >= 20.0 else [])

    room = Room(lambda t: [one for _, one in circles(t)])
    estimator, events = FloorEstimator(room.sensors), list[FloorEvent]()
    for name, t, ranges in room.scans(40.0):
        clean = cast(room.sensors[name], [one for _, one in circles(t)], WALLS)
        events += estimator.scan(name, t, ranges, played(circles(t), clean, room))
    (put,) = [event for event in events if isinstance(event, Appeared) and event.kind == "object"]
    assert math.dist(put.xy, thing[:2]) < 0.03
