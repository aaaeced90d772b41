"""Who stands and is passed keeps his name: what he stands on is still there when the passer has gone on with it."""

from __future__ import annotations

import math

import numpy as np
import pytest
from floor_prints import shows

from tms_agents.floor import FloorEstimator, Scene, Sensor
from tms_agents.floor.feet.brightness import expected
from tms_agents.floor.feet.left_feet import take_back
from tms_agents.floor.feet.likelihood import feet
from tms_agents.floor.feet.one_foot import UNLIKELY
from tms_agents.floor.feet.prints import attend
from tms_agents.floor.scan.segmentation import CLUSTER
from tms_agents.floor.state import BODY, PRINT, empty
from tms_agents.simulation.floor_world import FloorWorld

NOW = 100.0
LABEL = 7


def left(**of_both: float) -> np.ndarray:
    """Two prints at (2, 2) and (2.2, 2) that label 7 stood on until half a second ago, and two he walks on now."""
    prints = empty(PRINT, 4)
    prints["used"], prints["last"], prints["owner"], prints["whose"] = 1, NOW, -1, LABEL
    prints["x"], prints["y"], prints["width"] = [2.0, 2.2, 3.0, 3.2], [2.0, 2.0, 3.0, 3.2], 0.1
    prints["first"] = prints["rested"] = [NOW - 30.0, NOW - 30.0, NOW - 0.6, NOW - 0.2]
    prints["hits"], prints["owned"], prints["idle"] = [300, 300, 6, 2], [NOW - 0.5, NOW - 0.5, NOW, NOW], 0.5
    prints["owner"][2:] = 0
    for name, value in of_both.items():
        prints[name][:2] = value
    return prints


def walks() -> np.ndarray:
    bodies = empty(BODY, 2)
    body = bodies[0]
    body["used"] = body["confirmed"] = 1
    body["label"], body["x"], body["y"], body["vx"], body["seen"] = LABEL, 3.1, 3.1, 0.9, NOW
    body["a_print"], body["ax"], body["ay"], body["a_seen"] = 2, 3.0, 3.0, NOW
    body["b_print"], body["bx"], body["by"], body["b_seen"] = 3, 3.2, 3.2, NOW
    return bodies


def test_who_leaves_both_feet_behind_stands_on_them_and_who_walks_is_somebody_new() -> None:
    bodies, prints = walks(), left()
    assert take_back(bodies, prints, NOW, expected()) == 1
    stands, goes_on = bodies
    assert (stands["x"], stands["y"]) == pytest.approx((2.1, 2.0))
    assert {int(stands["a_print"]), int(stands["b_print"])} == {0, 1}
    assert list(prints["owner"][:2]) == [0, 0]
    assert (goes_on["used"], goes_on["confirmed"], goes_on["vx"]) == (1, 0, 0.9)
    assert (goes_on["x"], goes_on["y"], goes_on["a_print"], goes_on["b_print"]) == pytest.approx((3.1, 3.1, 2, 3))
    assert take_back(bodies, prints, NOW, expected()) == 0  # once is enough


@pytest.mark.parametrize(
    ("stood", "later", "away", "may_step"),
    [
        (30.0, 0.1, 0.5, False),
        (30.0, 0.1, 0.25, True),  # no farther than feet are that stand
        (30.0, 0.7, 0.5, True),  # no foot of his has been seen there for a while
        (5.0, 0.1, 0.5, True),  # he had not stood there for long
    ],
)
def test_who_stands_on_them_again_does_not_take_the_next_step_of_the_passer(
    stood: float, later: float, away: float, may_step: bool
) -> None:
    bodies, prints = walks(), left(rested=NOW - stood)
    take_back(bodies, prints, NOW, expected())
    clusters = np.zeros(1, CLUSTER)
    clusters["x"], clusters["y"], clusters["n"], clusters["width"], clusters["spacing"] = 2.2 + away, 2.0, 6, 0.1, 0.015
    prints = np.concatenate([prints, prints[3:]])
    prints["first"][4] = prints["rested"][4] = NOW + later
    cost = np.zeros((1, 2))
    feet(shows(clusters, prints, NOW + later, 4), np.ones(1, np.bool_), bodies, 0, cost)
    assert bool(cost.min() < UNLIKELY) == may_step


