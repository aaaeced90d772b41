"""Things, furniture and robots where it is hard: before a wall, black, at somebody's feet, pushed, in parts."""

from __future__ import annotations

import json
import math

import numpy as np
import pytest
from floor_rooms import WALLS, Room, Segment, box, cast, sweep, thing, together, walker

from tms_agents.floor import Appeared, FloorEstimator, FloorEvent, Scene, Sensor, Vanished

#: Somebody comes in at the right, goes to the upper wall and back; or to the middle, and stays there for long.
AT_THE_WALL = [(9.0, 4.9, 2.0), (12.0, 2.9, 3.5), (14.0, 2.9, 3.5), (17.0, 4.9, 2.0)]
STAYS = [(9.0, 4.9, 2.0), (12.0, 2.2, 2.0), (40.0, 2.2, 2.0)]


def born(events: list[FloorEvent], kind: str) -> list[Appeared]:
    return [event for event in events if isinstance(event, Appeared) and event.kind == kind]


def test_a_thing_right_before_a_wall_stays_a_thing() -> None:
    _, events = Room(together(walker(AT_THE_WALL), thing(2.5, 3.94, 0.04, 13.0, 150.0))).play(152.0)
    (put,) = born(events, "object")
    assert math.hypot(put.xy[0] - 2.5, put.xy[1] - 3.94) < 0.02
    (taken,) = [event for event in events if isinstance(event, Vanished) and event.label == put.label]
    assert 150.0 < taken.t < 151.0


def test_a_box_put_at_a_wall_soon_after_the_start_is_told() -> None:
    def segments(t: float) -> tuple[Segment, ...]:
        return WALLS if t < 13.0 else (*WALLS, *box(2.5, 3.918, 0.15, 0.15))

    _, events = Room(walker(AT_THE_WALL), segments).play(30.0)
    (put,) = born(events, "object")
    assert math.hypot(put.xy[0] - 2.5, put.xy[1] - 3.918) < 0.05


def test_a_thing_is_told_while_who_put_it_still_stands_there() -> None:
    _, events = Room(together(walker(STAYS), thing(1.75, 2.0, 0.05, 14.0))).play(20.0)
    (put,) = born(events, "object")
    assert put.since < 14.3
    assert put.t < 16.5
    (who,) = born(events, "mover")
    assert put.candidates[0][0] == who.label


def test_nobody_has_three_feet() -> None:
    """It was put there before the person stood still, so that it might have been a foot at first."""
    _, events = Room(together(walker(STAYS), thing(1.85, 2.0, 0.05, 11.4))).play(30.0)
    (put,) = born(events, "object")
    assert math.hypot(put.xy[0] - 1.85, put.xy[1] - 2.0) < 0.02
    assert put.t < 25.0


def test_what_is_watched_survives_a_restart() -> None:
    room = Room(together(walker(STAYS), thing(1.85, 2.0, 0.05, 11.4)))
    estimator, _ = room.play(18.0)
    saved = estimator.to_dict()
    assert saved["waiting"]
    again = FloorEstimator.from_dict(json.loads(json.dumps(saved)), room.sensors)
    assert json.dumps(again.to_dict()) == json.dumps(saved)


def test_feet_that_stand_for_long_are_no_things() -> None:
    _, events = Room(walker(STAYS)).play(40.0)
    assert not born(events, "object")


def test_a_black_thing_is_found_by_the_little_that_echoes() -> None:
    """Nine beams of ten that meet it are lost; once it is gone, the floor behind it is seen again."""
    black = thing(2.0, 2.0, 0.05, 13.0, 60.0)
    room = Room(walker([(9.0, 4.9, 2.45), (12.0, 2.4, 2.35), (17.0, 4.9, 2.45)]))
    rng = np.random.default_rng(1)
    estimator = FloorEstimator(room.sensors)
    events: list[FloorEvent] = []
    for name, t, ranges in room.scans(63.0):
        met = cast(room.sensors[name], black(t), WALLS)
        on_it = met < cast(room.sensors[name], (), WALLS) - 0.01
        echo = np.where(rng.random(ranges.size) < 0.1, met + rng.normal(0.0, 0.004, ranges.size), np.inf)
        events += estimator.scan(name, t, np.where(on_it & (ranges > met), echo, ranges))
    (put,) = born(events, "object")
    assert math.hypot(put.xy[0] - 2.0, put.xy[1] - 2.0) < 0.05
    (taken,) = [event for event in events if isinstance(event, Vanished) and event.label == put.label]
    assert 60.0 < taken.t < 61.5


