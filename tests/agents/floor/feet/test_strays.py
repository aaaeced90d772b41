"""Which of two feet is a thing that was put beside somebody who stands."""

from __future__ import annotations

import numpy as np
import pytest

from tms_agents.floor.feet.strays import release
from tms_agents.floor.scan.background import BACKGROUND, FOREGROUND
from tms_agents.floor.state import BODY, PRINT, empty

NOW = 100.0
LEGS, SHOES = np.array([0.0, 500.0]), np.array([0.6, 500.0])
_BEAMS = 181


def sight(away: float, state: int) -> tuple[object, ...]:
    """A sweep from 3 m off along the x axis, all beams of which end so far (m) away on what is new or was there."""
    ranges, pose = np.full(_BEAMS, away), np.array([-3.0, 0.0, 0.0])
    return ranges, np.full(_BEAMS, state, np.int8), np.full(_BEAMS, 9.0), pose, -np.pi / 2, np.pi / (_BEAMS - 1)


HIDDEN, FREE = sight(1.0, FOREGROUND), sight(9.0, BACKGROUND)


def standing(apart: float, *ago: float, **fields: object) -> tuple[np.ndarray, np.ndarray]:
    """Somebody with one foot at the origin and the other so far (m) off, and the prints, which came so long ago (s)."""
    bodies, prints = empty(BODY, 1), empty(PRINT, 2)
    came = NOW - np.array(ago)
    prints["used"], prints["first"], prints["rested"], prints["last"], prints["width"] = 1, came, came, NOW, 0.1
    prints["hits"] = prints["whole"] = prints["looks"] = 100
    prints["x"][1] = apart
    for name, value in fields.items():
        prints[name] = value
    bodies["used"] = bodies["confirmed"] = bodies["b_print"] = 1
    bodies["bx"], bodies["x"] = apart, 0.5 * apart
    bodies["a_seen"] = bodies["b_seen"] = bodies["a_stood"] = bodies["b_stood"] = NOW
    bodies["a_land"], bodies["b_land"] = came
    bodies["a_ox"] = bodies["b_ox"] = 1e9
    return bodies, prints


def stands_on(bodies: np.ndarray) -> tuple[int, int]:
    return int(bodies["a_print"][0]), int(bodies["b_print"][0])


@pytest.mark.parametrize(
    ("apart", "ago", "kept"),
    [
        (0.36, (50.0, 12.0), (0, -1)),
        (0.36, (12.0, 50.0), (-1, 1)),
        (0.30, (50.0, 12.0), (0, 1)),  # as far as people stand
        (0.36, (50.0, 8.0), (0, 1)),  # he may draw the other one in yet
        (0.36, (50.0, 47.0), (0, 1)),  # he came and stands astride
        (0.42, (50.0, 47.0), (0, -1)),  # nobody stands so
    ],
)
@pytest.mark.parametrize("shoes", [LEGS, SHOES])
def test_what_came_long_after_the_other_foot_and_far_from_it_was_put_there(
    apart: float, ago: tuple[float, float], kept: tuple[int, int], shoes: np.ndarray
) -> None:
    bodies, prints = standing(apart, *ago)
    assert release(bodies, prints, NOW, shoes, HIDDEN) == (-1 in kept)
    assert stands_on(bodies) == kept
    assert prints["given"].tolist() == [int(k < 0) for k in kept]


def test_a_foot_that_was_hidden_for_a_while_has_not_come_since() -> None:
    bodies, prints = standing(0.36, 50.0, 12.0)
    bodies["a_land"], prints["first"][0] = NOW - 11.0, NOW - 11.0
    assert release(bodies, prints, NOW, LEGS, HIDDEN) == 1
    assert stands_on(bodies) == (0, -1)


@pytest.mark.parametrize(
    ("fields", "shoes", "kept"),
    [
        ({"width": (0.08, 0.25)}, LEGS, (0, -1)),  # two legs side by side may look so wide
        ({"width": (0.08, 0.25), "whole": (5, 100)}, SHOES, (0, -1)),  # of the first hardly ever all is seen
        ({"covered": (0, 95)}, SHOES, (-1, 1)),  # the second stands behind something: the first was put before it
        ({"covered": (0, 95)}, LEGS, (0, -1)),
        ({"idle": (30.0, 0.0)}, LEGS, (-1, 1)),  # was nobody's most of the time
        ({"idle": (6.0, 0.0)}, LEGS, (0, -1)),  # was taken for nobody's for a while
    ],
)
def test_what_is_no_foot_by_its_looks_need_not_have_come_last(
    fields: dict[str, object], shoes: np.ndarray, kept: tuple[int, int]
) -> None:
    bodies, prints = standing(0.36, 50.0, 12.0, **fields)
    assert release(bodies, prints, NOW, shoes, HIDDEN) == 1
    assert stands_on(bodies) == kept


