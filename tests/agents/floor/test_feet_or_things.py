"""What rests may be a thing or somebody's foot: when it is told, when it waits, and whose foot it cannot be."""

from __future__ import annotations

import math

import numpy as np
import pytest
from floor_prints import NOW, resting, shows
from floor_rooms import Room, thing, together, walker

from tms_agents.floor import Appeared, Scene
from tms_agents.floor.feet.brightness import expected
from tms_agents.floor.feet.clutter import costs, known, nobodys
from tms_agents.floor.feet.likelihood import too_wide
from tms_agents.floor.feet.one_foot import UNLIKELY
from tms_agents.floor.feet.prints import attend
from tms_agents.floor.feet.putting import count_feet, set_aside
from tms_agents.floor.objects.patience import brings
from tms_agents.floor.scan.segmentation import CLUSTER
from tms_agents.floor.state import BODY, PRINT, empty


@pytest.mark.parametrize(("off", "counted"), [(0.3, 1.0), (0.17, 0.25), (0.1, 0.0)])
def test_what_lies_close_to_one_of_two_feet_is_told_from_it_later_and_what_touches_it_never(
    off: float, counted: float
) -> None:
    prints, bodies = resting(5.0), empty(BODY, 1)
    bodies["used"] = bodies["confirmed"] = 1
    bodies["a_print"], bodies["b_print"], bodies["a_seen"], bodies["b_seen"] = 1, 2, NOW, NOW
    bodies["ax"], bodies["bx"] = prints["x"] - off, prints["x"] - off - 0.2
    bodies["x"], bodies["y"] = prints["x"] - off - 0.1, prints["y"]
    bodies["ay"] = bodies["by"] = prints["y"]
    count_feet(prints, bodies, NOW, 1.0)
    assert prints["spare"][0] == pytest.approx(counted)


@pytest.mark.parametrize(
    ("fields", "known"),
    [
        ({}, True),
        ({"first": NOW - 20.0}, False),  # he was there long before it
        ({"x0": 1.5}, False),  # he began somewhere else
        ({"confirmed": 0}, False),
        ({"robot": 1}, False),
    ],
)
def test_who_began_beside_what_came_to_rest_may_have_brought_it_in(fields: dict[str, float], known: bool) -> None:
    bodies = empty(BODY, 1)
    bodies["used"] = bodies["confirmed"] = 1
    bodies["first"], bodies["x0"] = NOW - 9.0, 0.5
    for name, value in fields.items():
        bodies[name] = value
    assert brings(resting(10.0)[0], bodies) == known


@pytest.mark.parametrize(("busy", "known"), [(-9.0, True), (-10.5, True), (-12.0, False)])
def test_who_was_beside_it_when_it_came_to_rest_or_just_before_may_have_brought_it(busy: float, known: bool) -> None:
    """A part of it was seen while he hid the rest: it seemed to come to rest when he had gone."""
    assert brings(resting(10.0, busy=NOW + busy)[0], empty(BODY, 1)) == known


@pytest.mark.parametrize(
    ("width", "idle", "off", "foot"),
    [
        (0.02, 8.0, 0.04, False),
        (0.02, 8.0, 0.12, True),  # not at its edge
        (0.12, 8.0, 0.04, True),  # no speck
        (0.02, 4.0, 0.04, True),  # somebody has stood there for half of the time
        (0.02, 2.0, 0.04, True),
    ],
)
def test_what_flickers_at_the_edge_of_a_thing_is_no_foot(width: float, idle: float, off: float, foot: bool) -> None:
    prints, clusters = (
        np.concatenate([resting(10.0, width=0.06, idle=idle), resting(0.2, width=width)]),
        np.zeros(1, CLUSTER),
    )
    prints["x"][1] = clusters["x"] = off
    clusters["width"], clusters["n"], clusters["cut"] = width, 2, 1
    assert set_aside(clusters, np.ones(1, np.int64), prints, empty(BODY, 1), 0.3, NOW) == foot


def crowd(**other: float) -> tuple[np.ndarray, np.ndarray]:
    """Bodies: who stands on both feet 0.35 m from something new, and somebody else; prints, the new one last."""
    prints = np.concatenate([*(resting(2.0) for _ in range(4)), resting(0.0)])
    bodies = empty(BODY, 2)
    bodies["used"] = bodies["confirmed"] = 1
    bodies["x"], bodies["a_print"], bodies["b_print"] = [0.35, -0.9], [0, 2], [1, 3]
    bodies["a_seen"] = bodies["b_seen"] = bodies["seen"] = NOW
    bodies["ax"] = bodies["bx"] = bodies["x"]
    bodies["ay"], bodies["by"] = 0.1, -0.1
    for name, value in other.items():
        bodies[name][1] = value
    return bodies, prints


