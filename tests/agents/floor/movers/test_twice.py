"""Who begins to be seen in the middle of a room was there before, and what he seemed to stand on is a thing."""

from __future__ import annotations

import numpy as np
import pytest

from tms_agents.floor.association.association import Association
from tms_agents.floor.events import Appeared, Moved, Stale, Vanished
from tms_agents.floor.movers.tracks import Tracks
from tms_agents.floor.scan.background import BACKGROUND
from tms_agents.floor.settings import FloorSettings, Scene

NOW = 100.0
ROOM = [(0.0, -4.0), (9.0, -4.0), (9.0, 4.0), (0.0, 4.0)]
DOOR = [(8.5, 1.0), (9.5, 1.0), (9.5, 2.0), (8.5, 2.0)]
#: A laser at the origin that looks along x and sees walls 8 m away.
OPEN = (np.full(101, 8.0), np.full(101, BACKGROUND, np.int8), np.full(101, 8.0), np.zeros(3), -0.5, 0.01)


def room(gates: list[list[tuple[float, float]]]) -> Tracks:
    return Tracks(Association(3, 4), FloorSettings(), Scene(region=ROOM, gates=gates))


def at(one: Tracks, t: float) -> list:
    """What happens at t, 0.1 s after the last scan."""
    return one.review(t, 0.1, OPEN, lambda: 9, lambda body: False, lambda body: False, learned=True)


def stander(body: np.void, since: float, **fields: float) -> None:
    """Somebody, known for long, of whom one foot stands at (4, 0) ``since``; the other was seen beside it just then."""
    values = {"used": 1, "confirmed": 1, "label": 1, "seen": NOW, "hits": 900, "both": 400, "own_stance_n": 20}
    values |= {"x": 4.0, "ax": 4.0, "bx": 4.0, "by": 0.3, "told_x": 4.0, "rest_x": 4.0, "rest_at": since}
    values |= {"width": 0.1, "far": 0.12, "quality": 1.0, "first": 10.0, "suspected": -1e9, "x0": 8.0}
    values |= {"own": 7.0, "own_n": 200}
    values |= {"a_seen": NOW, "a_since": since, "a_land": since, "b_seen": since, "b_since": since - 1.0}
    values |= {"b_land": since - 1.0, "a_print": 0, "b_print": -1}
    for name, value in (values | fields).items():
        body[name] = value


def comer(body: np.void, x0: float, y0: float, first: float) -> None:
    """Somebody new who began at (x0, y0) and walks on along x."""
    values = {"used": 1, "label": -1, "x": x0 + 0.8, "y": y0, "x0": x0, "y0": y0, "first": first, "seen": NOW}
    values |= {"ax": x0 + 0.6, "bx": x0 + 1.0, "ay": y0 + 0.1, "by": y0 - 0.1, "a_seen": NOW, "b_seen": NOW}
    values |= {"a_since": NOW - 0.2, "b_since": NOW - 0.2, "a_print": 1, "b_print": 2, "vx": 1.0, "suspected": -1e9}
    values |= {"hits": 20, "looks": 20, "due": 20, "both": 15, "score": 20.0, "quality": 1.0, "width": 0.1}
    for name, value in values.items():
        body[name] = value


def begins(gates: list[list[tuple[float, float]]], x0: float, y0: float, **fields: float) -> Tracks:
    """Somebody new begins at (x0, y0) half a second after one who stands at (4, 0) has put down what is seen there."""
    one = room(gates)
    stander(one.bodies[0], NOW - 1.5, **fields)
    comer(one.bodies[1], x0, y0, NOW - 1.0)
    assert [type(event) for event in at(one, NOW)] == [Appeared]
    return one


@pytest.mark.parametrize(
    ("gates", "x0", "fields", "suspected"),
    [
        ([DOOR], 5.0, {}, True),
        ([], 5.0, {}, False),
        ([DOOR], 7.0, {}, False),
        ([DOOR], 5.0, {"robot": 1, "machine": 1}, False),
        ([DOOR], 5.0, {"robot": 1}, True),
        ([DOOR], 5.0, {"robot": 1, "own_stance_n": 0}, False),
    ],
    ids=["beside him", "no doors known", "too far away", "a robot", "who walked and is wide now", "what never walked"],
)
def test_who_begins_beside_one_who_stands_may_be_he(
    gates: list[list[tuple[float, float]]], x0: float, fields: dict[str, float], suspected: bool
) -> None:
    assert (begins(gates, x0, -0.5, **fields).bodies["suspected"][0] == NOW - 1.0) == suspected


