"""What looks like a foot is watched for longer before it is told as a thing."""

from __future__ import annotations

import pytest

from tms_agents.floor import FloorSettings
from tms_agents.floor.events import Appeared
from tms_agents.floor.feet.brightness import expected
from tms_agents.floor.objects.objects import Objects
from tms_agents.floor.objects.patience import patience
from tms_agents.floor.objects.ripening import OBJECT
from tms_agents.floor.state import BODY, PRINT, THING, empty

NOW = 100.0


def wanted(beside: float | None = None, unseen_s: float = 0.0, hidden_foot_s: float = 0.0, **fields: float) -> float:
    """For how long a print in full view is watched, its owner (label 1) or somebody with both feet so far (m) off.

    He was seen so long (s) ago, and one of his feet so long before that.
    """
    prints, bodies = empty(PRINT, 1), empty(BODY, 1)
    values = {"used": 1, "first": NOW - 5.0, "rested": NOW - 5.0, "last": NOW, "width": 0.08, "hits": 50, "whole": 50}
    values |= {"whose": -1, "owned": -1e9, "busy": -1e9}
    for name, value in (values | fields).items():
        prints[name] = value
    if beside is not None:
        for name in ("used", "confirmed", "label"):
            bodies[name] = 1
        for name in ("x", "ax", "bx"):
            bodies[name] = beside
        bodies["seen"] = bodies["a_seen"] = NOW - unseen_s
        bodies["b_seen"] = NOW - unseen_s - hidden_foot_s
        bodies["stale"] = unseen_s > 1.0
        bodies["own"], bodies["own_n"] = 7.0, 500
    return float(patience(prints[0], bodies, NOW, expected()))


def test_what_nobody_stood_on_and_all_of_which_is_seen_is_told_at_once() -> None:
    assert wanted() == 0.0
    assert wanted(0.5, given=1) == 0.0


def test_what_was_never_seen_whole_may_be_a_leg_behind_another() -> None:
    assert wanted(whole=0) > 10.0
    assert wanted(whole=0, mutes=10) == 0.0  # glossy
    assert wanted(0.5, whole=0, given=1) > 10.0


def test_what_a_hand_put_there_is_nobodys_leg_once_nobody_is_near() -> None:
    assert wanted(2.0, whole=0, given=1) == wanted(whole=0, given=1) == 0.0
    assert wanted(0.5, unseen_s=5.0, whole=0, given=1) > 10.0  # he may still be there, hidden


def test_what_a_hand_put_there_is_nobodys_shoe_however_wide_once_nobody_is_near() -> None:
    assert wanted(2.0, width=0.2, given=1) == wanted(width=0.2, given=1) == 0.0
    assert wanted(0.5, unseen_s=5.0, width=0.2, given=1) > 10.0


def test_what_a_hand_put_there_is_nobodys_leg_if_who_is_near_shows_both_elsewhere() -> None:
    assert wanted(0.5, whole=0, given=1, spare=5.0) == 0.0
    assert wanted(0.5, whole=0, given=1, spare=3.0) > 10.0


def test_whose_foot_it_was_has_gone_if_both_his_feet_are_seen_elsewhere() -> None:
    assert wanted(2.0, whole=0, whose=1, owned=NOW - 2.0, busy=NOW - 2.0) == 0.0
    assert wanted(0.5, whole=0, whose=1, owned=NOW - 2.0, busy=NOW - 2.0) > 10.0
    assert wanted(2.0, whole=0, whose=7, owned=NOW - 2.0, busy=NOW - 2.0) > 10.0


def test_whose_foot_it_was_has_gone_also_if_he_is_hidden_there() -> None:
    gone = {"whole": 0, "whose": 1, "owned": NOW - 4.0, "busy": NOW - 4.0}
    assert wanted(2.0, unseen_s=0.7, **gone) == wanted(2.0, unseen_s=3.0, **gone) == 0.0
    assert wanted(0.5, unseen_s=3.0, **gone) > 10.0
    assert wanted(2.0, unseen_s=3.0, hidden_foot_s=0.6, **gone) > 10.0  # this may be the other one


@pytest.mark.parametrize(
    "fields", [{"width": 0.2}, {"owned": NOW}, {"shine": 7.02, "shine_n": 20}], ids=["wide", "his", "as bright"]
)
def test_what_a_hand_put_there_may_be_a_foot_after_all(fields: dict[str, float]) -> None:
    assert wanted(0.5, given=1, **fields) > 10.0


def test_what_is_put_under_somebody_may_be_his_foot() -> None:
    assert wanted(0.2, given=1) > 10.0
    assert wanted(0.2, given=1, shine=9.0, shine_n=20) > 10.0


def test_what_differs_in_brightness_from_who_is_beside_it_is_none_of_his_feet() -> None:
    assert wanted(0.5, given=1, shine=9.0, shine_n=20) == 0.0


def test_what_joins_something_else_is_watched_for_longest() -> None:
    assert wanted(attached=0.4) > wanted(busy=NOW) > 0.0


def test_who_was_there_when_it_came_has_put_it_there_however_late_it_is_told() -> None:
    prints, bodies, objects = empty(PRINT, 1), empty(BODY, 2), Objects(empty(THING, 1), FloorSettings())
    values = {"used": 1, "last": NOW, "rested": NOW - 5.0, "first": NOW - 5.0, "width": 0.08, "hits": 50, "looks": 50}
    values |= {"owner": -1, "whose": -1, "owned": -1e9, "busy": -1e9, "silent": -1e9, "beams": 8, "spacing": 0.01}
    for name, value in values.items():
        prints[name] = value
    bodies["used"] = bodies["confirmed"] = 1
    bodies["label"], bodies["x"] = [3, 4], [0.7, 3.0]
    assert objects.ripe(prints, bodies, NOW, expected()) == []
    bodies["x"] = [3.0, 0.7]
    prints["last"] = NOW + 20.0
    assert objects.ripe(prints, bodies, NOW + 20.0, expected()) == [(0, OBJECT)]
    (told,) = objects.born(0, prints, bodies, lambda: 5, NOW + 20.0)
    assert isinstance(told, Appeared)
    assert [mover for mover, _ in told.candidates] == [3]
    assert objects.waiting == {}