@pytest.mark.parametrize(
    ("other", "given"),
    [
        ({}, 1),  # who stands on two feet out of reach has not put it there, and not stepped there
        ({"b_print": 2}, 0),  # who shows one foot alone may have stepped there
        ({"confirmed": 0, "x": 0.0, "a_print": 4, "b_print": -1}, 1),  # it was taken for somebody new, and nothing else
        ({"confirmed": 0, "x": 0.0, "a_print": 4, "b_print": 3}, 0),
    ],
)
def test_what_appears_beside_who_stands_on_both_feet_was_put_there(other: dict[str, float], given: int) -> None:
    bodies, prints = crowd(**other)
    prints["owner"][:4] = 0
    clusters = np.zeros(1, CLUSTER)
    clusters["width"], clusters["n"] = 0.1, 8
    set_aside(clusters, np.full(1, 4, np.int64), prints, bodies, 0.3, NOW)
    assert prints["given"][4] == given


@pytest.mark.parametrize(
    ("ago_s", "away", "before", "width", "shoe", "given"),
    [
        (0.7, 0.6, 0.2, 0.1, 1.0, 0),
        (2.0, 0.6, 0.2, 0.1, 1.0, 1),  # the next step comes sooner
        (0.7, 0.15, 0.2, 0.1, 1.0, 1),  # and is longer
        (0.7, 1.4, 0.2, 0.1, 1.0, 1),  # but not so long
        (0.7, 0.6, 0.05, 0.1, 1.0, 1),  # what came before is too slim for a foot
        (0.7, 0.6, 0.2, 0.01, 1.0, 1),  # or what comes now
        (0.7, 0.6, 0.2, 0.1, 0.0, 1),  # legs are seen between two steps
    ],
)
def test_two_steps_past_who_stands_are_nothing_that_he_has_put_down(
    ago_s: float, away: float, before: float, width: float, shoe: float, given: int
) -> None:
    """Whoever comes in unseen behind somebody who stands was two things beside him."""
    bodies, prints = crowd()
    bodies["shoe"] = shoe
    prints["owner"][:4] = 0
    first = resting(ago_s, width=before, given=1, whole=8, hits=8)
    first["x"] = -away
    prints = np.concatenate([prints, first])
    prints["whose"] = [1, 1, 2, 2, -1, -1]
    clusters = np.zeros(1, CLUSTER)
    clusters["width"], clusters["n"] = width, 8
    set_aside(clusters, np.full(1, 4, np.int64), prints, bodies, 0.3, NOW)
    assert prints["given"][4] == prints["given"][5] == given


@pytest.mark.parametrize(("b_print", "counted"), [(-1, 1.0), (3, 0.0)])
def test_somebody_new_who_is_only_what_lies_there_is_no_reason_to_wait(b_print: int, counted: float) -> None:
    bodies, prints = crowd(confirmed=0, x=0.0, a_print=4, b_print=b_print)
    prints["owner"][:4] = 0
    prints["first"][4] = NOW - 1.0
    count_feet(prints, bodies, NOW, 1.0)
    assert prints["spare"][4] == pytest.approx(counted)


@pytest.mark.parametrize(("away", "counted"), [(0.8, 1.0), (0.4, 0.0)])
def test_a_robot_beside_what_lies_there_is_no_reason_to_wait(away: float, counted: float) -> None:
    """Unless it is so near that it may be a part of it."""
    bodies, prints = crowd(robot=1, machine=1, x=-away, far=0.6)
    prints["owner"][:4] = 0
    prints["first"][4] = NOW - 1.0
    count_feet(prints, bodies, NOW, 1.0)
    assert prints["spare"][4] == pytest.approx(counted)


@pytest.mark.parametrize(("lay_s", "one_foot_s", "counted"), [(5.0, 0.2, 1.0), (3.5, 0.2, 0.0), (5.0, 1.0, 0.0)])
def test_who_showed_both_feet_beside_it_before_he_was_hidden_has_not_stepped_on_it(
    lay_s: float, one_foot_s: float, counted: float
) -> None:
    bodies, prints = crowd(stale=1, seen=NOW - 3.0, a_seen=NOW - 3.0, b_seen=NOW - 3.0 - one_foot_s)
    prints["owner"][:4] = 0
    prints["first"][4] = NOW - lay_s
    count_feet(prints, bodies, NOW, 1.0)
    assert prints["spare"][4] == pytest.approx(counted)


