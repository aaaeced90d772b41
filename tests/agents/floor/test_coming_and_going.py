"""Who comes and who goes: by the door and not through a wall, on two legs, and away from where he began."""

from __future__ import annotations

import math

import numpy as np
import pytest
from floor_prints import shows
from floor_rooms import Room, sweep
from floor_rooms import walker as legs_of
from hypothesis import given
from hypothesis import strategies as st

from tms_agents.floor import Appeared, FloorEstimator, FloorSettings, Scene, Sensor, Vanished
from tms_agents.floor.association.association import Association
from tms_agents.floor.events import Back, Moved, Stale
from tms_agents.floor.feet.bodies import narrow
from tms_agents.floor.feet.clutter import costs
from tms_agents.floor.feet.likelihood import feet
from tms_agents.floor.feet.missed import missed
from tms_agents.floor.feet.one_foot import UNLIKELY
from tms_agents.floor.movers.review import CONFIRM, NOTHING, THING, Waits, review
from tms_agents.floor.movers.tracks import Tracks
from tms_agents.floor.scan.background import BACKGROUND, FOREGROUND, NO_ECHO
from tms_agents.floor.scan.masks import Area, Masks, joined
from tms_agents.floor.scan.no_echo import vacant
from tms_agents.floor.scan.segmentation import CLUSTER, FADES, Segmenter
from tms_agents.floor.state import BODY, PRINT, empty

NOW = 100.0
WAITS = Waits(confirm_s=0.35, confirm_m=0.25, leave_s=1.5, hidden_s=60.0, stale_s=1.0)
ROOM = [(0.0, 0.0), (5.0, 0.0), (5.0, 4.0), (0.0, 4.0)]
DOOR = [(4.5, 1.0), (5.5, 1.0), (5.5, 2.0), (4.5, 2.0)]
#: A laser at the origin that looks along x and sees walls 8 m away.
STEP = 0.01
OPEN = (np.full(101, 8.0), np.full(101, BACKGROUND, np.int8), np.full(101, 8.0), np.zeros(3), -0.5, STEP)


def tracks(gates: list[list[tuple[float, float]]], region: list[tuple[float, float]] | None = None) -> Tracks:
    return Tracks(Association(2, 1), FloorSettings(), Scene(region=region, gates=gates))


def at(one: Tracks, t: float) -> list:
    """What happens at t, where nothing is seen."""
    return one.review(t, 0.1, OPEN, lambda: 9, lambda body: False, lambda body: False, learned=True)


def walker(body: np.ndarray, x: float, y: float, v: tuple[float, float], seen: float) -> None:
    """Somebody believed who was seen last at (x, y) and has gone on at v since."""
    body["used"] = body["confirmed"] = body["label"] = 1
    body["hits"], body["both"], body["quality"], body["own_stance_n"], body["far"] = 300, 250, 1.0, 5, 0.12
    gone = NOW - seen
    body["x"], body["y"], body["vx"], body["vy"] = x + gone * v[0], y + gone * v[1], *v
    body["told_x"], body["told_y"], body["seen"], body["rest_at"] = x, y, seen, seen
    body["a_seen"] = body["b_seen"] = seen
    body["ax"], body["bx"], body["ay"], body["by"] = x, x, y + 0.1, y - 0.1


@pytest.mark.parametrize(
    ("y", "region", "left"),
    [(1.5, ROOM, True), (3.0, ROOM, False), (1.5, None, False)],
    ids=["by the door", "through a wall", "no walls known"],
)
def test_who_walks_out_of_the_door_has_left_before_a_second_is_over(
    y: float, region: list[tuple[float, float]] | None, left: bool
) -> None:
    one = tracks([DOOR], region)
    walker(one.bodies[0], 4.9, y, (1.0, 0.0), NOW - 0.7)
    events = at(one, NOW)
    assert [type(event) for event in events] == ([Vanished] if left else [])


def coming(body: np.ndarray, x: float, since: float) -> None:
    """Somebody new who comes in at x (m) by the door, and has been seen walking there ``since``."""
    walker(body, x, 1.5, (-1.0, 0.0), NOW)
    body["confirmed"], body["label"], body["first"], body["x0"], body["y0"] = 0, -1, since, x + 0.8, 1.5
    body["hits"], body["looks"], body["due"], body["both"], body["score"] = 20, 20, 20, 15, 20.0
    body["a_since"] = body["b_since"] = NOW - 0.2


