"""Robots of known size keep their labels: beside people, behind one another, and where people push things."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Sequence

import numpy as np
from floor_robots import OPEN, SCENE, Way, robot
from floor_rooms import Circle, Room, Segment, walker

from tms_agents.floor import FloorEstimator


def room(
    robots: Sequence[Callable[[float], tuple[Segment, ...]]], *people: Callable[[float], Sequence[Circle]]
) -> Room:
    return Room(
        lambda t: tuple(circle for who in people for circle in who(t)),
        lambda t: (*OPEN, *(side for one in robots for side in one(t))),
    )


IN: Way = [(9.0, 6.0, 2.0), (13.0, 4.0, 2.0), (17.0, 2.4, 2.0), (60.0, 2.4, 2.0)]


def test_a_robot_is_told_in_its_middle() -> None:
    """Not in the middle of what is seen of it, and as soon as it is in the door."""
    far: list[float] = []

    def look(t: float, estimator: FloorEstimator) -> None:
        if t > 13.0:
            (one,) = estimator.labels()
            assert one.robot
            x = float(np.interp(t, [13.0, 17.0], [4.0, 2.4]))
            far.append(math.dist(one.xy, (x, 2.0)))

    room([robot(IN)]).play(30.0, scene=SCENE, each=look)
    assert max(far) < 0.1
    assert max(far[-50:]) < 0.02


def test_a_parked_robot_stays_who_it_is_among_people() -> None:
    """Whose feet pass right before it and stand beside it: no part of it is theirs, and no foot is a part of it."""
    one = walker([(20.0, 4.9, 1.4), (26.0, 1.9, 1.55), (32.0, 1.9, 1.55), (36.0, 0.8, 3.2), (45.0, 0.8, 3.2)])
    two = walker([(22.0, 4.9, 2.6), (27.0, 2.9, 1.6), (33.0, 2.9, 1.6), (38.0, 4.5, 1.6), (45.0, 4.5, 1.6)])
    names: list[set[int]] = []

    def look(t: float, estimator: FloorEstimator) -> None:
        if t > 18.0:
            robots = [label for label in estimator.labels() if label.robot]
            names.append({label.id for label in robots})
            assert all(math.dist(label.xy, (2.4, 2.0)) < 0.1 for label in robots)

    estimator, events = room([robot(IN)], one, two).play(44.0, scene=SCENE, each=look)
    assert len(set.union(*names)) == 1
    assert all(names)
    assert not [event for event in events if getattr(event, "kind", "") == "object"]
    assert len(estimator.labels()) == 3


def test_two_robots_that_pass_keep_their_labels() -> None:
    """One goes on behind the other and comes out on the other side."""
    other: Way = [(20.0, 6.0, 2.4), (23.0, 4.5, 2.6), (32.0, 1.2, 3.2), (60.0, 1.2, 3.2)]
    seen: dict[float, dict[int, tuple[float, float]]] = {}

    def look(t: float, estimator: FloorEstimator) -> None:
        seen[round(t, 1)] = {label.id: label.xy for label in estimator.labels() if label.robot}

    room([robot(IN), robot(other)]).play(40.0, scene=SCENE, each=look)
    before, after = seen[23.5], seen[39.5]
    assert len(before) == 2
    assert set(before) == set(after)
    parked = min(before, key=lambda name: math.dist(before[name], (2.4, 2.0)))
    assert math.dist(after[parked], (2.4, 2.0)) < 0.1
    (driven,) = set(after) - {parked}
    assert math.dist(after[driven], (1.2, 3.2)) < 0.15


def test_what_somebody_pushes_is_no_robot() -> None:
    """A trolley of the size of a robot, learned with the room."""
    trolley = robot([(0.0, 3.0, 2.0), (20.0, 3.0, 2.0), (25.0, 1.4, 2.0), (60.0, 1.4, 2.0)])
    who = walker([(10.0, 4.9, 2.0), (14.0, 3.6, 2.0), (20.0, 3.6, 2.0), (25.0, 2.0, 2.0), (40.0, 2.0, 2.0)])
    told: set[bool] = set()
    room([trolley], who).play(
        40.0, scene=SCENE, each=lambda t, estimator: told.update(label.robot for label in estimator.labels())
    )
    assert told == {False}


def test_it_goes_on_after_a_restart_as_if_there_had_been_none() -> None:
    here = room([robot(IN)], walker([(20.0, 4.9, 1.4), (26.0, 1.9, 1.55), (40.0, 1.9, 1.55)]))
    straight, _ = here.play(30.0, scene=SCENE)
    scans = list(here.scans(30.0))
    estimator = FloorEstimator(here.sensors, None, SCENE)
    for name, t, ranges in scans[:160]:
        estimator.scan(name, t, ranges)
    state = json.loads(json.dumps(estimator.to_dict()))
    estimator = FloorEstimator.from_dict(state, here.sensors, None, SCENE)
    for name, t, ranges in scans[160:]:
        estimator.scan(name, t, ranges)
    assert estimator.to_dict() == straight.to_dict()
