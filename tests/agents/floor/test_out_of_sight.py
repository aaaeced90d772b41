"""A gate that is told, but beyond what the laser sees: people go out of sight before they are in it."""

from __future__ import annotations

import json
import math

import numpy as np
import pytest
from floor_robots import OPEN
from floor_rooms import Room, sweep, together, walker

from tms_agents.floor import Appeared, FloorEstimator, Moved, Scene, Sensor, Vanished
from tms_agents.floor.movers.coverage import Coverage
from tms_agents.floor.movers.doors import Doors
from tms_agents.floor.scan.masks import Area
from tms_agents.floor.state import BODY, empty

GATE = [(4.5, 1.2), (5.5, 1.2), (5.5, 2.8), (4.5, 2.8)]
REGION = [(0.0, 0.0), (5.0, 0.0), (5.0, 4.0), (0.0, 4.0)]
#: Who goes to the gate passes it.
BED = [(3.4, 2.4), (4.4, 2.4), (4.4, 3.9), (3.4, 3.9)]
STAYS_S = 12.0


def short_sighted(reach_m: float) -> dict[str, Sensor]:
    return {"A": Sensor(sweep(reach=reach_m), (0.05, 0.05, math.pi / 4))}


def visit(begins: float) -> list[tuple[float, float, float]]:
    """In by the gate, about the room, and out by it."""
    way = [(0.0, 6.0, 2.0), (4.0, 2.0, 2.0), (8.0, 2.0, 1.2), (STAYS_S, 6.0, 2.0)]
    return [(begins + t, x, y) for t, x, y in way]


def play(reach_m: float, *, seats: bool) -> tuple[FloorEstimator, list[Appeared], list[Vanished]]:
    room = Room(together(walker(visit(9.0)), walker(visit(36.0))), lambda _: OPEN, sensors=short_sighted(reach_m))
    scene = Scene(region=REGION, gates=[GATE], seats=[BED] if seats else [])
    estimator, events = room.play(60.0, scene=scene)
    return (
        estimator,
        [one for one in events if isinstance(one, Appeared) and one.kind == "mover"],
        [one for one in events if isinstance(one, Vanished)],
    )


@pytest.mark.parametrize("seats", [False, True], ids=["bare", "past the bed"])
def test_who_comes_after_somebody_has_gone_out_there_is_somebody_new(seats: bool) -> None:
    estimator, came, left = play(3.9, seats=seats)
    assert len(came) == len(left) == 2
    assert came[0].t < 9.0 + STAYS_S < left[0].t < 36.0 < came[1].t
    again = FloorEstimator.from_dict(json.loads(json.dumps(estimator.to_dict())), short_sighted(3.9))
    assert again.labels() == estimator.labels() == []


@pytest.mark.parametrize("scene", [Scene(), Scene(region=REGION, gates=[GATE])], ids=["nothing told", "gates told"])
def test_a_laser_of_which_no_reach_is_known_sees_as_far_as_anything_it_has_seen(scene: Scene) -> None:
    """As in a file of scans that says none; where the wall behind the door is missing nothing echoes."""
    walls = lambda _: OPEN[:-1]  # noqa: E731
    room = Room(walker([(9.0, 2.0, 1.2), (20.0, 2.0, 2.5)]), walls, sensors=short_sighted(math.inf))
    estimator, events = room.play(20.0, scene=scene)
    assert [type(event) for event in events if not isinstance(event, Moved)] == [Appeared]
    assert [label.kind for label in estimator.labels()] == ["mover"]


@pytest.mark.parametrize(("reach_m", "unseen"), [(3.9, True), (8.0, False)])
def test_how_far_before_a_gate_sight_ends(reach_m: float, unseen: bool) -> None:
    gates = Doors(Area([GATE]))
    scene = Scene(region=REGION, gates=[GATE])
    estimator, _ = Room(lambda _: (), lambda _: OPEN, sensors=short_sighted(reach_m)).play(12.0, scene=scene)
    Coverage(scene, gates).look(list(estimator._views.values()), 10.0, 0.1)
    # The nearest corner of the gate; feet are hardly seen before the end of the reach.
    assert gates.unseen_m == [pytest.approx(np.hypot(4.45, 1.15) - (reach_m - 0.3), abs=0.1) if unseen else 0.0]


def lost(x: float, y: float = 2.0):
    (body,) = empty(BODY, 1)
    body["x"], body["y"] = x, y
    return body


def test_where_the_way_to_a_gate_is_out_of_sight_people_come_and_go() -> None:
    doors = Doors(Area([GATE, [(-0.5, 1.0), (0.5, 1.0), (0.5, 2.0), (-0.5, 2.0)]]))
    assert doors.keeps(lost(3.6)) and doors.inside(3.6, 2.0)
    doors.unseen_m = [0.9, 0.0]
    assert not doors.keeps(lost(3.6)) and doors.out_of_sight(lost(3.6))
    assert doors.enters(3.6, 2.0) and not doors.inside(3.6, 2.0)
    assert doors.keeps(lost(3.0)) and not doors.out_of_sight(lost(3.0)) and doors.inside(3.0, 2.0)
    # Who is lost in the other one, which is in sight, has not gone out of sight before it.
    assert not doors.keeps(lost(0.6, 1.5)) and not doors.out_of_sight(lost(0.6, 1.5))
    again = Doors(Area(doors._gates.polygons))
    again.restore(json.loads(json.dumps(doors.save())))
    assert again.unseen_m == [0.9, 0.0]
    # Other gates are told now: how far they are seen is found anew.
    other = Doors(Area([GATE]))
    other.restore(doors.save())
    assert other.unseen_m == [0.0]