@pytest.mark.parametrize(
    ("before", "seen", "released"),
    [
        ((0.1, 0.1), HIDDEN, True),
        ((0.1, 0.1), FREE, False),  # he has put it elsewhere
        ((0.36, 0.0), HIDDEN, False),  # it has come back
    ],
)
def test_a_foot_that_is_gone_from_where_it_stood_was_put_elsewhere(
    before: tuple[float, float], seen: tuple[object, ...], released: bool
) -> None:
    bodies, prints = standing(0.36, 50.0, 12.0)
    bodies["b_ox"], bodies["b_oy"] = before
    assert release(bodies, prints, NOW, LEGS, seen) == released


@pytest.mark.parametrize(("before", "at"), [(0.2, 0.2), (0.6, 0.0), (0.02, 0.0)])
def test_his_other_foot_is_where_it_stood_before_the_thing_hid_it(before: float, at: float) -> None:
    """Unless that is where nobody's foot is: then behind the first."""
    bodies, prints = standing(0.36, 50.0, 12.0)
    bodies["b_ox"], bodies["b_oy"] = 0.0, before
    assert release(bodies, prints, NOW, LEGS, HIDDEN) == 1
    assert (bodies["bx"][0], bodies["by"][0]) == (0.0, at)
    assert (bodies["x"][0], bodies["y"][0]) == (0.0, 0.5 * at)


@pytest.mark.parametrize(("apart", "released"), [(0.3, 0), (0.4, 1)])
def test_who_stands_on_two_feet_side_by_side_keeps_both(apart: float, released: int) -> None:
    """One shoe shows its tip; a thing that is so thin lies farther off."""
    bodies, prints = empty(BODY, 1), empty(PRINT, 2)
    prints["used"], prints["first"], prints["last"], prints["width"] = 1, NOW - 3.0, NOW, (0.24, 0.06)
    prints["hits"] = prints["whole"] = prints["looks"] = 30
    bodies["used"] = bodies["confirmed"] = 1
    bodies["shoe"], bodies["bx"] = 0.6, apart
    bodies["a_seen"] = bodies["b_seen"] = NOW
    bodies["a_print"], bodies["b_print"] = 0, 1
    assert release(bodies, prints, NOW, LEGS, HIDDEN) == released


@pytest.mark.parametrize(
    ("width", "later_s", "stays"), [(0.24, 3.0, 0), (0.24, -3.0, 1), (0.24, 0.5, 1), (0.35, 3.0, 1)]
)
def test_both_legs_side_by_side_that_stood_there_first_are_no_thing(width: float, later_s: float, stays: int) -> None:
    """They look twice as wide as one; what was put down beside them is not whole in view."""
    bodies, prints = empty(BODY, 1), empty(PRINT, 2)
    prints["used"], prints["last"], prints["width"] = 1, NOW, (width, 0.06)
    prints["first"] = NOW - 10.0, NOW - 10.0 + later_s
    prints["hits"] = prints["looks"] = 30
    prints["whole"] = 30, 2
    bodies["used"] = bodies["confirmed"] = 1
    bodies["leg"], bodies["bx"], bodies["y"] = 0.12, 0.36, 0.0
    bodies["a_seen"] = bodies["b_seen"] = NOW
    bodies["a_print"], bodies["b_print"] = 0, 1
    assert release(bodies, prints, NOW, LEGS, HIDDEN) == 1
    assert {int(bodies["a_print"][0]), int(bodies["b_print"][0])} == {stays, -1}


@pytest.mark.parametrize(("idle", "given"), [(0.0, 0), (5.0, 1)])
def test_the_foot_of_another_is_not_put_there(idle: float, given: int) -> None:
    """Who seems to stand with one foot where somebody else stood all the time, or where a thing lay."""
    bodies, prints = empty(BODY, 1), empty(PRINT, 2)
    prints["used"], prints["first"], prints["last"], prints["width"] = 1, [NOW - 30.0, NOW - 30.0], NOW, 0.1
    prints["hits"] = prints["whole"] = prints["looks"] = 30
    prints["idle"] = [0.0, idle]
    bodies["used"] = bodies["confirmed"] = 1
    bodies["bx"], bodies["a_seen"], bodies["b_seen"] = 0.6, NOW, NOW
    bodies["a_land"], bodies["b_land"] = NOW - 30.0, NOW - 8.0
    bodies["a_print"], bodies["b_print"] = 0, 1
    assert release(bodies, prints, NOW, LEGS, HIDDEN) == 1
    assert prints["given"].tolist() == [0, given]


def test_a_shoe_seen_from_its_side_was_not_put_before_the_other_one() -> None:
    bodies, prints = standing(0.6, 50.0, 12.0, width=(0.25, 0.03), whole=(100, 0), covered=(0, 100))
    assert release(bodies, prints, NOW, SHOES, HIDDEN) == 1
    assert stands_on(bodies) == (0, -1)
