"""Furniture of which now this part comes back, now that, is nobody: it is learned where it stands."""

from __future__ import annotations

import math
from types import SimpleNamespace

import numpy as np
import pytest
from floor_rooms import box, cast, sweep, walker

from tms_agents.floor import FloorEstimator, FloorSettings, Sensor
from tms_agents.floor.association.association import Association
from tms_agents.floor.events import Vanished
from tms_agents.floor.feet.bodies import begin, update
from tms_agents.floor.movers.flickering import Flickering, note_stay
from tms_agents.floor.movers.tracks import Tracks
from tms_agents.floor.scan.background import BACKGROUND, FOREGROUND, Background
from tms_agents.floor.scan.clustered import BLANK
from tms_agents.floor.scan.segmentation import CLUSTER, FADES
from tms_agents.floor.settings import Scene
from tms_agents.floor.state import BODY, PRINT, empty

NOW = 100.0
#: A laser at the origin that looks along x and sees walls 8 m away.
OPEN = (np.full(101, 8.0), np.full(101, BACKGROUND, np.int8), np.full(101, 8.0), np.zeros(3), -0.5, 0.01)
LEGS, SHOES = {"own_leg_width_n": 100}, {"own_shoe_length_n": 20}


@pytest.mark.timeout(600)  # the estimator compiles where it never ran before
@pytest.mark.parametrize(("seed", "echoes"), [(2, 0.3), (0, 0.4), (2, 0.4), (0, 0.5), (1, 0.5), (3, 0.5)])
def test_a_black_cabinet_that_somebody_brings_is_nobody(seed: int, echoes: float) -> None:
    """Each of its beams comes back so often. When he has gone pieces of it are told as feet, but not for long."""
    laser = Sensor(sweep(beams=683, fan=math.radians(240), reach=5.6), (0.0, 0.0, 0.0))
    walls = ((4.6, -5.0, 4.6, 5.0), (-1.0, -3.0, 5.0, -3.0), (-1.0, 3.0, 5.0, 3.0))
    walk = walker([(8.0, 1.5, 2.5), (12.0, 3.3, 0.3), (13.0, 3.3, 0.3), (17.0, 1.0, 2.0)])
    rng, estimator, told = np.random.default_rng(seed), FloorEstimator({"A": laser}), 0.0
    for k in range(400):
        t = 0.1 * k
        cabinet = box(3.7 - 0.3 * max(0.0, 12.5 - t), 0.0, 0.4, 0.6) if t > 11.0 else ()
        ranges, behind = cast(laser, walk(t), [*walls, *cabinet]), cast(laser, (), walls)
        ranges[rng.random(683) > np.where(ranges < behind - 0.01, echoes, 0.9)] = np.inf
        estimator.scan("A", t, np.round(ranges + rng.normal(0.0, 0.008, 683), 3))
        told += 0.1 * (t > 20.0 and any(one.kind == "mover" for one in estimator.labels()))
    assert told < 0.5


def stays(
    broad: int,
    seconds: float,
    *,
    legs: bool = True,
    moves_m: float = 0.0,
    thin: int = 0,
    lands: int = 0,
    feet: int = 2,
    echoes: int = 10,
    **fields: float,
) -> Tracks:
    """Somebody shows so many ``feet`` for so long, in ``broad`` of ten scans something 0.4 m broad, in ``thin`` 3 cm.

    Every three seconds he is ``moves_m`` farther, and in ``lands`` of ten scans a foot has landed. In ``echoes`` of ten
    scans something of him comes back, now and then.
    """
    scene = Scene(region=[(0.0, -4.0), (9.0, -4.0), (9.0, 4.0), (0.0, 4.0)], gates=[])
    one = Tracks(Association(3, 4), FloorSettings(), scene)
    body = one.bodies[0]
    known = {"used": 1, "confirmed": 1, "label": 1, "hits": 900, "looks": 900, "both": 400, "own_stance_n": 20}
    seen = {"width": 0.1, "far": 0.4, "quality": 1.0, "suspected": -1e9, "a_print": 2, "b_print": 3, "first": 10.0}
    place = {
        "x0": 4.0,
        "x": 4.0,
        "ax": 4.0,
        "bx": 4.0,
        "by": 0.2,
        "told_x": 4.0,
        "rest_x": 4.0,
        "stay_x": 4.0,
        "rest_at": NOW,
        "seen": NOW,
    }
    for name, value in (known | seen | place | fields).items():
        body[name] = value
    for scan in range(1, round(10 * seconds) + 1):
        t = NOW + 0.1 * scan
        for name in ("x", "ax", "bx"):
            body[name] += moves_m * (scan % 30 == 0)
        if scan * echoes % 10 >= echoes:
            one.review(t, 0.1, OPEN, lambda: 9, lambda _: False, lambda _: False, learned=True, legs=legs)
            continue
        body["clear"] = 0.0
        body["seen"] = body["a_seen"] = t
        body["b_seen"], body["lone"] = t if feet == 2 else NOW - 60.0, 0.0
        body["broadest"] = 0.4 if scan % 10 < broad else 0.03 if scan % 10 >= 10 - thin else 0.1
        if scan % 10 < lands:
            body["a_since"] = t
        one.review(t, 0.1, OPEN, lambda: 9, lambda _: False, lambda _: False, learned=True, legs=legs)
    return one


