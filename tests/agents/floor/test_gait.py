"""Where a body is over its feet."""

from __future__ import annotations

import numpy as np
import pytest

from tms_agents.floor.bodies import begin
from tms_agents.floor.gait import foot, middle, swap
from tms_agents.floor.segmentation import CLUSTER
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


def test_nothing_seen_tells_nothing() -> None:
    assert np.isinf(middle(walker(1.0, 1.0), 5.0)[2])
