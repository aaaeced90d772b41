"""Names that were exchanged at a crossing are given back by how people look and walk."""

from __future__ import annotations

import numpy as np
import pytest

from tms_agents.floor.association.identity import christen, likeness, renamed, unite
from tms_agents.floor.feet.brightness import expected, learn
from tms_agents.floor.feet.build import beat, size_up
from tms_agents.floor.feet.clutter import costs
from tms_agents.floor.scan.clustered import ClusteredScan
from tms_agents.floor.scan.segmentation import CLUSTER
from tms_agents.floor.state import BODY, PRINT, empty


def walk(body, brightness: float, stance_s: float, scans: int = 200) -> None:
    """Seen for so many scans; a stance in ten."""
    for scan in range(scans):
        learn(body, brightness)
        if scan % 10 == 0:
            beat(body, stance_s, 0.5)


def people(*kinds: tuple[float, float]):
    """Bodies of (brightness, stance s) a metre apart, and who they are believed to be."""
    bodies = empty(BODY, len(kinds))
    for index, (body, kind) in enumerate(zip(bodies, kinds, strict=True)):
        body["used"] = body["confirmed"] = 1
        body["x"] = body["x0"] = index
        body["seen"] = body["sure"] = body["shoe"] = 1.0
        walk(body, *kind)
    return bodies, np.eye(len(kinds))


def meet(bodies, belief, worse: float) -> None:
    """The first two meet; that they went on the other way round is ``worse``."""
    of = np.arange(len(bodies))
    of[:2] = 1, 0
    unite(bodies, belief, bodies.copy(), belief.copy(), of, worse, expected(), np.empty((2, len(bodies))))


def names(bodies, belief) -> list[int]:
    found = np.zeros(len(bodies), np.int64)
    renamed(bodies, belief, 1.0, expected(), found)
    return found.tolist()


def test_names_stay_where_nothing_speaks_against_them() -> None:
    bodies, belief = people((7.4, 0.6), (6.9, 0.7), (7.1, 0.65))
    assert names(bodies, belief) == [0, 1, 2]
    meet(bodies, belief, 1.0)
    for body, kind in zip(bodies, ((7.4, 0.6), (6.9, 0.7), (7.1, 0.65)), strict=True):
        walk(body, *kind)
    assert names(bodies, belief) == [0, 1, 2]


def test_a_doubtful_meeting_leaves_a_doubt_and_a_clear_one_none() -> None:
    bodies, belief = people((7.0, 0.6), (7.0, 0.6))
    meet(bodies, belief, 6.0)
    assert belief.tolist() == np.eye(2).tolist()
    meet(bodies, belief, 0.0)
    assert belief == pytest.approx(0.5)


@pytest.mark.parametrize("kinds", [((7.3, 0.6), (7.1, 0.6)), ((7.0, 0.55), (7.0, 0.75))])
def test_names_are_given_back_by_brightness_or_by_the_beat_of_the_steps(kinds: tuple[tuple[float, float], ...]) -> None:
    bodies, belief = people(*kinds)
    meet(bodies, belief, 0.0)
    for body, kind in zip(bodies, kinds[::-1], strict=True):
        walk(body, *kind, scans=100)
    assert names(bodies, belief) == [1, 0]


def test_three_names_in_a_circle_are_given_back() -> None:
    kinds = ((7.4, 0.6), (7.1, 0.6), (6.8, 0.6))
    bodies, _ = people(*kinds)
    belief = np.full((3, 3), 1 / 3)
    for body, kind in zip(bodies, (kinds[1], kinds[2], kinds[0]), strict=True):
        body["look_n"] = 0
        walk(body, *kind, scans=40)
    assert names(bodies, belief) == [1, 2, 0]


def test_who_is_found_again_may_be_one_of_those_beside() -> None:
    bodies, belief = people((7.0, 0.6), (7.0, 0.6), (7.0, 0.6))
    bodies["x"][2] = bodies["x0"][2] = 9.0
    christen(bodies, belief, 0, 0.5, 0.0)
    assert belief[0, 1] > 0.0 < belief[1, 0]
    assert belief[0, 2] == belief[2, 0] == 0.0
    christen(bodies, belief, 0, np.nan, np.nan)
    assert belief.tolist() == np.eye(3).tolist()


def test_who_is_not_known_yet_is_like_anybody() -> None:
    bodies, _ = people((7.4, 0.6), (6.9, 0.7))
    bodies["own_n"][1] = bodies["own_stance_n"][1] = 0
    assert likeness(bodies[0], bodies[1], expected()) == 0.0
    assert likeness(bodies[1], bodies[0], expected()) < -2.0