@pytest.mark.parametrize(
    ("x", "y", "gates", "gone"),
    [(5.15, 1.5, [DOOR], True), (5.05, 1.5, [DOOR], False), (5.15, 3.0, [DOOR], False), (5.15, 3.0, [], True)],
    ids=["out", "in", "a wall", "no doors known"],
)
def test_who_is_seen_outside_the_door_has_left(
    x: float, y: float, gates: list[list[tuple[float, float]]], gone: bool
) -> None:
    one = tracks(gates, ROOM)
    walker(one.bodies[0], x, y, (1.0, 0.0), NOW)
    events = at(one, NOW)
    assert [type(event) for event in events] == ([Vanished] if gone else [])
    assert len(one.labels(NOW)) == (0 if gone else 1)


@pytest.mark.parametrize(("x", "told"), [(5.1, []), (4.9, [Appeared])], ids=["still outside", "inside"])
def test_who_comes_by_the_door_is_told_when_inside(x: float, told: list[type]) -> None:
    one = tracks([DOOR], ROOM)
    coming(one.bodies[0], x, NOW - 1.0)
    assert [type(event) for event in at(one, NOW)] == told


SEAT = [(3.0, 2.5), (5.0, 2.5), (5.0, 3.5), (3.0, 3.5)]


def sits(clear: float) -> Tracks:
    """Somebody whose feet, last seen 0.3 m before the seat, have vanished, ``clear`` s of that in view."""
    one = Tracks(Association(2, 1, [SEAT]), FloorSettings(), Scene(region=ROOM, gates=[DOOR], seats=[SEAT]))
    walker(one.bodies[0], 4.0, 2.2, (0.0, 0.0), NOW - 1.1)
    one.bodies["clear"][0] = clear
    moved, lost = at(one, NOW)
    assert isinstance(moved, Moved) and isinstance(lost, Stale)
    assert moved.xy == one.labels(NOW)[0].xy
    return one


def test_who_sits_down_is_told_on_the_seat_not_before_it() -> None:
    (label,) = sits(0.8).labels(NOW)
    assert label.stale and label.xy == pytest.approx((4.0, 2.75))


@pytest.mark.parametrize(("clear", "away", "may"), [(0.8, 0.6, True), (0.8, 1.1, False), (0.0, 1.1, True)])
def test_who_has_sat_down_in_clear_view_gets_up_beside_the_seat(clear: float, away: float, may: bool) -> None:
    """A foot of somebody who passes is not his; who was hidden may have gone on."""
    one = sits(clear)
    one.bodies["pp"] = 0.25
    clusters, prints, cost = np.zeros(1, CLUSTER), empty(PRINT, 1), np.zeros((1, 2))
    clusters["x"], clusters["y"], clusters["n"], clusters["width"] = 4.0, 2.1 - away, 8, 0.1
    clusters["spacing"] = 0.01
    feet(shows(clusters, prints, NOW), np.ones(1, np.bool_), one.bodies, 0, cost)
    assert (cost.min() < UNLIKELY) == may


@given(x=st.floats(-2.0, 8.0), y=st.floats(-2.0, 6.0), deep=st.floats(0.0, 0.4))
def test_across_the_edge_of_an_area_one_is_in_it_or_on_its_edge(x: float, y: float, deep: float) -> None:
    area = Area([SEAT])
    there = area.into(x, y, deep)
    assert area.distance(*there) == pytest.approx(0.0, abs=1e-6)
    assert area.distance(x, y) > 0.0 or there == (x, y)
    assert math.dist((x, y), there) <= area.distance(x, y) + deep + 1e-6


def behind(low: float, high: float, away: float) -> tuple:
    """What a laser sees where something ``away`` m off hides all between two angles (rad)."""
    angles = -0.5 + STEP * np.arange(101)
    hidden = (low < angles) & (angles < high)
    states = np.where(hidden, FOREGROUND, BACKGROUND).astype(np.int8)
    return (np.where(hidden, away, 8.0), states, *OPEN[2:])


def happens(one: Tracks, sight: tuple, seconds: float) -> list[type]:
    times = NOW + np.arange(0.0, seconds, 0.1)
    return [
        type(event)
        for t in times
        for event in one.review(float(t), 0.1, sight, lambda: 9, lambda body: False, lambda body: False, learned=True)
    ]


@pytest.mark.parametrize(
    ("way", "region", "left"),
    [((0.0, 1.0), None, True), ((0.0, -1.0), None, False), ((0.0, 1.0), ROOM, False)],
    ids=["out of view", "back into view", "no door there"],
)
def test_who_walks_on_behind_something_and_out_of_reach_has_left_where_no_walls_are_known(
    way: tuple[float, float], region: list[tuple[float, float]] | None, left: bool
) -> None:
    one = tracks([DOOR] if region else [], region)
    walker(one.bodies[0], 4.0, 1.4, way, NOW - 0.35)
    told = happens(one, behind(0.15, 0.6, 1.0), 12.0)
    assert told == ([Stale, Vanished] if left else [Stale])