@pytest.mark.parametrize(("away", "may_step"), [(0.7, True), (1.6, False)])
def test_nobody_begins_by_a_step_that_is_too_long(away: float, may_step: bool) -> None:
    """Two things put down soon after each other are nobody who goes from one to the other."""
    bodies, prints, clusters = empty(BODY, 1), empty(PRINT, 1), np.zeros(1, CLUSTER)
    bodies["used"], bodies["first"], bodies["seen"], bodies["a_seen"], bodies["pp"] = 1, NOW - 0.6, NOW - 0.3, NOW, 0.25
    bodies["a_print"] = bodies["b_print"] = -1
    bodies["b_seen"] = -1e9
    prints["used"], prints["first"], prints["rested"], prints["last"] = 1, NOW - 0.1, NOW - 0.1, NOW
    clusters["x"], clusters["n"], clusters["width"], clusters["spacing"] = away, 6, 0.1, 0.015
    cost = np.zeros((1, 3))
    costs(shows(clusters, prints, print_=0), np.ones(1, np.bool_), bodies, np.zeros(1, np.int64), cost)
    assert bool(cost[0, :2].min() < UNLIKELY) == may_step


def test_what_was_his_foot_a_moment_ago_may_be_again() -> None:
    """A speck beside it was taken for the foot in one scan; what stood there all the time is no stranger's."""
    bodies, prints, clusters = empty(BODY, 1), empty(PRINT, 2), np.zeros(1, CLUSTER)
    bodies["used"] = bodies["confirmed"] = bodies["b_print"] = 1
    bodies["label"], bodies["a_print"], bodies["pp"] = 3, -1, 0.01
    bodies["seen"], bodies["b_seen"], bodies["a_seen"] = NOW - 0.1, NOW - 0.1, NOW - 5.0
    prints["used"], prints["owner"], prints["whose"], prints["owned"] = 1, -1, -1, -1e9
    prints["first"], prints["last"], prints["hits"] = NOW - 4.0, NOW, 40
    clusters["x"], clusters["n"], clusters["width"], clusters["spacing"] = 0.06, 12, 0.12, 0.01
    one, cost = np.zeros(1, np.int64), np.zeros((2, 1, 3))
    for label, each in zip((7, 3), cost, strict=True):
        prints["whose"], prints["owned"] = label, NOW - 0.1
        costs(shows(clusters, prints, print_=0), np.ones(1, np.bool_), bodies, one, each)
    assert cost[1, 0, 0] < cost[0, 0, 0] - 1.0


@pytest.mark.parametrize(
    ("fields", "price"),
    [
        ({}, 5.0),
        ({"a_land": NOW - 2.5}, 2.0),  # it is long ago
        ({"b_land": NOW - 2.0}, 2.0),  # he was walking
        ({"a_ox": 1.1}, 2.0),  # stood elsewhere
        ({"robot": 1}, 2.0),
    ],
)
def test_who_stood_has_not_stepped_off_what_is_still_there(fields: dict[str, float], price: float) -> None:
    """That would cost more than that somebody else has stepped there."""
    prints, clusters, cost = resting(30.0), np.zeros(1, CLUSTER), np.zeros((1, 1))
    bodies, one = empty(BODY, 1), np.zeros(1, np.int64)
    bodies["used"] = bodies["confirmed"] = 1
    bodies["a_print"] = bodies["b_print"] = -1
    bodies["a_land"], bodies["b_land"], bodies["a_ox"], bodies["b_ox"] = NOW - 0.1, NOW - 30.0, 1.0, 1e9
    for name, value in fields.items():
        bodies[name] = value
    clusters["x"], clusters["n"], clusters["width"], clusters["spacing"] = 1.0, 12, 0.12, 0.01
    nobodys(shows(clusters, prints, print_=0), bodies, one, np.array([np.inf]), cost)
    assert cost[0, 0] == pytest.approx(price)


def test_what_is_left_in_a_door_is_told_when_who_left_it_is_elsewhere() -> None:
    """He puts it at his feet, so that it might be one of them, and goes on into the room."""
    door = [(3.9, 1.0), (5.0, 1.0), (5.0, 3.0), (3.9, 3.0)]
    scene = Scene(region=[(0, 0), (5, 0), (5, 4), (0, 4)], gates=[door])
    comes = walker([(9.0, 4.9, 2.0), (10.0, 4.2, 2.0), (12.0, 4.2, 2.0), (15.0, 1.5, 2.0), (30.0, 1.5, 2.0)])
    _, events = Room(together(comes, thing(4.0, 2.05, 0.05, 10.6))).play(26.0, scene=scene)
    (put,) = [event for event in events if isinstance(event, Appeared) and event.kind == "object"]
    assert put.t < 20.0
    assert math.dist(put.xy, (4.0, 2.05)) < 0.03


def test_what_lies_in_a_door_is_told_as_soon_though_somebody_hides_it_meanwhile() -> None:
    door = [(3.9, 1.0), (5.0, 1.0), (5.0, 3.0), (3.9, 3.0)]
    scene = Scene(region=[(0, 0), (5, 0), (5, 4), (0, 4)], gates=[door])
    stays = [(7.0, 4.9, 2.6), (10.0, 2.2, 2.6), (20.0, 2.2, 2.6)]
    hides = [(22.0, 2.2, 0.87), (24.0, 2.2, 0.87), (25.0, 2.2, 1.6), (60.0, 2.2, 1.6)]
    _, events = Room(together(walker(stays + hides), thing(4.4, 1.5, 0.05, 12.0))).play(45.0, scene=scene)
    (put,) = [event for event in events if isinstance(event, Appeared) and event.kind == "object"]
    assert put.t == pytest.approx(37.0, abs=0.5)