def stride(body, width: float, cut: int = 0, sightings: int = 60) -> None:
    """A leg so wide, or a shoe so long from its side, is seen so often while somebody walks."""
    leg = np.zeros(1, CLUSTER)[0]
    leg["width"], leg["cut"], leg["ex"], leg["slant"], body["vx"] = width, cut, 1.0, 1.0, 1.0
    for _ in range(sightings):
        size_up(body, leg)


def two_walkers(*sizes: float) -> tuple[np.ndarray, np.ndarray]:
    """Two people who look and walk alike, but for their legs, 9 and 12 cm, or other ``sizes``, as of their shoes."""
    sizes = sizes or (0.09, 0.12)
    bodies, belief = people((7.0, 0.6), (7.0, 0.6))
    bodies["shoe"] = 1.0 if min(sizes) > 0.16 else 0.0
    for body, width in zip(bodies, sizes, strict=True):
        stride(body, width)
    return bodies, belief


@pytest.mark.parametrize("sizes", [(0.09, 0.12), (0.25, 0.28)])
@pytest.mark.parametrize("exchanged", [False, True])
def test_how_wide_legs_and_how_long_shoes_are_tells_who_is_who_after_a_meeting(
    sizes: tuple[float, float], exchanged: bool
) -> None:
    bodies, belief = two_walkers(*sizes)
    meet(bodies, belief, 0.0)
    names(bodies, belief)  # now nobody is sure who is who
    for body, width in zip(bodies, sizes[::-1] if exchanged else sizes, strict=True):
        stride(body, width)
    assert names(bodies, belief) == ([1, 0] if exchanged else [0, 1])


def test_names_exchanged_unnoticed_are_given_back_within_a_few_steps() -> None:
    bodies, belief = two_walkers(0.25, 0.28)
    assert names(bodies, belief) == [0, 1]
    for body, length in zip(bodies, (0.28, 0.25), strict=True):
        stride(body, length, sightings=25)
    assert names(bodies, belief) == [1, 0]


@pytest.mark.parametrize(("shoe", "cut", "told"), [(0.0, 0, True), (1.0, 0, False), (0.0, 1, False)])
def test_shoes_and_what_is_half_hidden_tell_no_width(shoe: float, cut: int, told: bool) -> None:
    bodies, belief = two_walkers()
    meet(bodies, belief, 0.0)
    names(bodies, belief)
    stride(bodies[0], 0.12, cut)
    bodies["shoe"] = shoe
    assert (likeness(bodies[0], bodies[0], expected()) < likeness(bodies[0], bodies[1], expected())) == told


@pytest.mark.parametrize(
    ("width", "cut", "dearer"), [(0.12, 0, True), (0.12, 1, False), (0.3, 0, False), (0.28, 0, True), (0.28, 1, False)]
)
def test_a_foot_of_another_size_than_his_is_less_likely_his(width: float, cut: int, dearer: bool) -> None:
    bodies, _ = two_walkers() if width in (0.12, 0.3) else two_walkers(0.25, 0.28)
    price = [_price(bodies, row, width, cut) for row in (0, 1)]
    assert (price[0] > price[1] + 0.5) == dearer


@pytest.mark.parametrize(("turned", "speed", "dearer"), [(1.2, 1.0, True), (0.1, 1.0, False), (1.2, 0.1, False)])
def test_a_shoe_that_points_another_way_than_he_goes_is_less_likely_his(
    turned: float, speed: float, dearer: bool
) -> None:
    bodies, _ = two_walkers(0.25, 0.25)
    bodies["vx"] = speed
    assert (_price(bodies, 0, 0.25, turned=turned) > _price(bodies, 0, 0.25) + 0.5) == dearer


def _price(bodies, row: int, width: float, cut: int = 0, turned: float = 0.0) -> float:
    """What it costs that a cluster so wide, which points so far from the x axis (rad), is a foot of the body."""
    clusters = np.zeros(1, CLUSTER)
    clusters["n"], clusters["width"], clusters["spacing"], clusters["cut"] = 10, width, 0.01, cut
    clusters["ex"], clusters["ey"], clusters["slant"] = np.cos(turned), np.sin(turned), 1.0
    cost = np.zeros((1, 3))
    bodies["x"] = bodies["ax"] = bodies["bx"] = 0.0
    bodies["a_seen"] = bodies["b_seen"] = 0.9
    bodies["a_print"] = bodies["b_print"] = -1
    scan = ClusteredScan(clusters, np.full(1, -1), np.full((1, 4), np.nan), empty(PRINT, 1), 1.0)
    costs(scan, np.ones(1, np.bool_), bodies, np.array([row]), cost)
    return float(cost[0, 0])