def test_who_was_last_seen_on_this_side_of_the_threshold_may_turn_round_in_the_door_and_has_left_if_he_does_not() -> (
    None
):
    one = tracks([DOOR], ROOM)
    walker(one.bodies[0], 4.6, 1.5, (1.0, 0.0), NOW - 0.7)
    told = [(t, event) for t in NOW + np.arange(0.0, 9.0, 0.1) for event in at(one, t)]
    assert [type(event) for _, event in told] == [Moved, Stale, Vanished]
    assert told[0][0] == told[1][0] == NOW
    assert told[0][1].xy == pytest.approx((4.6, 1.5), abs=0.11), "where he was seen last"
    assert 5.0 < told[2][0] - NOW < 8.0 and told[2][1].earliest == NOW - 0.7


def test_who_is_hidden_does_not_go_on_through_a_wall() -> None:
    one = tracks([DOOR], ROOM)
    walker(one.bodies[0], 4.7, 3.0, (1.0, 0.0), NOW - 1.6)
    (lost,) = at(one, NOW)
    assert isinstance(lost, Stale)
    (label,) = one.labels(NOW)
    assert label.stale
    assert label.xy[0] == pytest.approx(4.7)


@pytest.mark.parametrize(
    ("steps", "feet", "x0", "thing"),
    [(0, 0, 0.0, True), (0, 14, 3.0, True), (0, 14, 0.0, False), (0, 250, 3.0, False), (5, 40, 3.0, False)],
    ids=["no feet", "stays where it was", "comes", "shuffles", "walks"],
)
def test_what_rests_and_never_showed_two_feet_or_took_a_step_is_a_thing(
    steps: int, feet: int, x0: float, thing: bool
) -> None:
    """A bin that was pushed is as wide as two feet side by side, and has none. Who shuffles takes no steps."""
    bodies, actions = empty(BODY, 1), np.zeros(1, np.int64)
    walker(bodies[0], 3.0, 0.0, (0.0, 0.0), NOW)
    bodies["own_stance_n"], bodies["both"], bodies["rest_at"], bodies["rest_x"] = steps, feet, NOW - 31.0, 3.0
    bodies["x0"] = x0
    review(bodies, NOW, 0.1, OPEN, WAITS, actions, False, True, False)
    assert (actions[0] == THING) == thing


@pytest.mark.parametrize(("width", "his"), [(0.1, True), (0.37, False)], ids=["legs", "no feet"])
def test_the_name_of_who_walked_is_not_given_to_what_has_no_feet(width: float, his: bool) -> None:
    one = tracks([DOOR], ROOM)
    walker(one.bodies[0], 3.0, 1.0, (0.0, 0.0), NOW - 2.0)
    one.bodies["stale"][0] = 1
    one._told.agree([Stale(NOW - 1.0, 1)], one.bodies, NOW - 1.0)
    walker(one.bodies[1], 3.5, 1.0, (0.0, 0.0), NOW)
    new = one.bodies[1]
    new["confirmed"], new["own_stance_n"], new["both"], new["hits"], new["score"] = 0, 0, 0, 20, 20.0
    new["first"], new["x0"], new["y0"], new["width"], new["far"] = NOW - 1.0, 3.1, 1.0, width, width
    new["a_since"] = new["b_since"] = NOW - 0.3
    events = at(one, NOW)
    assert [type(event) for event in events if event.label == (1 if his else 9)] == [Back if his else Appeared]


def test_who_is_hidden_while_he_stands_in_the_door_has_not_left() -> None:
    one = tracks([DOOR], ROOM)
    walker(one.bodies[0], 5.1, 1.5, (0.0, 0.0), NOW - 0.7)
    one.bodies["rest_at"] = NOW - 10.0
    assert at(one, NOW) == []


def test_where_the_door_is_feet_count_a_little_outside_too() -> None:
    clusters = np.zeros(3, CLUSTER)
    clusters["x"], clusters["y"] = (5.25, 5.25, 5.45), (1.5, 3.0, 1.5)
    assert Masks(ROOM, [], [DOOR])(clusters.copy())["y"].tolist() == [1.5]
    assert Masks(ROOM, [])(clusters.copy()).size == 0
    assert Masks(ROOM, [DOOR], [DOOR])(clusters.copy()).size == 0


