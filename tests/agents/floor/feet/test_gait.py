"""Where a body is over its feet."""

from __future__ import annotations

import numpy as np
import pytest

from tms_agents.floor.feet.bodies import begin
from tms_agents.floor.feet.gait import foot, middle, swap
from tms_agents.floor.scan.segmentation import CLUSTER
from tms_agents.floor.state import BODY, PRINT, empty


def cluster(x: float, y: float):
    found = np.zeros(1, CLUSTER)
    found["x"], found["y"], found["width"], found["n"] = x, y, 0.1, 8
    return found[0]


def walker(x: float, y: float):
    body = empty(BODY, 1)[0]
    begin(body, cluster(x, y), -1, 0.0)
    return body


def see(body, left, right, t: float, step: int = -1) -> None:
    """Both feet; the first on a print of its own where it takes a step."""
    prints = empty(PRINT, 8)
    prints["first"] = t
    foot(body, cluster(*left), 0.0, step, prints, t)
    swap(body)
    foot(body, cluster(*right), 0.0, -1, prints, t)
    swap(body)


def test_who_stands_is_between_the_feet() -> None:
    body = walker(1.0, 1.0)
    for t in range(4):
        see(body, (1.0, 1.0), (1.0, 1.2), float(t))
    x, y, variance, *_ = middle(body, 3.0)
    assert (x, y) == pytest.approx((1.0, 1.1), abs=0.01)
    assert variance < 0.1**2


def test_a_foot_that_swings_tells_where_the_body_goes() -> None:
    body = walker(1.0, 1.0)
    times = np.arange(13) / 10
    for t in times[:10]:
        see(body, (1.0, 1.0), (1.0, 1.2), t)
    for k in range(1, 4):
        see(body, (1.0 + 0.25 * k, 1.0), (1.0, 1.2), times[9 + k], step=k)
    x, _, _, vx, vy, variance = middle(body, times[12])
    assert 1.2 < x < 1.75
    assert 0.5 < vx < 1.6 and abs(vy) < 0.3
    assert np.isfinite(variance)


def shod(x: float, y: float):
    body = walker(x, y)
    body["shoe"] = 1.0
    return body


def strides(body, t: float = 1.0) -> float:
    """From standing the second foot lands 0.7 m ahead after 0.5 s: when that is."""
    for k in range(int(10 * t)):
        see(body, (1.0, 1.0), (1.0, 1.2), k / 10)
    for k in range(4):
        see_one(body, (1.0, 1.0), t + k / 10)
    t += 0.4
    see(body, (1.0, 1.0), (1.7, 1.2), t)
    return t


def leaves_one_foot(step: float, seconds: float):
    """Who stands on one foot for 1.5 s, and has stood on the other one, so far (m) ahead, for some seconds, too."""
    body = shod(1.0, 1.0)
    for k in range(15):
        see_one(body, (1.0, 1.0), k / 10)
    for k in range(15, 15 + round(10 * seconds)):
        see(body, (1.0, 1.0), (1.0 + step, 1.0), k / 10)
    return body


def see_one(body, xy, t: float) -> None:
    prints = empty(PRINT, 8)
    prints["first"] = t
    foot(body, cluster(*xy), 0.0, -1, prints, t)


@pytest.mark.parametrize("rolled", [0.05, 0.14, 0.19, 0.25])
def test_a_shoe_that_rolls_off_has_not_landed_anew(rolled: float) -> None:
    body = shod(1.0, 1.0)
    t = strides(body)
    see(body, (1.0 + rolled, 1.0), (1.7, 1.2), t + 0.1)
    assert body["a_land"] < body["b_land"]
    assert middle(body, t + 0.1)[0] > 1.4


def test_a_shoe_that_was_up_and_is_seen_elsewhere_has_landed() -> None:
    body = shod(1.0, 1.0)
    t = strides(body)
    for k in range(1, 5):
        swap(body)
        see_one(body, (1.7, 1.2), t + k / 10)
        swap(body)
    see(body, (1.25, 1.0), (1.7, 1.2), t + 0.5)
    assert body["a_land"] == t + 0.5


def test_who_does_not_put_down_the_other_shoe_stops() -> None:
    body = shod(1.0, 1.0)
    t = strides(body)
    ahead = []
    for k in range(1, 9):
        swap(body)
        see_one(body, (1.7, 1.2), t + k / 10)
        swap(body)
        ahead.append(middle(body, t + k / 10))
    going, late = ahead[3], ahead[-1]
    assert going[0] > 1.65 > late[0] > 1.5
    assert late[3] == 0.0 and np.isfinite(late[5])


@pytest.mark.parametrize(("step", "over"), [(0.7, 1.35), (1.0, 2.0)])
def test_who_steps_farther_than_anybody_stands_has_left_a_thing_behind(step: float, over: float) -> None:
    body = leaves_one_foot(step, seconds=0.7)
    assert middle(body, 2.1)[0] == pytest.approx(over, abs=0.05)


@pytest.mark.parametrize(("step", "stays"), [(0.4, True), (0.9, False)])
def test_who_lifts_the_foot_that_is_ahead_does_not_come_back_to_what_he_has_left(step: float, stays: bool) -> None:
    body = leaves_one_foot(step, seconds=0.3)
    for k in range(18, 21):
        see_one(body, (1.0, 1.0), k / 10)
    assert np.isfinite(middle(body, 2.0)[2]) == stays


def test_nothing_seen_tells_nothing() -> None:
    assert np.isinf(middle(walker(1.0, 1.0), 5.0)[2])
