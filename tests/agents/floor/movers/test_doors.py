"""Where people come and go: by the gates that are told, or where they were seen to come."""

from __future__ import annotations

import json
import math

import numpy as np
import pytest
from floor_rooms import Room, sweep

from tms_agents.floor import FloorSettings, Scene, Sensor
from tms_agents.floor.movers.coverage import Coverage
from tms_agents.floor.movers.doors import Doors
from tms_agents.floor.scan.masks import Area
from tms_agents.floor.scan.view import View
from tms_agents.floor.state import BODY, empty

GATE = [(-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5)]
#: Out of sight beyond x = 0, and behind something at x = 6.
EDGES = np.array([[0.0, -3.0, 0.0, 3.0], [6.0, -3.0, 6.0, 3.0]])


def lost(x: float, y: float = 0.0):
    """Somebody whose foot was seen last at (x, y)."""
    (body,) = empty(BODY, 1)
    body["x"], body["y"], body["ax"], body["ay"], body["a_seen"] = x, y, x, y, 10.0
    return body


@pytest.fixture
def doors() -> Doors:
    found = Doors(Area([]))
    found.see(EDGES)
    return found


def test_as_long_as_nothing_is_known_everybody_may_leave_anywhere() -> None:
    unknown = Doors(Area([]))
    assert not unknown.known
    assert not unknown.keeps(lost(3.0))
    assert not unknown.inside(3.0, 0.0) and not unknown.enters(3.0, 0.0)


def test_in_plain_sight_nobody_leaves(doors: Doors) -> None:
    assert doors.keeps(lost(3.0)) and doors.inside(3.0, 0.0)
    assert not doors.keeps(lost(0.3)) and not doors.keeps(lost(5.7))


def test_where_people_have_come_they_go_and_nowhere_else(doors: Doors) -> None:
    doors.came(0.2, 0.0, alone=True)
    assert not doors.keeps(lost(0.3, 0.5))
    assert doors.enters(0.3, 0.5) and not doors.inside(0.3, 0.5)
    # Behind the other one he is hidden.
    assert doors.keeps(lost(5.7)) and doors.inside(5.7, 0.0) and not doors.enters(5.7, 0.0)
    # Along the same edge, but far from where people came.
    assert doors.keeps(lost(0.3, 2.5))


def test_there_may_be_two_doors(doors: Doors) -> None:
    doors.came(0.2, 0.0, alone=True)
    doors.came(5.8, 0.0, alone=False)
    assert not doors.keeps(lost(0.3)) and not doors.keeps(lost(5.7))


@pytest.mark.parametrize("alone", [True, False])
def test_who_comes_where_sight_does_not_seem_to_end_shows_that_it_does_if_it_can_be_nobody_else(
    doors: Doors, alone: bool
) -> None:
    doors.came(3.0, 0.0, alone)
    assert doors.keeps(lost(3.5)) != alone
    assert doors.inside(3.5, 0.0) != alone
    assert not doors.enters(3.5, 0.0)
    assert doors.keeps(lost(4.5))


def test_what_is_remembered_does_not_grow_for_ever(doors: Doors) -> None:
    for k in range(1000):
        doors.came(0.2, 2.0 if k < 500 else -2.0, alone=True)
    assert len(json.dumps(doors.save())) < 20_000
    assert doors.keeps(lost(0.2, 2.0)) and not doors.keeps(lost(0.2, -2.0))


def test_told_gates_are_all_there_are() -> None:
    told = Doors(Area([GATE]))
    told.came(5.9, 0.0, alone=True)
    assert told.known and told.told
    assert told.keeps(lost(5.9)) and told.inside(5.9, 0.0)
    assert not told.keeps(lost(0.6)) and told.enters(1.1, 0.0) and not told.enters(1.3, 0.0)
    assert told.inside(1.3, 0.0) and not told.inside(1.1, 0.0)


def test_it_outlives_a_restart(doors: Doors) -> None:
    doors.came(0.2, 0.0, alone=True)
    doors.came(3.0, 0.0, alone=True)
    again = Doors(Area([]))
    again.restore(json.loads(json.dumps(doors.save())))
    for x in np.linspace(0.0, 6.0, 25):
        assert again.keeps(lost(x)) == doors.keeps(lost(x))
        assert again.inside(x, 0.0) == doors.inside(x, 0.0)
    damaged = doors.save()
    damaged["edges"]["data"] = "AAAA"
    with pytest.raises(ValueError):
        again.restore(damaged)


def test_a_laser_that_is_covered_keeps_nobody_from_knowing_what_the_others_see() -> None:
    sensor = Sensor(sweep(), (0.05, 0.05, math.pi / 4), 1.0)
    sees, covered = (View(index, sensor, FloorSettings(), ()) for index in range(2))
    for _, _, ranges in Room().scans(7.0):
        sees.take(ranges)
        sees.background.classify(sees.ranges)
        sees.background.learn(sees.ranges, sees.claimed, 0.1)
    far = [(7.0, 1.0), (8.0, 1.0), (8.0, 2.0), (7.0, 2.0)]
    doors = Doors(Area([far]))
    Coverage(Scene(gates=[far]), doors).look([sees, covered], 10.0, 0.1)
    assert doors.unseen_m == [pytest.approx(2.0, abs=0.1)]
