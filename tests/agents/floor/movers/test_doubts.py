"""Who met may have been exchanged: it is told how likely, once, for when they met; and when labels change back."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tms_agents.floor import Confused, FloorEvent, Moved, Vanished
from tms_agents.floor.feet.brightness import expected
from tms_agents.floor.movers.doubts import Doubts
from tms_agents.floor.state import BODY, empty

MET = 100.0
#: How likely each of three is who has each name.
NO_DOUBT = np.eye(3)


def doubt(p: float) -> np.ndarray:
    """The first two may have been exchanged."""
    belief = np.eye(3)
    belief[:2, :2] = [[1.0 - p, p], [p, 1.0 - p]]
    return belief


def people(apart: float = 3.0, **fields: float) -> Any:
    """Three, labels 7, 4 and 9; the first two so far (m) from each other; ``fields`` of the first one are so."""
    bodies = empty(BODY, 3)
    bodies["own_n"] = 100
    bodies["used"] = bodies["confirmed"] = 1
    bodies["label"], bodies["x"] = (7, 4, 9), (0.0, apart, 20.0)
    for name, value in fields.items():
        bodies[name][0] = value
    return bodies


def meet(doubts: Doubts, t: float = MET, belief: np.ndarray = NO_DOUBT, **fields: float) -> None:
    """The first two pass each other; at t they are nearest. What was in doubt still is."""
    for step in range(-10, 11):
        bodies = people(0.4 + 0.2 * abs(step), **fields)
        assert doubts.look(bodies, belief, expected(), t + 0.25 * step) == []


def later(doubts: Doubts, belief: np.ndarray, since: float, until: float) -> list[Confused]:
    """What is told in that time of people who are apart."""
    times = np.arange(since, until, 0.25)
    return [one for t in times for one in doubts.look(people(), belief, expected(), float(t))]


def exchanged(told: list[Confused]) -> float:
    """How likely it is after all of that that they are exchanged."""
    p = 0.0
    for one in told:
        p = p * (1.0 - one.p) + one.p * (1.0 - p)
    return p


def test_it_is_told_once_when_they_met_and_how_likely_it_is() -> None:
    doubts = Doubts(3)
    meet(doubts)
    (one,) = later(doubts, doubt(0.3), MET + 3.0, MET + 60.0)
    assert (one.label, one.other, one.since) == (4, 7, MET)
    assert one.t == pytest.approx(MET + 10.0, abs=0.3)
    assert one.p == pytest.approx(0.3)


@pytest.mark.parametrize(("p", "robot"), [(0.0, 0), (0.01, 0), (0.3, 1)])
def test_who_met_without_a_doubt_is_not_exchanged_and_nobody_is_a_robot(p: float, robot: int) -> None:
    doubts = Doubts(3)
    meet(doubts, robot=robot)
    bodies = people(robot=robot)
    assert all(doubts.look(bodies, doubt(p), expected(), MET + 3.0 + step) == [] for step in range(60))


@pytest.mark.parametrize(
    ("fields", "alike"),
    [({}, False), ({"shoe": 1.0, "own_n": 0}, True), ({"shoe": 1.0}, False), ({"own_n": 0}, False)],
    ids=["legs that are known", "shoes like any", "shoes that are known", "legs like any"],
)
def test_who_meets_in_shoes_like_any_may_have_been_exchanged_unnoticed(fields: dict[str, float], alike: bool) -> None:
    doubts = Doubts(3)
    for number in (1, 2):
        meet(doubts, number * MET, **fields)
        told = later(doubts, NO_DOUBT, number * MET + 3.0, number * MET + 60.0)
        assert [(one.p, one.since) for one in told] == ([(0.035, number * MET)] if alike else [])


def test_who_stays_together_meets_once() -> None:
    doubts, bodies = Doubts(3), people(0.6, shoe=1.0, own_n=0)
    told = [one for step in range(400) for one in doubts.look(bodies, NO_DOUBT, expected(), MET + 0.25 * step)]
    assert [one.p for one in told] == [0.035]


def test_a_doubt_about_two_who_did_not_meet_is_told_for_when_it_began() -> None:
    doubts = Doubts(3)
    assert later(doubts, NO_DOUBT, 0.0, MET) == []
    (one,) = later(doubts, doubt(0.4), MET, MET + 60.0)
    assert one.since == pytest.approx(MET) and one.p == pytest.approx(0.4)


def test_two_who_stay_together_are_told_too() -> None:
    doubts, bodies = Doubts(3), people(0.6)
    told = [one for step in range(400) for one in doubts.look(bodies, doubt(0.2), expected(), MET + 0.25 * step)]
    assert len(told) == 1 and told[0].since <= MET + 10.0


@given(st.lists(st.floats(0.0, 0.5), min_size=1, max_size=6))
def test_what_is_told_of_several_meetings_comes_to_the_largest_doubt_there_was(beliefs: list[float]) -> None:
    """As long as there is one: a doubt can be added, never taken back."""
    doubts, told, most, belief = Doubts(3), list[Confused](), 0.0, NO_DOUBT
    for number, p in enumerate(max(p, 0.1) for p in beliefs):
        meet(doubts, MET * (number + 1), belief)
        belief = doubt(p)
        told += later(doubts, doubt(p), MET * (number + 1) + 3.0, MET * (number + 1) + 30.0)
        most = max(most, p)
        assert most - 0.02 - 1e-3 <= exchanged(told) <= most + 1e-3
        assert all(0.0 < one.p <= 1.0 for one in told)


def test_a_doubt_that_is_over_makes_room_for_another_one() -> None:
    doubts = Doubts(3)
    meet(doubts)
    assert len(later(doubts, doubt(0.4), MET + 3.0, MET + 20.0)) == 1
    meet(doubts, 2 * MET, doubt(0.03))
    assert later(doubts, doubt(0.03), 2 * MET + 3.0, 2 * MET + 20.0) == []
    meet(doubts, 3 * MET, doubt(0.03))
    (one,) = later(doubts, doubt(0.3), 3 * MET + 3.0, 3 * MET + 20.0)
    assert one.since == 3 * MET and one.p == pytest.approx((0.3 - 0.03) / (1.0 - 0.06), abs=1e-3)


@pytest.mark.parametrize("p", [0.0, 0.6, 0.9])
def test_labels_that_are_given_back_had_been_exchanged_and_are_exchanged_again(p: float) -> None:
    """What happened in between was done by who did it; what is told after all is how unsure it was."""
    doubts = Doubts(3)
    meet(doubts)
    assert later(doubts, doubt(p), MET + 3.0, MET + 6.0) == []
    met, now = doubts.given_back([(7, 4)], MET + 6.0)
    assert (met.label, met.other, met.since, met.t) == (4, 7, MET, MET + 6.0)
    assert met.p == pytest.approx({0.0: 0.5, 0.6: 0.6, 0.9: 0.7}[p])
    assert (now.label, now.other, now.since, now.t, now.p) == (4, 7, MET + 6.0, MET + 6.0, 1.0)
    assert later(doubts, NO_DOUBT, MET + 6.0, MET + 60.0) == []
    # And another meeting is told by itself.
    meet(doubts, 3 * MET)
    (one,) = later(doubts, doubt(0.3), 3 * MET + 3.0, 3 * MET + 20.0)
    assert one.p == pytest.approx(0.3)


@pytest.mark.parametrize("into", [None, 9])
def test_of_who_leaves_it_is_told_before_unless_he_was_somebody_else(into: int | None) -> None:
    doubts = Doubts(3)
    meet(doubts)
    assert later(doubts, doubt(0.3), MET + 3.0, MET + 5.0) == []
    events: list[FloorEvent] = [
        Moved(MET + 5.0, 4, (0.0, 0.0), (1.0, 0.0, 1.0)),
        Vanished(MET + 5.0, 7, MET, MET, into=into),
    ]
    told = doubts.gone(events, MET + 5.0)
    assert [(one.p, one.since) for one in told] == ([] if into else [(pytest.approx(0.3), MET)])
    assert doubts.gone(events, MET + 5.0) == []
    assert doubts.save()["doubts"] == []


def test_it_goes_on_as_it_was_saved() -> None:
    doubts, again = Doubts(3), Doubts(3)
    meet(doubts)
    later(doubts, doubt(0.3), MET + 3.0, MET + 30.0)
    meet(doubts, 2 * MET)
    again.restore(json.loads(json.dumps(doubts.save())))
    assert again.save() == doubts.save()
    assert later(again, doubt(0.45), 2 * MET + 3.0, 3 * MET) == later(doubts, doubt(0.45), 2 * MET + 3.0, 3 * MET) != []


def test_whom_else_they_met_is_told_before_their_labels_change() -> None:
    doubts, bodies = Doubts(3), people(0.6)
    bodies["x"][2] = 0.8
    assert doubts.look(bodies, doubt(0.3), expected(), MET) == []
    belief = np.array([[0.5, 0.3, 0.2], [0.3, 0.7, 0.0], [0.2, 0.0, 0.8]])
    assert doubts.look(people(), belief, expected(), MET + 1.0) == []
    told = doubts.given_back([(7, 4)], MET + 1.5)
    assert [(one.label, one.other, one.p) for one in told] == [
        (7, 9, pytest.approx(0.4 / 1.7, abs=1e-4)),
        (4, 7, 0.5),
        (4, 7, 1.0),
    ]


@pytest.mark.parametrize("saved", [None, {"looked": 1.0}, {"looked": 1.0, "doubts": [[1, 2]]}, {"looked": "x"}])
def test_what_was_not_saved_is_refused(saved: Any) -> None:
    with pytest.raises((KeyError, TypeError, ValueError)):
        Doubts(3).restore(saved)