@pytest.mark.parametrize(
    ("broad", "seconds", "given", "found"),
    [
        (2, 8.0, {}, True),
        (0, 30.0, {}, False),
        (2, 5.0, {}, False),
        (2, 30.0, {"moves_m": 0.7}, False),
        (2, 8.0, LEGS, True),
        (2, 8.0, SHOES | {"legs": False}, False),
        (2, 14.0, SHOES | {"legs": False}, True),
        (1, 14.0, SHOES | {"legs": False}, False),
        (2, 8.0, {"x0": 1.0}, False),
        (2, 8.0, LEGS | {"x0": 1.0}, True),
        (2, 8.0, {"machine": 1}, False),
        (2, 8.0, {"robot": 1}, False),
        (0, 1.0, {"far": 0.03}, True),
    ],
    ids=[
        *("now and then broad", "never", "not for long", "he walks", "also whose legs are known"),
        *("shoes may be broad", "not so often, for so long", "if it is seldom they may", "it came by itself"),
        *(
            "who came, and stands there no more",
            "a robot of known size",
            "a robot",
            "never as wide as a part of a foot",
        ),
    ],
)
def test_who_stays_is_hardly_ever_broad(broad: int, seconds: float, given: dict[str, float], found: bool) -> None:
    assert bool(stays(broad, seconds, **given).flickering.places) == found  # type: ignore[arg-type]


AWAY = {"spacing": 0.03}
NEAR, FAR = {"legs": False, "spacing": 0.01}, AWAY | {"legs": False}


@pytest.mark.parametrize(
    ("thin", "lands", "seconds", "given", "found"),
    [
        (5, 0, 7.0, {}, True),
        (3, 0, 30.0, {}, False),
        (5, 0, 5.0, {}, False),
        (5, 0, 7.0, {"x0": 1.0}, True),
        (5, 0, 30.0, {"moves_m": 0.7}, False),
        (8, 0, 7.0, NEAR, True),
        (5, 0, 30.0, NEAR, False),
        (8, 0, 30.0, FAR, False),
        (9, 0, 7.0, FAR, True),
        (9, 0, 5.0, FAR, False),
        (0, 5, 9.0, AWAY, True),
        (0, 4, 30.0, AWAY, False),
        (0, 5, 7.0, AWAY, False),
        (0, 4, 9.0, FAR, True),
        (0, 3, 30.0, FAR, False),
        (0, 5, 30.0, {"spacing": 0.01}, False),
        (0, 5, 9.0, AWAY | {"machine": 1}, False),
    ],
    ids=[
        *("thin half of the time", "a third of it", "not for long", "wherever he came from", "he walks"),
        *("shoes nearby, most of the time", "half of it"),
        *("shoes far away often are", "but not nearly always", "not for long, far away"),
        *("lands five times a second", "four times, legs", "not for long, too", "four times, shoes", "three times"),
        "nearby a leg that swings is new in each scan",
        "a robot of known size",
    ],
)
def test_who_stays_is_hardly_ever_thin_and_steps_seldom(
    thin: int, lands: int, seconds: float, given: dict[str, float], found: bool
) -> None:
    one = stays(0, seconds, thin=thin, lands=lands, **given)  # type: ignore[arg-type]
    assert bool(one.flickering.places) == found


RARE = SHOES | {"legs": False, "width": 0.03}


@pytest.mark.parametrize(
    ("echoes", "seconds", "given", "found"),
    [
        (3, 9.0, RARE, True),
        (5, 30.0, RARE, False),
        (3, 6.0, RARE, False),
        (3, 30.0, RARE | {"width": 0.1}, False),
        (3, 30.0, {"width": 0.03}, False),
        (3, 30.0, RARE | {"moves_m": 0.2}, False),
    ],
    ids=["seldom", "half of the time", "not for long", "a shoe", "legs", "it moves"],
)
def test_shoes_that_stand_are_seen_more_often_than_not(
    echoes: int, seconds: float, given: dict[str, float], found: bool
) -> None:
    assert bool(stays(0, seconds, echoes=echoes, **given).flickering.places) == found  # type: ignore[arg-type]


def view(ranges: np.ndarray) -> SimpleNamespace:
    """A laser that has seen a wall at 4 m for ten seconds, and sees ``ranges`` (n,) m now."""
    background = Background(ranges.size, 0.01, FloorSettings())
    for _ in range(100):
        background.classify(np.full(ranges.size, 4.0))
        background.learn(np.full(ranges.size, 4.0), np.zeros(ranges.size, np.bool_), 0.1)
    background.classify(ranges)
    return SimpleNamespace(background=background, ranges=ranges)


