"""Feet and things that were taken for each other: what tells them apart later, and what no longer misleads."""

from __future__ import annotations

import numpy as np
import pytest
from floor_rooms import Circle, Room

from tms_agents.floor import Appeared
from tms_agents.floor.feet.bodies import stuck
from tms_agents.floor.feet.brightness import expected
from tms_agents.floor.feet.build import SHOD, legs
from tms_agents.floor.feet.prints import ALONE, UNLIKE, attend, follow, lay_before
from tms_agents.floor.movers.review import LOST, Waits, review
from tms_agents.floor.objects.objects import Objects
from tms_agents.floor.objects.ripening import OBJECT
from tms_agents.floor.scan.background import BACKGROUND, FOREGROUND
from tms_agents.floor.scan.segmentation import CLUSTER
from tms_agents.floor.settings import FloorSettings
from tms_agents.floor.state import BODY, PRINT, THING, empty

NOW = 100.0
WAITS = Waits(confirm_s=0.35, confirm_m=0.25, leave_s=1.5, hidden_s=60.0, stale_s=1.0)
#: All is seen as far as the wall; nothing is seen behind what is new.
OPEN = (np.full(41, 5.0), np.full(41, BACKGROUND, np.int8), np.full(41, 5.0), np.zeros(3), -1.0, 0.05)
COVERED = (np.full(3, 0.5), np.full(3, FOREGROUND, np.int8), np.full(3, 5.0), np.zeros(3), -0.05, 0.05)


def test_what_goes_by_itself_was_a_foot() -> None:
    """Somebody nobody saw come stands there, is taken for two things, and shifts his feet."""

    def feet(t: float) -> list[Circle]:
        if t < 12.0:
            return []
        one = (2.2, 2.0, 0.05) if t < 45.0 else (2.3, 2.12, 0.05)
        other = (2.3, 2.35, 0.05) if t < 46.0 else (2.2, 2.42, 0.05)
        return [one, other]

    estimator, before = Room(feet).play(44.0)
    assert {event.kind for event in before if isinstance(event, Appeared)} == {"object"}
    estimator, events = Room(feet).play(55.0, estimator, start=44.0)
    assert [event.kind for event in events if isinstance(event, Appeared)] == ["mover"]
    assert [one.kind for one in estimator.labels() if not one.stale] == ["mover"]


@pytest.mark.parametrize(("ago", "where"), [(0.1, None), (0.4, (3.4, 1.8, NOW - 0.4))])
def test_who_has_gone_on_from_what_he_put_down_left_with_the_foot_that_is_gone(
    ago: float, where: tuple[float, float, float] | None
) -> None:
    (body,) = empty(BODY, 1)
    body["ax"], body["ay"], body["a_seen"], body["a_since"] = 3.4, 1.8, NOW - ago, NOW - 5.0
    body["b_seen"], body["b_since"] = NOW, NOW - 2.0
    found = stuck(body, NOW)
    assert found == (None if where is None else pytest.approx(where))


def seen(prints: np.ndarray, t: float, beams: int, cut: int = 0) -> None:
    clusters = np.zeros(1, CLUSTER)
    clusters["x"], clusters["width"], clusters["near"], clusters["n"] = 1.0, 0.005 * beams, 1.0, beams
    clusters["spacing"], clusters["mirror"], clusters["cut"] = 0.005, -1, cut
    follow(clusters, np.zeros(1, np.int64), prints, 0, t, COVERED)


@pytest.mark.parametrize(("beams", "cut", "idle"), [(20, 0, 0.0), (20, 1, 3.0), (2, 0, 3.0)])
def test_a_shoe_that_comes_where_a_speck_was_has_not_been_there(beams: int, cut: int, idle: float) -> None:
    prints = empty(PRINT, 1)
    for k in range(40):
        seen(prints, 0.1 * k, 1)
    prints["idle"] = 3.0
    seen(prints, 4.0, beams, cut)
    assert prints["idle"][0] == idle


def lost(since: float) -> tuple[np.ndarray, np.ndarray]:
    """Somebody who was found 20 s ago to stand nowhere, and what has been half in view again for 5 s where he was."""
    bodies, prints = empty(BODY, 1), empty(PRINT, 1)
    bodies["used"] = bodies["confirmed"] = bodies["stale"] = 1
    bodies["seen"], bodies["a_seen"], bodies["b_seen"] = NOW - 20.0, -1e9, -1e9
    values = {"used": 1, "first": NOW - 5.0, "rested": NOW - since, "last": NOW, "width": 0.08, "owner": -1}
    values |= {"hits": 80, "looks": 80, "whole": 10, "beams": 8, "spacing": 0.01, "whose": -1}
    values |= {"owned": -1e9, "busy": -1e9, "silent": -1e9}
    for name, value in values.items():
        prints[name] = value
    return bodies, prints


