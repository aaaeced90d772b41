"""Furniture that somebody pushes is nobody, neither as it goes nor where it is left, and he keeps his name."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from tms_agents.floor.association.association import Association
from tms_agents.floor.events import Appeared, Back, FloorEvent, Moved, Stale, Vanished
from tms_agents.floor.feet.build import only_legs
from tms_agents.floor.movers.tracks import Tracks
from tms_agents.floor.scan.background import BACKGROUND
from tms_agents.floor.scan.furniture import Furniture, Piece
from tms_agents.floor.settings import FloorSettings, Scene

NOW = 100.0
ROOM = [(0.0, -4.0), (9.0, -4.0), (9.0, 4.0), (0.0, 4.0)]
DOOR = [(8.2, 1.0), (9.5, 1.0), (9.5, 2.0), (8.2, 2.0)]
#: A laser at the origin that looks along x and sees walls 8 m away.
OPEN = (np.full(101, 8.0), np.full(101, BACKGROUND, np.int8), np.full(101, 8.0), np.zeros(3), -0.5, 0.01)


def room() -> Tracks:
    return Tracks(Association(3, 4), FloorSettings(), Scene(region=ROOM, gates=[DOOR]))


def fill(body: Any, **values: float) -> None:
    for name, value in values.items():
        body[name] = value


def somebody(body: Any, x: float, y: float, **fields: float) -> None:
    """Somebody known for long who walks at (x, y)."""
    seen = {"label": 1, "seen": NOW, "a_seen": NOW, "b_seen": NOW, "first": 10.0, "told_x": x, "told_y": y}
    feet = {"ax": x, "ay": y, "bx": x, "by": y + 0.2, "a_print": 2, "b_print": 3, "a_since": NOW, "b_since": NOW}
    known = {"hits": 900, "looks": 900, "both": 400, "own_stance_n": 20, "quality": 1.0, "x0": 8.0}
    rests = {"rest_x": x, "rest_y": y, "rest_at": NOW, "suspected": -1e9}
    legs = {"width": 0.1, "far": 0.12}
    fill(body, used=1, confirmed=1, x=x, y=y, **(seen | feet | known | legs | rests | fields))


def pushed(far: float, beside_m: float, **fields: float) -> Tracks:
    """Something so broad (m) that began at (4, 0) goes along x, for a second, with somebody so far (m) beside it."""
    one = room()
    somebody(one.bodies[0], 4.0, beside_m)
    body = one.bodies[1]
    fill(body, used=1, label=-1, x0=4.0, x=4.0, first=NOW, rest_x=4.0, rest_at=NOW, far=far, width=far, vx=0.5)
    fill(body, a_print=0, b_print=-1, b_seen=-1e9, quality=1.0, suspected=-1e9, **fields)
    if "x" in fields:
        one.bodies["x"][0], one.bodies["y"][0] = fields["x"], fields["y"] + beside_m
    return one


def goes(one: Tracks, legs: bool) -> list[FloorEvent]:
    """What is told of it in three seconds."""
    events: list[FloorEvent] = []
    for scan in range(1, 31):
        t = NOW + 0.1 * scan
        for body in one.bodies[:2]:
            body["seen"] = body["a_seen"] = t
            body["x"] += 0.05
            body["ax"], body["a_since"] = body["x"], t
            body["hits"], body["looks"], body["due"] = (body[name] + 1 for name in ("hits", "looks", "due"))
            body["score"] += 1.0
        one.bodies["b_seen"][0] = t
        events += one.review(t, 0.1, OPEN, lambda: 9, lambda _: False, lambda _: False, learned=True, legs=legs)
    return [event for event in events if isinstance(event, Appeared | Back)]


@pytest.mark.parametrize(
    ("far", "beside_m", "legs", "fields", "believed"),
    [
        (0.3, 0.7, True, {}, False),
        (0.3, 0.7, False, {}, True),
        (0.34, 0.7, False, {}, False),
        (0.15, 0.7, True, {}, True),
        (0.3, 3.0, True, {}, True),
        (0.3, 0.7, True, {"x0": 7.6, "x": 7.6, "y0": 1.5, "y": 1.5}, True),
        (0.3, 0.7, True, {"footprint": 1}, True),
    ],
    ids=[
        *("pushed", "it may be a shoe", "broader than a shoe", "a leg", "by itself", "came in by the door"),
        "a robot whose outline is known",
    ],
)
def test_what_goes_beside_somebody_and_is_broader_than_feet_is_nobody(
    far: float, beside_m: float, legs: bool, fields: dict[str, float], believed: bool
) -> None:
    one = pushed(far, beside_m, **fields)
    assert bool(goes(one, legs)) == believed


def test_who_goes_on_by_himself_is_believed_then() -> None:
    one = pushed(0.3, 0.7)
    assert not goes(one, legs=True)
    one.bodies["y"][0] = 3.5
    assert goes(one, legs=True)


def test_a_robot_that_was_lost_there_is_found_beside_somebody() -> None:
    one = pushed(0.6, 0.7)
    somebody(one.bodies[2], 4.0, 0.0, label=3, robot=1, stale=1, seen=NOW - 2.0)
    one._told.agree([Stale(NOW - 1.0, 3)], one.bodies, NOW - 1.0)
    (event,) = goes(one, legs=True)
    assert isinstance(event, Back) and event.label == 3


def rests(one: Tracks, seconds: float, *, legs: bool, is_furniture: bool) -> tuple[list[FloorEvent], float]:
    """What happens first while all stand still for so long, and after how many seconds."""
    for scan in range(1, round(10 * seconds) + 1):
        t = NOW + 0.1 * scan
        there = (one.bodies["used"] == 1) & (one.bodies["stale"] == 0)
        one.bodies["seen"][there] = one.bodies["a_seen"][there] = t
        one.bodies["b_seen"][there & (one.bodies["b_print"] >= 0)] = t
        if events := one.review(
            t, 0.1, OPEN, lambda: 9, lambda _: False, lambda _: is_furniture, learned=True, legs=legs
        ):
            return events, t - NOW
    return [], seconds


@pytest.mark.parametrize(
    ("width", "legs", "is_furniture", "gone"),
    [
        (0.265, True, False, True),
        (0.265, False, False, False),
        (0.25, True, False, False),
        (0.25, False, True, True),
        (0.12, True, True, False),
    ],
    ids=["broader than two legs", "a shoe", "two legs", "like a piece that has gone", "too narrow"],
)
def test_who_seems_to_rest_and_is_broad_is_furniture(width: float, legs: bool, is_furniture: bool, gone: bool) -> None:
    one = room()
    somebody(one.bodies[0], 4.0, 0.0, width=width, b_print=2)
    events, after_s = rests(one, 15.0, legs=legs, is_furniture=is_furniture)
    assert [(type(event), event.label) for event in events] == ([(Stale, 1)] if gone else [])
    assert after_s > 7.0


@pytest.mark.parametrize(
    ("fields", "gone"),
    [
        ({"quality": 0.25, "width": 0.03}, True),
        ({"quality": 0.25, "width": 0.1}, False),  # his feet are half hidden behind others
        ({"quality": 0.5, "width": 0.03}, False),
        ({"shoe": 1.0, "width": 0.5, "pushed": 0.5}, True),
        ({"shoe": 1.0, "width": 0.42, "pushed": 0.5}, False),  # two shoes side by side
    ],
)
def test_what_is_too_narrow_or_too_broad_for_feet_in_the_mean_is_none(fields: dict[str, float], gone: bool) -> None:
    one = room()
    somebody(one.bodies[0], 4.0, 0.0, **fields)
    assert bool(rests(one, 6.0, legs=False, is_furniture=False)[0]) == gone


def test_nobody_who_shows_two_feet_is_a_piece() -> None:
    one = room()
    somebody(one.bodies[0], 4.0, 0.0, width=0.25)
    assert rests(one, 15.0, legs=False, is_furniture=True) == ([], 15.0)


def test_the_one_who_left_it_there_has_the_name() -> None:
    one = room()
    somebody(one.bodies[0], 4.0, 0.0, width=0.3, b_print=2, suspected=NOW - 5.0, a_land=NOW - 1.0, b_land=NOW - 1.0)
    somebody(one.bodies[1], 6.0, 0.0, label=2, first=NOW - 5.0)
    events, _ = rests(one, 15.0, legs=True, is_furniture=False)
    assert [(type(event), event.label) for event in events] == [(Vanished, 2), (Moved, 1)]
    (label,) = one.labels(NOW)
    assert (label.id, round(label.xy[0])) == (1, 6)


@pytest.mark.parametrize(
    ("piece", "looks_like_it"),
    [
        (Piece(90.0, 1.0, 1.0, 0.29, 1.0), True),
        (Piece(90.0, 1.0, 1.0, 0.2, 1.0), False),
        (Piece(90.0, 1.0, 1.0, 0.29, 0.0), False),
        (Piece(105.0, 1.0, 1.0, 0.29, 1.0), False),
    ],
    ids=["as wide", "narrower", "a part of it is there", "went later"],
)
def test_a_piece_that_has_gone_is_what_came_to_rest_as_wide(piece: Piece, looks_like_it: bool) -> None:
    assert Furniture.misses(0.3, NOW, [piece]) == looks_like_it


@pytest.mark.parametrize(("share", "feet", "known"), [(0.0, 60.0, True), (0.0, 30.0, False), (0.3, 600.0, False)])
def test_legs_are_known_when_no_shoe_was_seen(share: float, feet: float, known: bool) -> None:
    assert only_legs(np.array([share, feet])) == known