@pytest.mark.parametrize(
    ("change", "price"),
    [({}, 0.8), ({"vx": 0.1}, 0.0), ({"both": 90}, 0.0), ({"b_seen": NOW - 0.5}, 0.0), ({"robot": 1}, 0.0)],
    ids=["walks", "stands", "shoes", "a moment", "robot"],
)
def test_a_walker_of_whom_one_leg_is_missing_is_a_worse_explanation(change: dict[str, float], price: float) -> None:
    """Else a seated person takes one leg of whoever passes, and both have one from then on."""
    bodies = empty(BODY, 1)
    walker(bodies[0], 3.0, 0.0, (1.0, 0.0), NOW)
    bodies["b_seen"] = NOW - 0.7
    for name, value in change.items():
        bodies[name] = value
    assert missed(bodies[0], NOW, OPEN, joined([])) == pytest.approx(price)


@pytest.mark.parametrize(("away", "price"), [(0.3, 0.3), (0.8, 2.0)])
def test_feet_that_vanish_beside_a_seat_may_have_been_lifted(away: float, price: float) -> None:
    """Else he takes a foot of whoever is near rather than sit down."""
    bodies = empty(BODY, 1)
    walker(bodies[0], 3.0 - away, 0.0, (0.0, 0.0), NOW - 0.5)
    seat = [(3.0, -1.0), (4.0, -1.0), (4.0, 1.0), (3.0, 1.0)]
    assert missed(bodies[0], NOW, OPEN, joined([seat])) == pytest.approx(price)


def test_a_leg_behind_somebody_is_not_missed() -> None:
    bodies = empty(BODY, 1)
    walker(bodies[0], 3.0, 0.0, (1.0, 0.0), NOW)
    bodies["b_seen"] = NOW - 0.7
    before = (np.full(101, 2.0), np.full(101, FOREGROUND, np.int8), *OPEN[2:])
    assert missed(bodies[0], NOW, before, joined([])) == 0.0


@pytest.mark.parametrize(("width", "far", "cheap"), [(0.1, 0.7, False), (0.4, 0.7, True), (0.1, 0.2, True)])
def test_a_robot_seen_as_a_sliver_in_a_door_does_not_become_the_leg_of_who_comes_in(
    width: float, far: float, cheap: bool
) -> None:
    bodies, prints, clusters = empty(BODY, 1), empty(PRINT, 1), np.zeros(1, CLUSTER)
    bodies["used"] = bodies["confirmed"] = bodies["robot"] = bodies["machine"] = 1
    bodies["far"], bodies["width"], bodies["seen"] = far, 0.05, NOW - 0.1
    clusters["x"], clusters["n"], clusters["width"], clusters["spacing"] = 0.1, 8, width, 0.01
    cost = np.zeros((1, 3))
    costs(shows(clusters, prints, NOW), np.ones(1, np.bool_), bodies, np.zeros(1, np.int64), cost)
    assert (cost[0, 0] < 3.0) == cheap


def scan(ranges: dict[int, float]) -> tuple[np.ndarray, np.ndarray]:
    """Ranges and states of a wall at 8 m, but for these beams."""
    values, states = OPEN[0].copy(), OPEN[1].copy()
    for beam, r in ranges.items():
        values[beam] = r
        states[beam] = FOREGROUND if math.isfinite(r) else NO_ECHO
    return values, states


@pytest.mark.parametrize("silence", [math.inf, math.nan])
def test_one_beam_of_a_dark_leg_may_be_somebody(silence: float) -> None:
    """What is dark echoes here and there: how wide it is nobody knows."""
    rays = np.zeros((101, 10))
    angles = -0.5 + STEP * np.arange(101)
    rays[:, 2], rays[:, 3], rays[:, 8] = np.cos(angles), np.sin(angles), 1e9
    found = []
    for beside in (silence, 8.0):
        ranges, states = scan({49: beside, 50: 2.5, 51: beside} if math.isfinite(beside) is False else {50: 2.5})
        segment = Segmenter(np.full(101, STEP), math.radians(15))
        (cluster,) = segment(ranges, states, np.zeros(101, np.bool_), OPEN[2], OPEN[2], rays)
        found.append((int(cluster["cut"]), bool(narrow(cluster))))
    assert found == [(FADES, False), (0, True)]


