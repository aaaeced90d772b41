"""Who stands for minutes is one mover with two feet: no things are born under him, and what he leaves there is one."""

from __future__ import annotations

import math

import pytest
from floor_rooms import Circle, Room, thing, together, walker

from tms_agents.floor import Appeared, FloorEvent, Scene, Vanished

LEAVES = 160.0
#: Somebody comes in at the right, stands in the middle, and goes.
WAY = [(9.0, 4.9, 2.0), (12.0, 2.2, 2.0), (LEAVES, 2.2, 2.0), (LEAVES + 3.0, 4.9, 2.0)]


def born(events: list[FloorEvent], kind: str) -> list[Appeared]:
    return [event for event in events if isinstance(event, Appeared) and event.kind == kind]


def test_two_feet_that_stand_for_minutes_are_one_mover_and_no_things() -> None:
    estimator, events = Room(walker(WAY)).play(LEAVES)
    (who,) = born(events, "mover")
    assert [(one.id, one.stale) for one in estimator.labels()] == [(who.label, False)]
    estimator, more = Room(walker(WAY)).play(LEAVES + 9.0, estimator, start=LEAVES)
    assert [event.label for event in more if isinstance(event, Vanished)] == [who.label]
    assert not born([*events, *more], "object")
    assert not estimator.labels()


def test_a_leg_behind_the_other_for_minutes_is_still_there() -> None:
    """The laser looks from the corner; the second leg steps right behind the first."""

    def legs(t: float) -> list[Circle]:
        share = min(max((t - 14.0) / 0.5, 0.0), 1.0)
        return [(2.15, 2.15, 0.05), (2.1 + 0.2 * share, 2.42 - 0.1 * share, 0.05)] if t >= 12.0 else []

    comes = walker([(9.0, 4.9, 2.2), (12.0, 2.2, 2.2)])
    estimator, events = Room(together(comes, legs)).play(LEAVES)
    (who,) = born(events, "mover")
    assert [one.id for one in estimator.labels()] == [who.label]


@pytest.mark.parametrize("xy", [(1.75, 2.0), (2.2, 2.45)])
def test_what_is_put_down_beside_who_stands_is_a_thing_and_he_stays(xy: tuple[float, float]) -> None:
    estimator, events = Room(together(walker(WAY), thing(*xy, 0.05, 60.0))).play(LEAVES + 9.0)
    (who,) = born(events, "mover")
    (put,) = born(events, "object")
    assert put.t < 66.0
    assert put.candidates[0][0] == who.label
    assert math.dist(put.xy, xy) < 0.02
    assert [one.id for one in estimator.labels()] == [put.label]


def test_what_lay_between_his_feet_is_a_thing_when_he_has_gone() -> None:
    estimator, events = Room(together(walker(WAY), thing(2.2, 2.0, 0.04, 100.0))).play(LEAVES + 40.0)
    assert len(born(events, "mover")) == 1
    (left,) = estimator.labels()
    assert left.kind == "object"
    assert math.dist(left.xy, (2.2, 2.0)) < 0.02


@pytest.mark.parametrize("lifted", [11.7, 12.1])
def test_who_walks_to_the_bed_and_sits_down_keeps_the_label(lifted: float) -> None:
    """He goes on quickly until his feet are lifted, one of them nearer to the bed than the other."""
    bed = [(0.2, 0.3), (1.2, 0.3), (1.2, 2.3), (0.2, 2.3)]
    comes = walker([(9.0, 4.9, 0.7), (12.4, 0.4, 1.3)])
    gets_up = walker([(40.0, 1.3, 1.2), (41.0, 1.3, 1.2), (44.0, 4.0, 2.0)])

    def feet(t: float) -> list[Circle]:
        return [*(comes(t) if t < lifted else ()), *gets_up(t)]

    scene = Scene(region=[(0, 0), (5, 0), (5, 4), (0, 4)], seats=[bed])
    estimator, events = Room(feet).play(44.0, scene=scene)
    (who,) = born(events, "mover")
    assert [one.id for one in estimator.labels()] == [who.label]
