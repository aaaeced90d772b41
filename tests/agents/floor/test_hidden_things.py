"""What is hidden for a while: it is not given up, it is the same when it comes out, and furniture is furniture."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tms_agents.floor import FloorSettings
from tms_agents.floor.feet.prints import follow
from tms_agents.floor.objects.objects import Objects
from tms_agents.floor.scan.background import BACKGROUND, FOREGROUND, NO_ECHO
from tms_agents.floor.scan.dark import dark_width
from tms_agents.floor.scan.freespace import FREE, HIDDEN, HIT, LOOK, PAST, SILENT, look
from tms_agents.floor.scan.furniture import Furniture, Piece
from tms_agents.floor.scan.segmentation import CLUSTER
from tms_agents.floor.state import BODY, PRINT, THING, empty

PERIOD_S = 0.1
#: Something new stands right before a laser of three beams, so that nothing behind it is seen.
COVERED = (np.full(3, 0.5), np.full(3, FOREGROUND, np.int8), np.full(3, 5.0), np.zeros(3), -0.05, 0.05)


def removals(verdicts: list[int]) -> int:
    """Of one thing that is seen like this, scan by scan."""
    objects, looks = Objects(empty(THING, 1), FloorSettings()), np.zeros(1, LOOK)
    thing = objects.things[0]
    thing["used"], thing["label"], thing["rate"], thing["solid"], thing["half"] = 1, 1, 0.99, 0.99, 0.05
    gone = 0
    for k, verdict in enumerate(verdicts):
        looks["verdict"] = verdict
        gone += len(objects.weigh(looks, empty(BODY, 1), k * PERIOD_S, PERIOD_S))
    return gone


@settings(max_examples=20)
@given(st.integers(15, 40), st.integers(0, 14))
def test_glimpses_past_the_edge_of_what_hides_a_thing_do_not_add_up(every: int, first: int) -> None:
    assert removals([FREE if k % every == first else HIDDEN for k in range(2000)]) == 0


@settings(max_examples=20)
@given(st.integers(0, 100))
def test_a_thing_whose_place_is_seen_to_be_empty_after_all_has_gone(hidden: int) -> None:
    assert removals([HIDDEN] * hidden + [FREE] * 8) == 1


def test_a_thing_half_hidden_has_gone_when_the_rest_of_it_is_seen_past() -> None:
    assert removals([PAST] * 8) == 1
    assert removals([PAST if k % 20 == 0 else HIT for k in range(500)]) == 0


def looked(things: np.ndarray, ranges: list[float], sensor: int = 0, *, echoes: bool = True) -> int:
    """The verdict of a laser of nine beams at the origin on the one thing; the background is 5 m away, or ``echoes``
    nothing."""
    found, looks, n = np.array(ranges), np.zeros(1, LOOK), len(ranges)
    states = np.where(found < 4.9, FOREGROUND, BACKGROUND if echoes else NO_ECHO).astype(np.int8)
    bearings = 0.02 * (np.arange(n) - (n - 1) / 2)
    rays = np.zeros((n, 10))
    rays[:, 2], rays[:, 3], rays[:, 8], rays[:, 9] = np.cos(bearings), np.sin(bearings), np.inf, -1
    direct, nowhere = np.array([[1.0, 0.0, 0.0, 1.0, 0.0, 0.0]]), np.zeros(3)
    background = np.full(n, float(not echoes)), np.full(n, 5.0 if echoes else np.inf)
    look(things, found, states, *background, rays, direct, nowhere, -0.08, 0.02, np.zeros(n, np.bool_), sensor, looks)
    return int(looks["verdict"][0])


@pytest.mark.parametrize(
    ("ranges", "verdict"),
    [
        ([0, 0, 0, 2.0, 2.0, 2.0, 0, 0, 0], HIT),
        ([0, 0, 0, 0, 0, 0, 0, 0, 0], FREE),
        ([0, 0, 0, 0, 1.0, 0, 0, 0, 0], HIDDEN),
        ([0, 0, 0, 1.0, 0, 0, 0, 0, 0], SILENT),
        ([1.0, 0, 0, 0, 0, 0, 1.0, 0, 0], SILENT),
        ([1.0, 0, 0, 0, 0, 0, 0, 0, 1.0], FREE),
    ],
    ids=["there", "gone", "hidden", "behind something dark", "behind what echoes beside it", "between others"],
)
def test_where_nothing_echoes_behind_a_thing_silence_tells_nothing_while_something_dark_is_before_it(
    ranges: list[float], verdict: int
) -> None:
    things = empty(THING, 1)
    things["used"], things["x"], things["half"], things["rate"], things["part_by"] = 1, 2.0, 0.04, 0.99, -1
    assert looked(things, [r or np.inf for r in ranges], echoes=False) == verdict


@pytest.mark.parametrize("side", [1, -1])
def test_what_met_a_half_hidden_thing_tells_that_it_has_gone(side: int) -> None:
    """One beam of some meets it for seconds; then it ends behind it. A glimpse of an edge tells nothing."""
    things = empty(THING, 1)
    things["used"], things["x"], things["half"], things["rate"], things["part_by"] = 1, 2.0, 0.08, 0.99, -1
    met, gone = [5.0, 5.0, 1.0, 1.0, 1.0, 1.0, 1.96, 5.0, 5.0], [5.0, 5.0, 1.0, 1.0, 1.0, 1.0, 5.0, 5.0, 5.0]
    hidden = [5.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 5.0]
    assert looked(things, gone[::side]) == HIDDEN
    assert looked(things, met[::side]) == HIT
    assert looked(things, gone[::side]) == HIDDEN
    assert {looked(things, met[::side]) for _ in range(40)} == {HIT}
    assert looked(things, hidden[::side]) == HIDDEN
    assert looked(things, gone[::side]) == PAST
    assert looked(things, gone[::side], sensor=1) == HIDDEN


def seen(prints: np.ndarray, x: float, width: float, t: float, *, attached: bool = False) -> None:
    """One cluster at (x, 0), or nothing at all where its width is 0."""
    clusters = np.zeros(1 if width else 0, CLUSTER)
    clusters["x"], clusters["width"], clusters["near"], clusters["n"] = x, width, x, 5
    clusters["spacing"], clusters["mirror"], clusters["attached"] = 0.01, -1, attached
    follow(clusters, np.zeros(clusters.size, np.int64), prints, 0, t, COVERED)


def test_what_noise_joins_to_a_wall_now_and_then_is_not_joined_to_it_when_that_happens_in_a_row() -> None:
    for every, joined in ((5, False), (1, True)):
        prints = empty(PRINT, 4)
        for k in range(35):
            seen(prints, 2.0, 0.08, k * PERIOD_S, attached=k % every == 0 or k >= 30)
        assert (prints["attached"][0] > 0.5) == joined


@pytest.mark.parametrize(
    ("stood_s", "x", "width", "same"),
    [(3.0, 2.01, 0.08, True), (0.7, 2.01, 0.08, False), (3.0, 2.06, 0.08, False), (3.0, 2.01, 0.16, False)],
)
def test_what_comes_out_again_at_its_place_has_rested_all_the_time(
    stood_s: float, x: float, width: float, same: bool
) -> None:
    """Unless it had stood no longer than a foot, or is a little elsewhere, or not as wide."""
    prints = empty(PRINT, 4)
    for k in range(round(stood_s / PERIOD_S) + 1):
        seen(prints, 2.0, 0.08, k * PERIOD_S)
    hidden_s = 2.0
    seen(prints, 2.0, 0.0, stood_s + 0.5 * hidden_s)
    again = stood_s + hidden_s
    seen(prints, x, width, again)
    (one,) = prints[prints["used"] == 1]
    assert one["rested"] == (0.0 if same else again)
    assert one["first"] == again


def thin(*places: tuple[float, float], mutes: int = 0) -> np.ndarray:
    """Thin prints that came together."""
    prints = empty(PRINT, len(places))
    prints["used"], prints["hits"], prints["looks"], prints["mutes"], prints["owner"] = 1, 10, 10, mutes, -1
    prints["x"], prints["y"], prints["width"], prints["spacing"] = *zip(*places, strict=True), 0.03, 0.01
    return prints


def test_three_legs_that_came_together_are_a_chair_and_parts_of_one_black_thing_are_not() -> None:
    chair = thin((2.0, 2.0), (2.4, 2.0), (2.0, 2.4))
    assert Furniture().explains(chair[0], chair, [], 5.0, 4.0)
    close = thin((2.0, 2.0), (2.1, 2.0), (2.0, 2.1))
    assert not Furniture().explains(close[0], close, [], 5.0, 4.0)
    black = thin((2.0, 2.0), (2.4, 2.0), (2.0, 2.4), mutes=30)
    assert not Furniture().explains(black[0], black, [], 5.0, 4.0)


@pytest.mark.parametrize(("owned", "unseen_s", "legs"), [(1.0, 2.0, False), (1.0, 0.2, True), (-1.0, 2.0, True)])
def test_feet_that_were_lifted_are_not_the_other_legs_of_a_chair(owned: float, unseen_s: float, legs: bool) -> None:
    """But a leg that somebody seemed to stand on is there still, and one that nobody did may be hidden."""
    prints = thin((2.0, 2.0), (2.4, 2.0), (2.0, 2.4))
    prints["last"], prints["owned"] = 5.0, -1.0
    prints["owned"][1:], prints["last"][1:] = owned, 5.0 - unseen_s
    assert Furniture().explains(prints[0], prints, [], 5.0, 4.0) == legs


@pytest.mark.parametrize(
    ("rested", "away", "leg"),
    [(1.0, 0.0, True), (9.0, 0.0, False), (1.0, 2.0, False)],
    ids=["came with them", "came later", "elsewhere"],
)
def test_a_leg_that_is_believed_late_belongs_to_the_legs_known_before(rested: float, away: float, leg: bool) -> None:
    furniture, chair = Furniture(), thin((2.0, 2.0), (2.4, 2.0), (2.0, 2.4))
    chair["rested"] = 1.0
    assert all(furniture.explains(one, chair, [], 5.0, 4.0) for one in chair)
    last = thin((2.4 + away, 2.4))
    last["rested"] = rested
    assert furniture.explains(last[0], last, [], 20.0, 4.0) == leg
    assert not furniture.explains(last[0], last, [], 300.0, 4.0)


def dark(echoes: list[int], between: list[int], *, ranges: float = 4.0) -> float:
    """How wide what a few ``echoes`` at 2 m come from seems, where beams ``between`` bring nothing."""
    seen, wall = np.full(200, ranges), np.full(200, 4.0)
    seen[between], seen[echoes] = np.inf, 2.0
    return float(dark_width(echoes[0], echoes[0], 2.0, seen, wall, 0.005))


def test_of_a_black_front_a_few_beams_come_back_and_of_something_small_the_beams_beside_it_go_past() -> None:
    front = list(range(80, 120))
    assert dark([100], front) == pytest.approx(0.4)
    assert dark([82, 100, 117], front) == pytest.approx(0.4)
    assert dark([100], [98, 99, 101]) == pytest.approx(0.04)
    assert dark([100, 150], [98, 99, 101, 149]) == pytest.approx(0.04)


def test_something_thin_before_a_black_front_does_not_end_it_and_the_wall_beside_it_is_no_part_of_it() -> None:
    seen, wall = np.full(200, 4.0), np.full(200, 4.0)
    seen[80:120], seen[100], seen[90:93] = np.inf, 2.0, 1.0
    assert dark_width(100, 100, 2.0, seen, wall, 0.005) == pytest.approx(0.4)
    seen[85:95] = 1.0
    assert dark_width(100, 100, 2.0, seen, wall, 0.005) == pytest.approx(0.25)
    seen[80:120], seen[100] = 2.1, 2.0
    wall[:] = 2.1
    assert dark_width(100, 100, 2.0, seen, wall, 0.005) == pytest.approx(0.01)


def test_a_thin_thing_is_no_leg_of_a_box_that_went() -> None:
    alone = thin((2.0, 2.0))
    leg, other, side = (
        Piece(1.0, 2.5, 2.0, 0.03, 1.0),
        Piece(1.0, 2.9, 2.0, 0.03, 1.0),
        Piece(1.0, 2.9, 2.0, 0.3, 1.0),
    )
    assert Furniture().explains(alone[0], alone, [leg, other], 5.0, 4.0)
    assert not Furniture().explains(alone[0], alone, [leg, side], 5.0, 4.0)


@pytest.mark.parametrize(("piece", "is_it"), [(0.03, False), (0.07, True)], ids=["leg of a chair", "as wide"])
def test_a_thing_is_no_piece_of_furniture_that_was_half_as_wide(piece: float, is_it: bool) -> None:
    put = thin((2.0, 2.0))
    put["width"], put["spacing"] = 0.076, 0.015
    assert Furniture().explains(put[0], put, [Piece(1.0, 2.5, 2.0, piece, 1.0)], 5.0, 4.0) == is_it


@pytest.mark.parametrize(
    ("rested", "empty_until", "away", "is_it"),
    [
        (4.0, 4.0, 0.5, True),
        (60.0, 60.0, 0.5, False),
        (60.0, 3.0, 0.5, True),
        (60.0, 60.0, 0.1, True),
        (60.0, 60.0, 0.15, False),
    ],
    ids=["at once", "a minute later", "nobody saw when", "it comes back", "something else beside where it stood"],
)
def test_furniture_is_not_pushed_for_a_minute(rested: float, empty_until: float, away: float, is_it: bool) -> None:
    put, gone = thin((2.5 - away, 2.0)), [Piece(1.0, 2.5, 2.0, 0.07, 1.0)]
    put["width"], put["spacing"], put["rested"] = 0.076, 0.015, rested
    assert Furniture().explains(put[0], put, gone, rested + 2.0, empty_until) == is_it


@pytest.mark.parametrize(
    ("width", "away", "went", "is_it"),
    [
        (0.3, 0.25, 1.0, False),
        (0.3, 0.25, -7.0, False),  # who pushed it stood before the other part
        (0.3, 0.45, 1.0, True),  # another one
        (0.3, 0.25, -30.0, True),  # that was long ago
        (0.06, 0.15, 1.0, True),  # the smaller one is the part
    ],
)
def test_a_part_of_what_was_pushed_is_not_a_piece_of_its_own(
    width: float, away: float, went: float, is_it: bool
) -> None:
    box = thin((2.0, 2.0))
    box["width"] = 0.1
    gone = [Piece(1.0, 2.5, 2.0, 0.1, 1.0), Piece(went, 2.5 + away, 2.0, width, 1.0)]
    assert Furniture().explains(box[0], box, gone, 5.0, 4.0) == is_it


@pytest.mark.parametrize(("widths", "lacks"), [((), False), ((0.02, 0.015), False), ((0.02, 0.03), True)])
def test_an_edge_that_noise_hides_is_nothing_that_has_gone_from_the_room(
    widths: tuple[float, ...], lacks: bool
) -> None:
    assert Furniture.lacks([Piece(1.0, 2.0, 2.0, width, 1.0) for width in widths]) == lacks