@pytest.mark.parametrize(("since", "thing"), [(40.0, True), (15.0, False)])
def test_what_was_there_when_somebody_was_found_to_be_nowhere_is_no_foot_of_his(since: float, thing: bool) -> None:
    bodies, prints = lost(since)
    assert lay_before(prints[0], bodies[0]) == thing
    told = Objects(empty(THING, 1), FloorSettings()).ripe(prints, bodies, NOW, expected())
    assert told == ([(0, OBJECT)] if thing else [])


def found(bodies: np.ndarray, seconds: float, view: tuple = OPEN) -> list[int]:
    """What `review` finds while the first foot alone goes on being seen."""
    actions = np.zeros(1, np.int64)
    said = []
    for k in range(round(10 * seconds)):
        bodies["seen"] = bodies["a_seen"] = t = NOW + 0.1 * k
        review(bodies, t, 0.1, view, WAITS, actions, False, True, False)
        said.append(int(actions[0]))
    return said


def standing(x: float, other_x: float, *, shoe: float = 0.0) -> np.ndarray:
    """Somebody known who stands with one foot at x, seen, since a second ago, the other seen last at ``other_x``.

    He was out of sight for two seconds before.
    """
    bodies = empty(BODY, 1)
    bodies["used"] = bodies["confirmed"] = 1
    bodies["own_stance_n"], bodies["both"], bodies["hits"], bodies["quality"] = 5, 200, 500, 1.0
    bodies["x"], bodies["ax"], bodies["told_x"], bodies["bx"], bodies["shoe"] = x, x, x, other_x, shoe
    bodies["a_land"] = bodies["a_since"] = NOW - 1.0
    bodies["b_land"], bodies["b_seen"] = NOW - 4.0, NOW - 3.0
    return bodies


@pytest.mark.parametrize(("other_x", "lost"), [(2.55, False), (3.2, True)])
def test_nobody_left_a_foot_further_behind_than_a_stride(other_x: float, lost: bool) -> None:
    """Where the other foot was seen last is hidden: it may still be there, if that is not too far off."""
    assert (LOST in found(standing(2.0, other_x), 14.0, COVERED)) == lost


@pytest.mark.parametrize(
    ("paces", "both", "way", "shoe", "lost"),
    [
        (5, 8, 0.0, 1.0, False),  # who walks has both shoes on the floor now and then only
        (5, 8, 0.0, 0.0, True),  # both legs are seen all the time
        (0, 20, 1.0, 0.0, False),  # too few steps to count, but he came from somewhere on two feet
        (0, 20, 0.2, 0.0, True),  # two things may be seen at once where they are
        (0, 4, 1.0, 0.0, True),  # what was pushed came from somewhere, too
    ],
)
def test_who_came_on_two_feet_may_stand_with_one_behind_the_other(
    paces: int, both: int, way: float, shoe: float, lost: bool
) -> None:
    bodies = standing(2.0, 2.1, shoe=shoe)
    bodies["own_stance_n"], bodies["both"] = paces, both
    bodies["x0"], bodies["rest_x"] = 2.0 + way, 2.0
    assert (LOST in found(bodies, 14.0)) == lost


@pytest.mark.parametrize(
    ("since", "shoe", "lost"), [(40, 0.0, False), (10, 0.0, True), (10, 1.0, False), (2, 1.0, True)]
)
def test_who_was_found_to_be_nowhere_shows_two_feet_before_one_hides_the_other(
    since: int, shoe: float, lost: bool
) -> None:
    """Not everything that is put down is the one foot that is seen of him."""
    bodies = standing(2.0, 2.1, shoe=shoe)
    bodies["doubted"] = bodies["both"] - since
    assert (LOST in found(bodies, 14.0)) == lost


@pytest.mark.parametrize(("shoe", "seconds", "lost"), [(1.0, 50.0, False), (1.0, 80.0, True), (0.0, 80.0, False)])
def test_one_shoe_does_not_hide_behind_the_other_for_long(shoe: float, seconds: float, lost: bool) -> None:
    assert (LOST in found(standing(2.0, 2.2, shoe=shoe), seconds)) == lost


