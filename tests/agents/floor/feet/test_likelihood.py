"""Whose foot a cluster is: what is left of a shoe on both sides of something before it is one shoe."""

from __future__ import annotations

import numpy as np
import pytest
from floor_prints import shows

from tms_agents.floor.feet.clutter import costs, goes_on
from tms_agents.floor.feet.likelihood import feet, waits
from tms_agents.floor.scan.segmentation import CLUSTER, FADES
from tms_agents.floor.state import BODY, CONCEALED, NEVER, PRINT, empty

BEHIND_SOMETHING_NEW = 2


def parts(apart: float, widths: tuple[float, float], beams: int, cut: int, mirror: int = -1):
    """Two clusters so far from each other (m), with so many beams between them; the second is seen in ``mirror``."""
    clusters = np.zeros(2, CLUSTER)
    clusters["x"], clusters["y"] = 2.0, (-0.5 * apart, 0.5 * apart)
    clusters["width"], clusters["cut"], clusters["n"] = widths, cut, 4
    clusters["first"], clusters["last"] = (10, 14 + beams), (13, 17 + beams)
    clusters["mirror"] = (-1, mirror)
    clusters["near"], clusters["spacing"] = 2.0, 0.012
    return clusters


def of_nobody(clusters, shoes: bool = True) -> list[float]:
    """What it costs that each is nobody's foot, while somebody walks there."""
    bodies = empty(BODY, 1)
    bodies["used"] = bodies["confirmed"] = 1
    bodies["x"], bodies["pp"], bodies["shoe"] = 2.0, 0.01, float(shoes)
    count = clusters.size
    cost = np.zeros((count, 2 + count))
    costs(shows(clusters, empty(PRINT, 1), 5.0), np.ones(count, np.bool_), bodies, np.zeros(1, np.int64), cost)
    return [float(cost[i, 2 + i]) for i in range(count)]


def test_the_smaller_part_of_a_shoe_whose_middle_is_hidden_need_not_be_somebodys_foot() -> None:
    larger, smaller = of_nobody(parts(0.18, (0.1, 0.06), 12, BEHIND_SOMETHING_NEW))
    assert smaller < larger - 5.0


def test_one_of_two_equal_parts_is_the_shoe() -> None:
    prices = of_nobody(parts(0.18, (0.07, 0.07), 12, BEHIND_SOMETHING_NEW))
    assert min(prices) < max(prices) - 5.0


def test_of_something_dark_single_beams_bring_nothing() -> None:
    assert min(of_nobody(parts(0.15, (0.1, 0.06), 3, FADES))) < 5.0
    assert min(of_nobody(parts(0.15, (0.1, 0.06), 3, 0))) < 5.0


@pytest.mark.parametrize(
    "two",
    [
        parts(0.18, (0.1, 0.06), 12, 0),  # nothing is before them
        parts(0.26, (0.1, 0.08), 20, BEHIND_SOMETHING_NEW),  # longer than a shoe
        parts(0.12, (0.1, 0.06), 0, BEHIND_SOMETHING_NEW),  # one beside the other
        parts(0.18, (0.1, 0.06), 60, BEHIND_SOMETHING_NEW),  # far from each other as the laser sees it
        parts(0.18, (0.1, 0.06), 12, BEHIND_SOMETHING_NEW, mirror=0),
    ],
    ids=["in view", "too long", "beside", "far", "mirror"],
)
def test_two_feet_are_two_feet(two) -> None:
    assert min(of_nobody(two)) > 10.0


def test_no_leg_is_as_long_as_a_shoe() -> None:
    assert min(of_nobody(parts(0.18, (0.1, 0.06), 12, BEHIND_SOMETHING_NEW), shoes=False)) > 10.0
    assert min(of_nobody(parts(0.08, (0.06, 0.05), 3, FADES), shoes=False)) < 5.0