@pytest.mark.parametrize(
    ("beam", "empty_there"),
    [(8.0, True), (2.0, True), (3.0, False), (math.inf, False), (math.nan, False)],
    ids=["passes", "stopped before", "met", "silent", "error"],
)
def test_a_place_is_empty_if_beams_pass_it_or_cannot_reach_it(beam: float, empty_there: bool) -> None:
    seen = scan(dict.fromkeys(range(45, 56), beam))
    assert vacant(3.0, 0.0, 0.03, (*seen, *OPEN[2:])) == empty_there
    behind_nothing = np.full(101, np.inf)
    assert vacant(3.0, 0.0, 0.03, (*seen, behind_nothing, *OPEN[3:])) == (empty_there or beam != 3.0)


@pytest.mark.parametrize(
    ("there", "believed"), [(8.0, True), (math.inf, False), (3.0, False)], ids=["left", "dark", "still there"]
)
def test_who_is_believed_has_gone_from_where_he_began(there: float, believed: bool) -> None:
    """Of a dark cabinet now this part echoes and now that: nobody walks along it."""
    bodies, actions = empty(BODY, 1), np.zeros(1, np.int64)
    bodies["used"], bodies["hits"], bodies["looks"], bodies["score"] = 1, 20, 20, 20.0
    bodies["first"], bodies["seen"], bodies["x0"], bodies["x"], bodies["y"] = NOW - 2.0, NOW, 3.0, 3.0, 0.5
    bodies["a_seen"], bodies["b_seen"] = NOW, NOW - 0.1
    bodies["ax"] = bodies["bx"] = 3.0
    bodies["ay"] = bodies["by"] = 0.5
    ranges, states = scan(dict.fromkeys(range(45, 56), there) if there != 8.0 else {})
    review(bodies, NOW, 0.1, (ranges, states, *OPEN[2:]), WAITS, actions, False, True, False)
    assert actions[0] == (CONFIRM if believed else NOTHING)


def test_what_is_not_believed_for_long_is_nobody() -> None:
    bodies, actions = empty(BODY, 1), np.zeros(1, np.int64)
    bodies["used"], bodies["hits"], bodies["looks"], bodies["score"] = 1, 70, 70, 20.0
    bodies["first"], bodies["seen"], bodies["x"] = NOW - 7.0, NOW, 0.3
    review(bodies, NOW, 0.1, OPEN, WAITS, actions, False, True, False)
    assert bodies["used"][0] == 0


@pytest.mark.parametrize(("seen", "believed"), [((1, 1, 1, 1), 1), ((1, 0, 1, 0), 0)], ids=["always", "now and then"])
def test_who_is_not_there_in_every_other_scan_is_nobody(seen: tuple[int, ...], believed: int) -> None:
    """Of a far edge that beams just hit or just miss, parts echo here and there: that may look like steps."""

    def edge(t: float) -> list[tuple[float, float, float]]:
        k = round(10.0 * t) - 90
        return [(3.0, 1.0 + 0.08 * k, 0.06)] if 0 <= k < 24 and seen[k % 4] else []

    _, events = Room(edge).play(14.0)
    assert len([event for event in events if isinstance(event, Appeared) and event.kind == "mover"]) == believed


def test_who_is_hidden_in_every_other_scan_is_somebody() -> None:
    """What cannot be seen is no reason for not believing it."""

    def slats(t: float) -> list[tuple[float, float, float]]:
        k = round(10.0 * t) - 90
        if not 0 <= k < 24:
            return []
        x, y = 3.0, 1.0 + 0.08 * k
        return [(x, y, 0.06)] + ([(0.4 * x, 0.4 * y, 0.12)] if k % 2 else [])

    _, events = Room(slats).play(14.0)
    assert [event for event in events if isinstance(event, Appeared) and event.kind == "mover"]


@pytest.mark.parametrize("stride_s", [0.45, 0.5, 0.55])
def test_who_walks_out_of_reach_goes_on_at_his_pace(stride_s: float) -> None:
    """Of his last steps the foot that he leaves behind is seen, not the one that swings ahead: he does not wait."""
    way = [(9.0, 0.9, 1.0), (11.4, 0.9, 1.0), (13.1, 2.77, 2.5)]
    sensor = Sensor(sweep(271, reach=2.7), (0.05, 0.05, math.pi / 4))
    off: list[float] = []

    def look(t: float, estimator: FloorEstimator) -> None:
        feet = legs_of(way, stride_s=stride_s)(t)
        x, y = np.mean([foot[:2] for foot in feet], axis=0) if feet else (math.nan, math.nan)
        if t > 11.4 and math.hypot(x - 0.05, y - 0.05) > 2.7:
            off.append(min((math.dist((x, y), one.xy) for one in estimator.labels()), default=math.inf))

    Room(legs_of(way, stride_s=stride_s), sensors={"A": sensor}).play(13.0, each=look)
    assert len(off) > 3
    assert max(off) < 0.45