@pytest.mark.parametrize(
    "what",
    [
        {"owner": 1},  # somebody stands there
        {"last": NOW - 0.1},  # not there now
        {"whose": 8},  # it was somebody else's
        {"hits": 5},
        {"rested": NOW - 1.0},  # he had stepped there, no more
        {"owned": NOW - 20.0},  # long ago
        {"idle": 10.0},  # most of the time nobody's: things beside him
        {"revealed": 1},  # furniture
    ],
)
def test_what_was_not_his_foot_for_long_and_until_lately_is_left_alone(what: dict[str, float]) -> None:
    bodies, prints = walks(), left(**what)
    before = bodies.copy()
    assert take_back(bodies, prints, NOW, expected()) == 0
    assert bodies.tobytes() == before.tobytes()


@pytest.mark.parametrize(
    ("alone", "print_shine", "walks_with", "taken_back"),
    [
        (0.0, 0.0, 0.0, False),  # what lies there may be what he has put down
        (0.0, 0.0, 0.8, True),  # as bright as his feet, and what walks is not
        (0.0, 0.8, 0.8, False),
        (20.0, 0.0, 0.0, True),  # nothing else had been seen of him
        (20.0, 0.8, 0.0, False),  # but it is not as bright as his feet
    ],
)
def test_one_print_is_his_foot_by_its_brightness_or_if_it_was_all_that_was_seen_of_him(
    alone: float, print_shine: float, walks_with: float, taken_back: bool
) -> None:
    bodies, prints = walks(), left(alone=alone)
    prints["used"][1] = 0
    prints["shine_n"], prints["shine"][0], prints["shine"][2:] = 10, print_shine, walks_with
    bodies["own"], bodies["own_n"] = 0.0, 400
    assert take_back(bodies, prints, NOW, expected()) == taken_back
    assert (abs(bodies["x"][0] - 2.0) < 1e-9) == taken_back


@pytest.mark.parametrize(("other_seen", "alone"), [(0.1, 0.0), (3.0, 2.0)])
def test_a_print_is_all_that_is_seen_of_him_while_the_other_foot_is_hidden(other_seen: float, alone: float) -> None:
    bodies, prints = walks()[:1], left()
    bodies["b_seen"] = NOW - other_seen
    for k in range(20):
        prints["last"] = NOW + 0.1 * k
        bodies["seen"] = bodies["a_seen"] = NOW + 0.1 * k
        bodies["b_seen"] = NOW + 0.1 * k - other_seen
        attend(prints, bodies, NOW + 0.1 * k, 0.1, expected(), np.zeros(2))
    assert prints["alone"][2] == pytest.approx(alone)


@pytest.mark.parametrize(("seed", "until"), [(1422, 95.0), (1415, 126.0)])
def test_who_stands_in_a_room_still_has_his_name_when_the_passer_has_gone_on(seed: int, until: float) -> None:
    """In both somebody passes before the second one who stands there, and is taken for him for a moment."""
    world = FloorWorld("standing", seed, feet="legs")
    known = world.known()
    sensors = {name: Sensor(mount.laser.sweep(), mount.reported) for name, mount in world.sensors.items()}
    estimator = FloorEstimator(sensors, scene=Scene(region=known.region, gates=known.gates, seats=known.seats))
    names: list[int] = []
    for frame in world.scans():
        estimator.scan(frame.sensor, frame.t, frame.ranges, frame.intensities)
        if frame.t > until or (not names and frame.t > 60.0):
            here = world.life.movers["p2"].xy
            movers = [one for one in estimator.labels() if one.kind == "mover"]
            names.append(min(movers, key=lambda one: math.dist(one.xy, here)).id)
        if frame.t > until:
            break
    assert names[0] == names[1]
    assert not [one for one in estimator.labels() if one.kind == "object" and math.dist(one.xy, here) < 0.2]