def clusters(*x: float) -> np.ndarray:
    """Something at each (x, 0), met by beams 10 to 12."""
    found = np.zeros(len(x), CLUSTER)
    found["x"], found["first"], found["last"] = x, 10, 12
    return found


def test_what_is_a_part_of_it_is_learned_and_is_no_foot_for_ten_seconds() -> None:
    one, ranges = Flickering(), np.full(40, 4.0)
    ranges[10:13] = 2.0
    laser = view(ranges)
    assert (laser.background.states[10:13] == FOREGROUND).all()
    body = empty(BODY, 1)[0]
    body["x"], body["far"] = 2.0, 0.5
    one.found(body, NOW)
    for scan in range(1, 100):
        found = clusters(1.5, 2.0, 2.3)
        assert found[: one.step(laser, found, empty(BODY, 2), NOW + 0.1 * scan)]["x"].tolist() == [1.5], scan
        again = Flickering()
        again.restore(one.save())
        one = again
    one.step(laser, clusters(), empty(BODY, 2), NOW + 10.1)
    assert not one.places
    assert (laser.background.classify(ranges)[10:13] == BACKGROUND).all()


def test_not_while_somebody_is_near() -> None:
    one, ranges = Flickering(), np.full(40, 4.0)
    ranges[10:13] = 2.0
    bodies = empty(BODY, 2)
    bodies["used"][0] = bodies["confirmed"][0] = 1
    bodies["x"][0] = 2.8
    bodies["x"][1] = 2.0
    one.found(bodies[1], NOW)
    before, found = one.places, clusters(1.5, 2.0)
    assert one.step(view(ranges), found, bodies, NOW + 5.0) == 2
    assert one.places == before
    bodies["stale"][0] = 1
    assert one.step(view(ranges), found, bodies, NOW + 6.0) == 1


@pytest.mark.parametrize(("began", "seconds", "learned"), [(2.1, 7.0, True), (0.5, 7.0, False), (2.1, 5.0, False)])
def test_another_part_of_it_is_not_somebody(began: float, seconds: float, learned: bool) -> None:
    """Who stays there, and began there, is no reason not to learn it; who came, or is there since lately, is."""
    one, ranges = Flickering(), np.full(40, 4.0)
    ranges[10:13] = 2.0
    bodies = empty(BODY, 2)
    for name, value in {"used": 1, "confirmed": 1, "x": 2.2, "x0": began, "stay": seconds}.items():
        bodies[name][0] = value
    bodies["x"][1], bodies["far"][1] = 2.0, 0.5
    one.found(bodies[1], NOW)
    assert one.step(view(ranges), clusters(1.5, 2.0), bodies, NOW + 1.0) == (1 if learned else 2)


def test_who_is_told_at_it_and_was_never_known_vanishes() -> None:
    one = stays(0, 1.0, own_stance_n=0, hits=90, both=10)
    one.bodies["far"], one.bodies["hits"] = 0.03, 150
    body = one.bodies[0]
    body["seen"] = body["a_seen"] = body["b_seen"] = NOW + 1.1
    events = one.review(NOW + 1.1, 0.1, OPEN, lambda: 9, lambda _: False, lambda _: False, learned=True, legs=True)
    assert [(type(event), event.label) for event in events] == [(Vanished, 1)]


@pytest.mark.parametrize(("feet", "found"), [(2, True), (1, False)])
def test_one_thin_thing_alone_does_not_flicker_and_is_not_learned(feet: int, found: bool) -> None:
    assert bool(stays(0, 7.0, thin=10, feet=feet).flickering.places) == found


@pytest.mark.parametrize(
    ("width", "cut", "thin"),
    [(0.03, 0, True), (0.03, 1, False), (0.03, 2, False), (0.03, FADES, True), (0.1, 0, False), (0.1, 2, False)],
)
def test_who_is_half_hidden_behind_something_is_not_thin(width: float, cut: int, thin: bool) -> None:
    body, prints, foot = empty(BODY, 1)[0], empty(PRINT, 1), np.zeros(1, CLUSTER)
    foot["x"], foot["width"], foot["n"], foot["spacing"], foot["cut"], foot["near"] = 4.0, width, 3, 0.015, cut, 4.0
    begin(body, foot[0], 0, NOW)
    for scan in range(1, 51):
        t = NOW + 0.1 * scan
        update(body, foot[0], True, 0, 0.0, BLANK[0], False, -1, 0.0, False, prints, t)
        note_stay(body, 0.1, True)
    assert body["stay"] == pytest.approx(5.0)
    assert (body["stay_thin"] > 4.5) == thin
    assert thin or body["stay_thin"] == 0.0
