"""What has become as wide as furniture is a robot, or furniture when it stands; not before it can be told."""

from __future__ import annotations

import numpy as np
import pytest

from tms_agents.floor.feet.bodies import misled
from tms_agents.floor.movers.review import THING, Waits, review
from tms_agents.floor.robots.recognizing import recognize, sizes
from tms_agents.floor.scan.background import BACKGROUND
from tms_agents.floor.state import BODY, empty

NOW = 100.0
OPEN = (np.full(101, 8.0), np.full(101, BACKGROUND, np.int8), np.full(101, 8.0), np.zeros(3), -0.5, 0.01)


def wide(share: float, **fields: float) -> np.ndarray:
    """It came from 2 m away, like two feet from afar, took no steps, and was 0.5 m wide in such a share of late."""
    bodies = empty(BODY, 1)
    seen = {"used": 1, "confirmed": 1, "label": 1, "hits": 300, "looks": 300, "both": 90, "seen": NOW, "a_seen": NOW}
    looks = {
        "wide": share,
        "far": 0.5,
        "width": 0.5,
        "x0": 2.0,
        "walked_x": 2.0,
        "x": 4.0,
        "ax": 4.0,
        "quality": 1.0,
        "b_seen": -1e9,
    }
    for name, value in (seen | looks | {"a_print": -1, "b_print": -1, "told_x": 4.0, "rest_x": 4.0} | fields).items():
        bodies[name] = value
    return bodies


def test_a_robot_that_comes_near_is_told_before_it_is_taken_for_furniture() -> None:
    """The share in which it was wide grows from scan to scan."""
    for share in np.arange(0.3, 1.0, 0.01):
        bodies = wide(share)
        if recognize(bodies, *sizes(())):
            break
        assert not misled(bodies[0])
    assert bodies["robot"][0] == 1


@pytest.mark.parametrize(("walked_x", "robot"), [(2.0, True), (3.5, False)])
def test_who_walked_and_is_wide_since_is_a_robot_only_if_it_goes_on(walked_x: float, robot: bool) -> None:
    """Who pushes something is one thing with it for a while, and leaves it there."""
    bodies = wide(0.9, both=20, own_stance_n=5, walked_x=walked_x)
    assert recognize(bodies, *sizes(())) == robot


def test_what_is_wide_and_no_robot_is_furniture() -> None:
    assert misled(wide(0.7, pushed=0.9)[0])
    assert not misled(wide(0.7, both=10)[0])


@pytest.mark.parametrize(("rests_s", "furniture"), [(8.0, True), (0.5, False)])
def test_what_goes_is_not_parked_however_long_ago_it_landed(rests_s: float, furniture: bool) -> None:
    bodies, actions = wide(0.6, both=10, a_since=NOW - 9.0, rest_at=NOW - rests_s), np.zeros(1, np.int64)
    waits = Waits(confirm_s=0.5, confirm_m=0.3, leave_s=1.0, hidden_s=60.0, stale_s=1.0)
    review(bodies, NOW, 0.1, OPEN, waits, actions, False, True, False)
    assert (actions[0] == THING) == furniture