def test_a_glossy_thing_that_few_beams_meet_is_kept_though_one_of_them_may_pass() -> None:
    """Three beams meet it, of ten times they echo once; those at its edges see the wall every other time."""
    glossy = thing(2.0, 2.0, 0.02, 13.0, 90.0)
    way = [(9.0, 4.9, 2.45), (12.0, 2.4, 2.35), (17.0, 4.9, 2.45)]
    room = Room(walker(way), sensors={"A": Sensor(sweep(271), (0.05, 0.05, 0.25 * math.pi))})
    rng = np.random.default_rng(2)
    estimator = FloorEstimator(room.sensors)
    events: list[FloorEvent] = []
    for name, t, ranges in room.scans(93.0):
        met = cast(room.sensors[name], glossy(t), WALLS)
        on_it = np.flatnonzero(met < cast(room.sensors[name], (), WALLS) - 0.01)
        for i in on_it[ranges[on_it] > met[on_it]]:
            edge = len(on_it) > 1 and i in (on_it[0], on_it[-1]) and rng.random() < 0.5
            if not edge:
                ranges[i] = met[i] + rng.normal(0.0, 0.004) if rng.random() < 0.1 else np.inf
        events += estimator.scan(name, t, ranges)
    (put,) = born(events, "object")
    assert math.hypot(put.xy[0] - 2.0, put.xy[1] - 2.0) < 0.05
    (taken,) = [event for event in events if isinstance(event, Vanished) and event.label == put.label]
    assert 90.0 < taken.t < 91.5


def test_a_robot_is_one_robot_in_parts_and_beside_people() -> None:
    """It drives past a table's legs, waits, and goes on; somebody walks close by meanwhile."""
    legs = [(2.1, 1.2, 0.03), (2.3, 1.0, 0.03), (2.55, 1.3, 0.03)]
    times, xs = [9.0, 17.0, 40.0, 46.0], [4.6, 2.4, 2.4, 3.6]

    def place(t: float) -> float:
        return float(np.interp(t, times, xs))

    def segments(t: float) -> tuple[Segment, ...]:
        return WALLS if t < 9.0 else (*WALLS, *box(place(t), 2.6, 0.55, 0.42))

    passing = walker([(20.0, 4.9, 2.1), (24.0, 2.6, 2.15), (28.0, 2.1, 2.15), (38.0, 4.9, 2.1)])
    seen: set[int] = set()
    missed = 0

    def check(t: float, estimator: FloorEstimator) -> None:
        nonlocal missed
        near = [one for one in estimator.labels() if math.hypot(one.xy[0] - place(t), one.xy[1] - 2.6) < 0.3]
        if t > 17.0:
            seen.update(one.id for one in near if one.robot)
            missed += not any(one.robot for one in near)

    room = Room(together(lambda _: legs, passing), segments)
    _, events = room.play(46.0, scene=Scene(robots=((0.55, 0.42),)), each=check)
    assert len(seen) == 1
    assert missed < 10
    assert not [one for one in born(events, "object") if one.t > 17.0]


@pytest.mark.parametrize("gap", [0.22, 0.3])
def test_a_thing_put_down_beside_a_robot_that_waits_is_told(gap: float) -> None:
    """It goes on standing there, and hides what came beside it only later."""

    def segments(t: float) -> tuple[Segment, ...]:
        x = float(np.interp(t, [9.0, 17.0], [4.6, 2.4]))
        return WALLS if t < 9.0 else (*WALLS, *box(x, 2.6, 0.55, 0.42))

    giver = walker([(20.0, 4.9, 1.2), (24.0, 2.8, 1.6), (26.0, 2.8, 1.6), (30.0, 4.9, 1.2)])
    room = Room(together(giver, thing(2.4, 2.6 - 0.21 - gap - 0.06, 0.06, 25.0)), segments)
    _, events = room.play(36.0, scene=Scene(robots=((0.55, 0.42),)))
    (put,) = [one for one in born(events, "object") if one.t > 17.0]
    assert math.hypot(put.xy[0] - 2.4, put.xy[1] - (2.33 - gap)) < 0.03


