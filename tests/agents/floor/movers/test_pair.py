"""Who stands on two feet that came together is somebody, though nobody saw him walk."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest

from tms_agents.floor.association.association import Association
from tms_agents.floor.events import Appeared, FloorEvent, Moved
from tms_agents.floor.movers.tracks import Tracks
from tms_agents.floor.scan.background import BACKGROUND
from tms_agents.floor.settings import FloorSettings, Scene

NOW = 100.0
#: A laser at the origin that looks along x and sees walls 8 m away.
OPEN = (np.full(101, 8.0), np.full(101, BACKGROUND, np.int8), np.full(101, 8.0), np.zeros(3), -0.5, 0.01)


def feet(body: np.void, apart: float, landed_s: float) -> None:
    """Seen for the first time at NOW at (4, 0): two things so far apart (m), the second put down so much later (s)."""
    values = {"used": 1, "label": -1, "x": 4.0, "x0": 4.0, "first": NOW, "rest_x": 4.0, "rest_at": NOW}
    values |= {"ax": 4.0, "ay": 0.0, "a_since": NOW, "a_land": NOW, "a_print": 0, "suspected": -1e9}
    values |= {"bx": 4.0, "by": apart, "b_since": NOW + landed_s, "b_land": NOW + landed_s, "b_print": 1}
    values |= {"quality": 1.0, "width": 0.1, "far": 0.1}
    for name, value in values.items():
        body[name] = value


def beside(body: np.void, x: float, both: bool) -> None:
    """Somebody known who stands at (x, 0), ``both`` feet seen or one."""
    values = {"used": 1, "confirmed": 1, "label": 1, "x": x, "x0": 8.0, "ax": x, "bx": x, "by": 0.2, "told_x": x}
    values |= {"hits": 900, "looks": 900, "both": 400, "own_stance_n": 20, "quality": 1.0, "first": 10.0}
    values |= {"width": 0.1, "far": 0.12}
    values |= {"rest_x": x, "rest_at": NOW, "a_print": 2, "b_print": 3 if both else -1, "suspected": -1e9}
    values |= {"b_seen": NOW, "a_since": NOW - 9.0, "b_since": NOW - 9.0, "a_land": NOW - 9.0, "b_land": NOW - 9.0}
    for name, value in values.items():
        body[name] = value


def stands(one: Tracks, seconds: float, *, learned: bool = True, both: bool = True) -> Iterator[FloorEvent]:
    """What happens while all that is there is seen ten times a second."""
    for scan in range(1, round(10 * seconds) + 1):
        t = NOW + 0.1 * scan
        for body in one.bodies:
            if not body["used"]:
                continue
            body["seen"] = body["a_seen"] = t
            body["hits"], body["looks"], body["due"] = (body[name] + 1 for name in ("hits", "looks", "due"))
            body["score"] += 0.9
            if t > body["b_land"] and (body["confirmed"] == 0 or both):
                body["b_seen"] = t
                body["both"] += 1
        yield from one.review(t, 0.1, OPEN, lambda: 9, lambda body: False, lambda body: False, learned=learned)


@pytest.mark.parametrize(
    ("apart", "landed_s", "fields", "somebody"),
    [
        (0.2, 0.6, {}, True),
        (0.2, 2.0, {}, False),
        (0.05, 0.6, {}, False),
        (0.6, 0.6, {}, False),
        (0.2, 0.6, {"far": 0.5}, False),
        (0.2, 0.6, {"from_furniture": 1}, False),
        (0.2, 0.6, {"score": -30.0}, False),
        (0.2, 0.6, {"b_print": 0}, False),
    ],
    ids=[
        *("two feet", "one, then the other", "one thing", "two things", "something broad", "a piece of furniture"),
        *("unlike feet", "one print"),
    ],
)
def test_two_feet_that_came_together_are_somebody(
    apart: float, landed_s: float, fields: dict[str, float], somebody: bool
) -> None:
    one = Tracks(Association(3, 4), FloorSettings(), Scene())
    feet(one.bodies[0], apart, landed_s)
    for name, value in fields.items():
        one.bodies[name][0] = value
    events = list(stands(one, 5.0))
    assert [type(event) for event in events] == ([Appeared] if somebody else [])
    assert one.bodies["used"][0] == somebody
    if somebody:
        assert events[0].t - NOW > 3.0  # who walks on is told as before


@pytest.mark.parametrize(
    ("x", "both", "somebody"),
    [(4.5, True, True), (4.5, False, False), (5.5, False, True)],
    ids=["all his feet are seen", "one of them may be his", "too far away to be his"],
)
def test_not_if_one_of_them_may_be_the_other_foot_of_somebody_there(x: float, both: bool, somebody: bool) -> None:
    one = Tracks(Association(3, 4), FloorSettings(), Scene())
    feet(one.bodies[0], 0.2, 0.6)
    beside(one.bodies[1], x, both)
    new = [event for event in stands(one, 5.0, both=both) if isinstance(event, Appeared)]
    assert len(new) == somebody


@pytest.mark.parametrize(("ago", "his"), [(1.0, True), (9.0, False)])
def test_who_has_stood_on_one_foot_for_long_stands_where_he_is(ago: float, his: bool) -> None:
    """Who has not has stepped away, and what he seemed to stand on is a thing."""
    one = Tracks(Association(3, 4), FloorSettings(), Scene())
    feet(one.bodies[0], 0.2, 0.6)
    beside(one.bodies[1], 5.2, False)
    one.bodies["b_seen"][1], one.bodies["a_land"][1] = NOW - 2.5, NOW - ago
    (event,) = stands(one, 3.5, both=False)
    assert type(event) is (Moved if his else Appeared)
    assert sorted(label.id for label in one.labels(NOW + 3.5)) == ([1] if his else [1, 9])


@pytest.mark.parametrize(("door_m", "his"), [(3.0, True), (0.5, False)])
def test_who_comes_in_by_a_door_is_not_he_who_stands_on_one_foot(door_m: float, his: bool) -> None:
    """Far from all doors it would be he, and what he seems to stand on a thing."""
    gate = [(4.0 - door_m, -3.0), (3.5 - door_m, -3.0), (3.5 - door_m, 3.0), (4.0 - door_m, 3.0)]
    one = Tracks(Association(3, 4), FloorSettings(), Scene(gates=[gate]))
    feet(one.bodies[0], 0.2, 0.6)
    beside(one.bodies[1], 5.2, False)
    one.bodies["b_seen"][1], one.bodies["a_land"][1] = NOW - 2.5, NOW - 1.0
    (event,) = stands(one, 3.5, both=False)
    assert type(event) is (Moved if his else Appeared)
    assert sorted(label.id for label in one.labels(NOW + 3.5)) == ([1] if his else [1, 9])


def test_not_before_the_room_is_known() -> None:
    one = Tracks(Association(3, 4), FloorSettings(), Scene())
    feet(one.bodies[0], 0.2, 0.6)
    assert list(stands(one, 5.0, learned=False)) == []