@pytest.mark.parametrize(("width", "apart", "dearer"), [(0.2, True, 2.0), (0.33, True, 4.0), (0.2, False, 0.0)])
def test_a_foot_as_wide_as_two_legs_is_none_if_the_other_leg_is_seen_somewhere_else(
    width: float, apart: bool, dearer: float
) -> None:
    """Who pushes a bin walks on two legs beside it."""
    found = []
    for seen in (0, 400):
        bodies, prints, clusters = empty(BODY, 1), empty(PRINT, 1), np.zeros(1, CLUSTER)
        bodies["used"] = bodies["confirmed"] = 1
        bodies["hits"], bodies["looks"], bodies["seen"], bodies["pp"] = 100, 100, 9.9, 0.01
        bodies["ax"], bodies["a_seen"], bodies["a_print"] = 0.2, 9.9, -1
        bodies["bx"], bodies["b_seen"], bodies["b_print"] = (-0.2 if apart else 0.2), 9.9, -1
        bodies["own_leg_width"], bodies["own_leg_width_n"] = 0.11, seen
        clusters["x"], clusters["n"], clusters["width"], clusters["spacing"] = 0.2, 20, width, 0.01
        cost = np.zeros((1, 3))
        costs(shows(clusters, prints, 10.0), np.ones(1, np.bool_), bodies, np.zeros(1, np.int64), cost)
        found.append(cost[0, 0])
    assert found[1] - found[0] == pytest.approx(dearer)


@pytest.mark.parametrize(("length", "dearer"), [(0.29, 0.0), (0.35, 4.0)])
def test_no_shoe_is_longer_than_any(length: float, dearer: float) -> None:
    body, cluster = empty(BODY, 1)[0], np.zeros(1, CLUSTER)[0]
    body["shoe"], body["own_shoe_length"], body["own_shoe_length_n"] = 1.0, 0.27, 50
    cluster["width"] = length
    assert too_wide(body, cluster) == dearer


@pytest.mark.parametrize(("drove_s", "busy"), [(2.0, False), (0.5, True), (-1.0, True)])
def test_what_lies_still_while_a_robot_drives_past_is_no_part_of_it(drove_s: float, busy: bool) -> None:
    """The robot has been at rest for two seconds, and drove until so long after the print was there first."""
    prints, bodies = resting(2.0 + drove_s), empty(BODY, 1)
    bodies["used"] = bodies["confirmed"] = bodies["robot"] = bodies["machine"] = 1
    bodies["a_print"] = bodies["b_print"] = -1
    bodies["x"], bodies["far"], bodies["rest_at"] = prints["x"] + 0.5, 0.5, prints["first"] + drove_s
    attend(prints, bodies, NOW, 0.1, expected(), np.zeros(2))
    assert bool(prints["busy"][0] == NOW) == busy


def test_what_is_too_thin_for_a_foot_costs_less_to_be_nobodys() -> None:
    cost = np.zeros((3, 1, 1))
    clusters = np.zeros(1, CLUSTER)
    clusters["n"], clusters["spacing"], clusters["mirror"] = 8, 0.01, -1
    shapes: list[dict[str, float]] = [{"width": 0.1}, {"width": 0.06}, {"width": 0.06, "whole": 3}]
    for each, shape in zip(cost, shapes, strict=True):
        clusters["width"] = shape["width"]
        scan = shows(clusters, resting(3.0, **shape), print_=0)
        nobodys(scan, empty(BODY, 1), np.zeros(0, np.int64), np.array([np.inf]), each)
    wide, thin, in_part = cost[:, 0, 0]
    assert thin < wide - 1.0
    assert in_part == wide


@pytest.mark.parametrize(("pushed", "price"), [(1, 5.0), (0, 11.0)])
def test_what_is_pushed_goes_on_beside_who_pushes_it(pushed: int, price: float) -> None:
    """The feet of somebody else would not be so near."""
    bodies, clusters = empty(BODY, 2), np.zeros(1, CLUSTER)
    bodies["used"], bodies["seen"] = 1, 9.9
    bodies["confirmed"], bodies["x"] = (1, 0), (0.4, 0.0)
    bodies["from_furniture"] = (0, pushed)
    clusters["width"] = 0.3
    cost = np.full((1, 1), 11.0)
    known(shows(clusters, empty(PRINT, 1), 10.0), bodies, cost)
    assert cost[0, 0] == price
