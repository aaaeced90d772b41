"""Names that were exchanged at a crossing are given back by how people look and walk."""

from __future__ import annotations

import numpy as np
import pytest

from tms_agents.floor.gait import beat
from tms_agents.floor.identity import alike, christen, renamed, unite
from tms_agents.floor.shine import expected, learn
from tms_agents.floor.state import BODY, empty

VARIANCE = 0.01


def walk(body, brightness: float, stance_s: float, scans: int = 200) -> None:
    """Seen for so many scans; a stance in ten."""
    for scan in range(scans):
        learn(body, brightness, VARIANCE)
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
    bodies["own_n"][1] = bodies["own_pace_n"][1] = 0
    assert alike(bodies[0], bodies[1], expected()) == 0.0
    assert alike(bodies[1], bodies[0], expected()) < -2.0