@pytest.mark.parametrize(("shine", "alone", "odd"), [(7.0, 90.0, 0), (8.0, 90.0, 1), (8.0, 20.0, 0)])
def test_what_alone_is_seen_of_somebody_must_be_as_bright_as_his_feet(shine: float, alone: float, odd: int) -> None:
    bodies, prints = standing(2.0, 2.2), empty(PRINT, 1)
    bodies["a_seen"], bodies["b_seen"], bodies["b_print"] = NOW, NOW - alone, -1
    bodies["own"], bodies["own_n"] = 7.0, 500
    values = {"used": 1, "first": NOW - alone, "last": NOW, "width": 0.1, "hits": 300, "shine": shine, "shine_n": 40}
    for name, value in values.items():
        prints[name] = value
    attend(prints, bodies, NOW, 0.1, expected(), legs())
    assert bodies["odd"][0] == odd


@pytest.mark.parametrize(
    ("width", "alone", "whole", "shoes", "odd"),
    [
        *((0.12, 8.0, 80, 0.6, ALONE), (0.25, 8.0, 80, 0.6, 0), (0.12, 4.0, 80, 0.6, 0), (0.12, 8.0, 10, 0.6, 0)),
        (0.12, 8.0, 80, 0.5 * SHOD, 0),
    ],
)
def test_a_shoe_seen_from_its_tip_does_not_hide_the_other(
    width: float, alone: float, whole: int, shoes: float, odd: int
) -> None:
    """Of one that is mostly seen in part nobody knows whether it is seen from its tip."""
    bodies, prints = standing(2.0, 2.2), empty(PRINT, 1)
    bodies["a_seen"], bodies["b_seen"], bodies["b_print"] = NOW, NOW - alone, -1
    values = {"used": 1, "first": NOW - 1.0, "rested": NOW - alone, "last": NOW, "width": width, "hits": 80}
    for name, value in (values | {"whole": whole}).items():
        prints[name] = value
    attend(prints, bodies, NOW, 0.1, expected(), np.array([shoes, 500.0]))
    assert bodies["odd"][0] == odd


@pytest.mark.parametrize(("odd", "lost"), [(0, False), (UNLIKE, False), (ALONE, True)])
def test_who_would_stand_on_one_shoe_is_somewhere_else(odd: int, lost: bool) -> None:
    """Also where the other shoe was seen last is behind it, which hides it only if it is wide."""
    bodies = standing(2.0, 2.2)
    bodies["odd"] = odd
    assert (LOST in found(bodies, 8.0, COVERED)) == lost


@pytest.mark.parametrize(
    ("apart", "odd", "lost"),
    [
        (0.06, 0, True),
        (0.12, 0, False),
        (0.06, UNLIKE, False),  # as wide as both legs
    ],
)
def test_two_feet_at_one_place_are_one_thing(apart: float, odd: int, lost: bool) -> None:
    """Now this part of a box is met, now that, and each is taken for a foot."""
    bodies = standing(2.0, 2.0 + apart)
    bodies["odd"], bodies["b_print"] = odd, 1
    bodies["own_stance_n"] = 0
    actions = np.zeros(1, np.int64)
    said = []
    for k in range(60):
        bodies["seen"] = t = NOW + 0.1 * k
        bodies["a_seen" if k % 2 else "b_seen"] = t
        review(bodies, t, 0.1, OPEN, WAITS, actions, False, True, False)
        said.append(int(actions[0]))
    assert (LOST in said) == lost


@pytest.mark.parametrize(("stood", "lost"), [(60.0, False), (5.0, True)])
def test_who_has_stood_for_long_has_not_stepped_to_where_somebody_passes(stood: float, lost: bool) -> None:
    """His other foot, behind the first, seems to be half a metre away for a moment."""
    bodies = standing(2.0, 2.55)
    bodies["a_land"], bodies["a_since"] = NOW - stood, NOW - 1.0
    bodies["b_land"], bodies["b_seen"] = NOW - 2.9, NOW - 2.8
    assert (LOST in found(bodies, 8.0)) == lost


@pytest.mark.parametrize(("owned", "since", "thing"), [(30.0, 4.0, False), (30.0, 9.0, True), (2.0, 4.0, True)])
def test_where_somebody_stood_for_long_he_is_waited_for(owned: float, since: float, thing: bool) -> None:
    prints, bodies = empty(PRINT, 1), empty(BODY, 1)
    values = {"used": 1, "first": NOW - owned - since, "rested": NOW - owned - since, "last": NOW, "width": 0.08}
    values |= {"owner": -1, "whose": 1, "owned": NOW - since, "busy": NOW - since, "silent": -1e9}
    values |= {"hits": 900, "looks": 900, "whole": 900, "beams": 8, "spacing": 0.01}
    for name, value in values.items():
        prints[name] = value
    told = Objects(empty(THING, 1), FloorSettings()).ripe(prints, bodies, NOW, expected())
    assert told == ([(0, OBJECT)] if thing else [])