def test_it_is_remembered_whichever_hypothesis_turns_out_to_be_right() -> None:
    one = room([DOOR])
    stander(one.bodies[0], NOW - 1.5)
    comer(one.bodies[1], 5.0, -0.5, NOW - 1.0)
    association = one._association
    association._now.bodies[1], association._count = one.bodies, 2
    at(one, NOW)
    assert association.hypotheses["suspected"][:, 0].tolist() == [NOW - 1.0, NOW - 1.0]


@pytest.mark.parametrize(
    ("landed_s", "others", "his"),
    [(3.0, 1, True), (30.0, 1, False), (30.0, 0, True)],
    ids=["has just come there", "has stood there for long", "nobody else is there"],
)
def test_who_goes_on_from_where_one_stands_is_he_only_if_that_one_came_just_now(
    landed_s: float, others: int, his: bool
) -> None:
    """Who puts something down is off within seconds; and nobody but him walks where he is alone."""
    one = room([DOOR])
    stander(one.bodies[0], NOW - 2.3, a_land=NOW - landed_s)
    stander(one.bodies[2], NOW - 50.0, label=2, x=8.0, ax=8.0, bx=8.0, b_seen=NOW, told_x=8.0, used=others)
    comer(one.bodies[1], 4.3, 0.3, NOW - 2.0)
    assert [type(event) for event in at(one, NOW)] == [Moved if his else Appeared]


@pytest.mark.parametrize(("landed_s", "suspected"), [(15.0, True), (25.0, False)])
def test_nor_may_he_be_who_has_stood_there_for_long(landed_s: float, suspected: bool) -> None:
    one = begins([DOOR], 5.0, -0.5, a_land=NOW - landed_s)
    assert (one.bodies["suspected"][0] == NOW - 1.0) == suspected


def test_who_comes_in_by_a_door_is_not() -> None:
    one = room([[(x - 0.3, y) for x, y in DOOR]])
    stander(one.bodies[0], NOW - 1.5, x=6.6, ax=6.6, bx=6.6, rest_x=6.6, told_x=6.6)
    comer(one.bodies[1], 7.6, 1.0, NOW - 1.0)
    assert [type(event) for event in at(one, NOW)] == [Appeared]
    assert one.bodies["suspected"][0] < 0.0


def later(one: Tracks, seconds: float) -> tuple[list, float]:
    """What happens at last while both stand for so long, or until something does; and when."""
    for scan in range(1, round(10 * seconds) + 1):
        t = NOW + 0.1 * scan
        one.bodies["seen"][:2] = t
        one.bodies["a_seen"][:2] = t
        one.bodies["b_seen"][1] = t
        if events := at(one, t):
            return events, t - NOW
    return [], seconds


def test_the_one_who_stands_is_a_thing_and_the_new_one_has_his_name() -> None:
    one = begins([DOOR], 5.0, -0.5)
    events, after_s = later(one, 5.0)
    assert [(type(event), event.label) for event in events] == [(Vanished, 9), (Moved, 1)]
    assert events[0].into == 1
    assert after_s < 3.0
    (label,) = one.labels(NOW)
    assert (label.id, label.since) == (1, 10.0) and label.xy[0] > 5.0
    assert one.bodies["own"][one.bodies["used"] == 1].tolist() == [7.0]
    assert one.no_feet == [0]


def test_so_is_what_he_pushed_there_which_is_furniture() -> None:
    one = begins([DOOR], 5.0, -0.5, robot=1, wide=0.8, far=0.5, width=0.5, rest_at=NOW - 4.0, both=10)
    events, _ = later(one, 5.0)
    assert [(type(event), event.label) for event in events] == [(Vanished, 9), (Moved, 1)]
    assert events[0].into == 1
    assert (one.no_feet, one.furniture) == ([0], [0])


def test_without_anybody_new_he_stands_there_for_much_longer() -> None:
    one = room([DOOR])
    stander(one.bodies[0], NOW - 1.5)
    assert later(one, 20.0) == ([], 20.0)


def test_who_has_stepped_on_since_is_no_thing() -> None:
    one = begins([DOOR], 5.0, -0.5)
    one.bodies["a_land"][0] = one.bodies["a_since"][0] = NOW - 0.1
    assert later(one, 5.0) == ([], 5.0)


def test_if_the_new_one_has_gone_the_other_is_lost() -> None:
    one = begins([DOOR], 5.0, -0.5)
    one.bodies["used"][1] = 0
    events, _ = later(one, 5.0)
    assert [(type(event), event.label) for event in events] == [(Stale, 1)]