def test_what_has_stood_under_one_foot_is_not_where_the_other_has_landed_long_ago() -> None:
    t, rested = 10.0, 1.7
    bodies, prints, clusters = empty(BODY, 1), empty(PRINT, 1), np.zeros(1, CLUSTER)
    # She goes on; one foot was seen just now, the other is taken to stand far behind, where she was long ago.
    body = bodies[0]
    body["used"] = body["confirmed"] = body["shoe"] = 1
    body["at"], body["x"], body["vx"], body["pp"], body["stride"] = t, 1.2, 0.9, 0.02, 0.6
    body["ax"], body["a_seen"], body["a_print"], body["a_land"] = 1.0, t - 0.1, -1, t - 0.6
    body["bx"], body["b_seen"], body["b_print"] = 0.1, t - 0.1, 0
    body["b_land"] = body["b_since"] = t - rested
    print_ = prints[0]
    print_["used"], print_["x"], print_["first"], print_["rested"], print_["last"] = 1, 0.1, t - rested, t - rested, t
    print_["owner"], print_["whose"], print_["owned"] = 0, int(body["label"]), t - 0.1
    clusters["x"], clusters["width"], clusters["n"], clusters["mirror"] = 0.1, 0.13, 6, -1
    cost, one = np.zeros((1, 3)), np.zeros(1, np.int64)
    costs(shows(clusters, prints, t, 0), np.ones(1, np.bool_), bodies, one, cost)
    landed, stands = cost[0, 0], cost[0, 1]
    assert stands < landed - 2.0


@pytest.mark.parametrize("shoe", [0.0, 1.0])
@pytest.mark.parametrize(
    ("away", "speed", "seen", "may"),
    [
        (0.8, 0.0, 0.1, True),
        (1.2, 0.0, 0.1, False),
        (1.2, 0.6, 0.1, True),  # walks
        (1.2, 0.0, 0.6, True),  # nobody sees where the other foot is now
    ],
)
def test_who_stands_with_one_foot_in_view_steps_no_farther_than_a_metre(
    shoe: float, away: float, speed: float, seen: float, may: bool
) -> None:
    t = 10.0
    bodies, prints, clusters = empty(BODY, 1), empty(PRINT, 1), np.zeros(1, CLUSTER)
    body = bodies[0]
    body["used"] = body["confirmed"] = 1
    body["shoe"], body["at"], body["vx"], body["pp"], body["stride"] = shoe, t, speed, 0.02, 0.6
    body["a_seen"], body["a_land"], body["a_print"] = t - 9.0, -1e9, -1
    body["b_seen"], body["b_land"], body["b_print"] = t - seen, t - 8.0, 0
    clusters["x"], clusters["width"], clusters["n"], clusters["mirror"] = away, 0.1, 6, -1
    cost = np.zeros((1, 2))
    feet(shows(clusters, prints, t), np.ones(1, np.bool_), bodies, 0, cost)
    assert bool(cost[0, 0] < 100.0) == may


@pytest.mark.parametrize(
    ("shoe", "since", "nobodys_at", "costs_less"),
    [
        (1.0, 1.0, 4.9, True),
        (1.0, 1.0, 4.5, False),  # somebody's since
        (1.0, 4.95, 4.9, False),  # that was another print
        (0.0, 1.0, 4.9, False),  # legs
    ],
)
def test_whoever_came_unknown_is_paid_for_once(shoe: float, since: float, nobodys_at: float, costs_less: bool) -> None:
    bodies, prints, clusters = empty(BODY, 1), empty(PRINT, 1), np.zeros(1, CLUSTER)
    bodies["used"] = bodies["confirmed"] = 1
    bodies["shoe"], prints["used"], prints["first"] = shoe, 1, since
    cost = np.full((1, 1), 11.0)
    goes_on(shows(clusters, prints, 5.0, 0), bodies, np.array([nobodys_at]), cost)
    assert bool(cost[0, 0] < 11.0) == costs_less


@pytest.mark.parametrize(("seen", "expected"), [(100.0, True), (0.0, True), (-100.0, True), (NEVER, False)])
def test_where_a_foot_was_seen_last_its_owner_waits_whatever_time_it_was(seen: float, expected: bool) -> None:
    body, cluster = empty(BODY, 1)[0], np.zeros(1, CLUSTER)[0]
    body["used"], body["stale"], body["a_seen"], body["b_seen"] = 1, CONCEALED, seen, NEVER
    assert waits(body, cluster) == expected