@pytest.mark.parametrize("size", [(0.55, 0.35), (0.26, 0.26)])
def test_a_trolley_or_bin_that_was_pushed_is_nobody_when_it_stands(size: tuple[float, float]) -> None:
    def place(t: float) -> float:
        return float(np.interp(t, [12.0, 16.0], [2.4, 3.6]))

    def segments(t: float) -> tuple[Segment, ...]:
        return (*WALLS, *box(place(t), 2.4, *size))

    pusher = walker([(9.0, 4.9, 1.6), (11.0, 2.1, 1.9), (12.0, 2.1, 1.9), (16.0, 3.3, 1.9), (20.0, 4.9, 0.8)])
    estimator, events = Room(pusher, segments).play(30.0)
    movers = [one for one in estimator.labels() if one.kind == "mover"]
    assert not [one for one in movers if math.hypot(one.xy[0] - 3.6, one.xy[1] - 2.4) < 0.5]
    assert len(born(events, "object")) <= 1


def legs(*places: tuple[float, float], since: float):
    """Legs that stand there."""
    return lambda t: [(x, y, 0.05) for x, y in places] if t >= since else []


def test_two_legs_that_stand_there_all_at_once_are_somebody_and_no_things() -> None:
    _, events = Room(legs((2.5, 2.0), (2.3, 2.15), since=9.0)).play(30.0)
    assert not born(events, "object")


def test_who_stands_with_one_leg_behind_the_other_is_still_there() -> None:
    """The room's laser looks from the corner: the second leg steps right behind the first."""

    def second(t: float) -> list[tuple[float, float, float]]:
        share = min(max((t - 14.0) / 0.5, 0.0), 1.0)
        return [(2.1 + 0.25 * share, 2.42 - 0.07 * share, 0.05)] if t >= 12.0 else []

    way = [(9.0, 4.9, 2.2), (12.0, 2.2, 2.2)]
    _, events = Room(together(walker(way), legs((2.15, 2.15), since=12.0), second)).play(24.0)
    assert not born(events, "object")


def test_a_thing_beside_a_leg_of_a_table_that_hides_a_part_of_it_for_ever_is_found() -> None:
    post = box(1.5, 1.42, 0.04, 0.04)
    room = Room(together(walker(AT_THE_WALL), thing(2.5, 2.5, 0.06, 13.0)), lambda t: (*WALLS, *post))
    _, events = room.play(40.0)
    (put,) = born(events, "object")
    assert math.hypot(put.xy[0] - 2.5, put.xy[1] - 2.5) < 0.06


@pytest.mark.parametrize("seed", range(4))
def test_a_beam_in_the_gap_between_two_walls_shows_no_thing(seed: int) -> None:
    """It ends at this wall or that, or nowhere; now and then, by chance, twice at the same place between them."""
    room, gap, rng = Room(), 270, np.random.default_rng(seed)
    (sensor,) = room.sensors.values()
    estimator, events = FloorEstimator(room.sensors), []
    between = {300, 327, 354, 363, 372}
    for k in range(400):
        ranges = cast(sensor, (), WALLS)
        ranges[gap - 40 : gap], ranges[gap + 1 : gap + 40] = 2.0, 1.0
        chance = rng.random()
        ranges[gap] = np.inf if chance < 0.22 or k + 1 in between else 3.9 if chance < 0.85 else 1.0
        if k in between:
            ranges[gap] = 3.0
        events += estimator.scan("A", 0.1 * k, ranges + rng.normal(0.0, 0.004, ranges.size))
    assert events == []
