"""From the estimator's events to observations: how often, in which order, at what time, by whom."""

from __future__ import annotations

import itertools
import json
from datetime import UTC, datetime

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tms_agents.floor import Appeared, Back, Confused, FloorLabel, Moved, Vanished
from tms_agents.floor.labels import Labels
from tms_agents.floor.story import told
from tms_schemas.events import Near
from tms_schemas.observation import (
    LabelAppeared,
    LabelMoved,
    LabelVanished,
    MoverEntered,
    MoverLeft,
    MoverSwap,
    Transfer,
)

COV = (0.01, 0.0, 0.01)
SHIFT = 1_000_000.0


def labels(**options):
    numbers = itertools.count(1)
    return Labels(lambda: f"floor/{next(numbers)}", lambda t: datetime.fromtimestamp(t + SHIFT, UTC), **options)


def mover(t, label, xy=(1.0, 1.0), since=None, robot=False):
    return Appeared(t, label, "mover", xy, COV, robot, t if since is None else since)


def thing(t, label, xy, since, candidates=(), width=0.06):
    return Appeared(t, label, "object", xy, (1e-6, 0.0, 1e-6), False, since, candidates, width)


def at(observation):
    return observation.observed_at.timestamp() - SHIFT


def test_a_walk_is_told_now_and_then_and_where_it_ends():
    floor = labels()
    told = floor.observations([mover(10.0, 1, (0.0, 1.0), since=9.6)])
    assert isinstance(told[0], MoverEntered) and at(told[0]) == pytest.approx(9.6)
    places = []
    for n in range(1, 101):  # 1 m/s, 20 scans a second
        for one in floor.observations([Moved(10 + 0.05 * n, 1, (0.05 * n, 1.0), COV)]):
            assert isinstance(one, LabelMoved)
            places.append(one.xy[0])
    assert len(places) == pytest.approx(5.0 / 0.25, abs=1)
    assert max(b - a for a, b in itertools.pairwise([0.0, *places])) < 0.31
    floor.observations([Moved(15.1, 1, (5.04, 1.0), COV)])
    assert floor.rest(15.3) == []
    (rest,) = floor.rest(16.2)
    assert rest.xy == (5.04, 1.0) and rest.label == told[0].label
    assert floor.rest(17.0) == []


def test_a_slow_walker_is_told_every_half_second():
    floor = labels()
    floor.observations([mover(10.0, 1, (0.0, 1.0))])
    times = [
        at(one) for n in range(1, 101) for one in floor.observations([Moved(10 + 0.1 * n, 1, (0.02 * n, 1.0), COV)])
    ]
    assert min(b - a for a, b in itertools.pairwise(times)) > 0.45 and len(times) == pytest.approx(20, abs=2)


@given(st.lists(st.tuples(st.floats(0.01, 0.2), st.floats(-0.1, 0.1), st.floats(-0.1, 0.1)), max_size=80))
def test_what_was_told_is_never_far_from_what_is(steps):
    floor, t, x, y = labels(), 10.0, 0.0, 0.0
    (told,) = floor.observations([mover(t, 1, (x, y))])
    last = at(told)
    for dt, dx, dy in steps:
        t, x, y = t + dt, x + dx, y + dy
        for told in floor.observations([Moved(t, 1, (x, y), COV)]):
            assert at(told) > last
            last = at(told)
        assert ((told.xy[0] - x) ** 2 + (told.xy[1] - y) ** 2) ** 0.5 < 0.26
    told = [told, *floor.rest(t + 2.0)][-1]
    assert ((told.xy[0] - x) ** 2 + (told.xy[1] - y) ** 2) ** 0.5 < 0.03


def test_who_is_back_is_told_to_be_where_he_is():
    floor = labels()
    (met,) = floor.observations([mover(10.0, 1, (0.0, 1.0))])
    (back,) = floor.observations([Back(30.0, 1, (1.2, 1.0), COV)])
    assert isinstance(back, LabelMoved) and (back.label, back.xy) == (met.label, (1.2, 1.0))
    assert floor.movers[1].at(30.0) == (1.2, 1.0), "who may have taken something there"


def test_one_instant_is_told_in_the_order_of_the_wire():
    floor = labels()
    floor.observations([mover(1.0, 1), thing(1.0, 2, (1.2, 1.0), 1.0)])
    told = floor.observations(
        [
            thing(5.0, 3, (2.0, 2.0), 5.0),
            Moved(5.0, 1, (2.0, 1.0), COV),
            mover(5.0, 4, (4.0, 1.0)),
            Vanished(5.0, 2, 5.0, 5.0),
        ]
    )
    assert [type(one) for one in told] == [LabelVanished, LabelMoved, MoverEntered, LabelAppeared]
    assert len({one.observed_at for one in told}) == 1


def test_a_thing_is_told_for_when_it_was_put_and_by_whom():
    floor = labels()
    (walker,) = floor.observations([mover(1.0, 1)])
    (put,) = floor.observations([thing(9.0, 2, (1.2, 1.0), since=6.0, candidates=((1, 0.95),))])
    assert (at(put), put.source, put.kind, put.size_m) == (pytest.approx(6.0), walker.label, "floor", 0.06)
    assert put.cov[0] >= 2.5e-5, "nobody measures better than that"
    (unsure,) = floor.observations([thing(10.0, 3, (1.2, 2.0), since=8.0, candidates=((1, 0.7), (9, 0.2)))])
    assert unsure.source is None, "the server weighs who was near"
    (alone,) = floor.observations([thing(10.0, 4, (1.6, 2.0), since=8.0, candidates=((1, 0.7),))])
    assert alone.source == walker.label
    (far,) = floor.observations([thing(10.0, 5, (1.6, 2.5), since=8.0, candidates=((1, 0.4),))])
    assert far.source is None


def test_what_was_taken_unseen_is_told_for_when_the_taker_was_there():
    """Known 8 s later, because somebody stood before it: the cabinet that got it meanwhile must come after."""
    floor = labels()
    (walker,) = floor.observations([mover(1.0, 1, (4.0, 1.0))])
    (put,) = floor.observations([thing(3.0, 2, (1.0, 1.0), since=2.0)])
    for n in range(81):  # comes, is there at 6 s, goes
        floor.observations([Moved(2 + 0.1 * n, 1, (1.0 + abs(6.0 - (2 + 0.1 * n)), 1.0), COV)])
    (gone,) = floor.observations([Vanished(14.0, 2, 4.0, 14.0, ((1, 0.97),))])
    assert (gone.label, gone.dest) == (put.label, walker.label)
    assert at(gone) == pytest.approx(6.0, abs=0.11)


def test_a_taker_who_left_meanwhile_is_still_named():
    floor = labels()
    (walker,) = floor.observations([mover(1.0, 1)])
    floor.observations([thing(3.0, 2, (1.0, 1.0), since=2.0)])
    (left,) = floor.observations([Vanished(8.0, 1, 7.0, 8.0)])
    assert isinstance(left, MoverLeft)
    (gone,) = floor.observations([Vanished(20.0, 2, 0.5, 20.0, ((1, 0.97),))])
    assert gone.dest == walker.label and 2.0 < at(gone) < at(left)


def test_who_was_there_before_has_what_he_seemed_to_hold_under_another_label():
    floor = labels()
    entered = floor.observations([mover(10.0, 1), mover(11.0, 2, (2.0, 1.0))])
    (one,) = floor.observations([Vanished(12.0, 2, 11.9, 12.0, into=1)])
    assert isinstance(one, Transfer) and (one.from_, one.to) == (entered[1].label, entered[0].label)
    (left,) = floor.observations([Vanished(13.0, 1, 12.9, 13.0, into=7)])
    assert isinstance(left, MoverLeft) and left.label == entered[0].label


def test_who_may_have_been_exchanged_is_told_for_when_they_met():
    floor = labels()
    entered = floor.observations([mover(10.0, 1), mover(11.0, 2, (2.0, 1.0))])
    (one,) = floor.observations([Confused(30.0, 1, 2, 0.3, 20.0)])
    assert isinstance(one, MoverSwap) and (one.a, one.b, one.p) == (entered[0].label, entered[1].label, 0.3)
    assert at(one) == pytest.approx(20.0)
    # Of one who has left, too; never before both were there, nor before what an inventory tells.
    told = floor.observations([Vanished(31.0, 2, 30.9, 31.0), Confused(31.0, 1, 2, 0.2, 10.5)])
    assert [type(one) for one in told] == [MoverLeft, MoverSwap] and 11.0 < at(told[1]) < at(told[0])
    floor.inventory([FloorLabel(1, "mover", (1.0, 1.0), COV, 10.0, 32.0)], 32.0)
    floor.observations([mover(33.0, 3)])
    (late,) = floor.observations([Confused(34.0, 1, 3, 0.2, 20.0)])
    assert at(late) > 33.0
    floor.observations([mover(40.0, 4, robot=True)])
    assert floor.observations([Confused(41.0, 3, 4, 0.2, 40.5), Confused(41.0, 3, 9, 0.2, 40.5)]) == []


@pytest.mark.parametrize(("p", "since", "line"), [(0.3, 20.0, "30%"), (1.0, 20.0, "100%"), (1.0, 30.0, None)])
def test_people_read_who_may_have_been_exchanged_not_that_labels_are_given_back(p, since, line):
    found = told(Confused(30.0, 1, 2, p, since))
    assert found == (None if line is None else f"movers #1 and #2 may have been exchanged ({line})")


def test_robots_report_themselves_and_are_named_by_where_they_were():
    floor = labels()
    assert floor.observations([mover(1.0, 1, (3.0, 3.0), robot=True), Moved(2.0, 1, (1.1, 1.0), COV)]) == []
    (put,) = floor.observations([thing(4.0, 2, (1.0, 1.0), since=2.0, candidates=((1, 0.95),))])
    assert put.source == Near(xy=(1.1, 1.0))
    assert floor.observations([Vanished(9.0, 1, 8.0, 9.0)]) == []
    assert floor.inventory([FloorLabel(1, "mover", (1.0, 1.0), COV, 1.0, 9.0, robot=True)], 10.0) == []
    reporting = labels(tells_robots=True)
    (entered,) = reporting.observations([mover(1.0, 1, robot=True)])
    assert isinstance(entered, MoverEntered)


def test_an_inventory_is_the_last_word_on_what_was_before():
    """Something from before it that is told later is told for just after it, or the inventory would undo it."""
    floor = labels()
    floor.observations([mover(1.0, 1), thing(2.0, 2, (1.0, 1.0), since=1.5)])
    seen = [
        FloorLabel(1, "mover", (1.0, 1.0), COV, 1.0, 5.0),
        FloorLabel(2, "object", (1.0, 1.0), COV, 1.5, 5.0),
        FloorLabel(9, "object", (2.0, 2.0), COV, 1.5, 5.0),
    ]
    listed = floor.inventory(seen, 5.0)
    assert [(one.label, one.kind) for one in listed] == [
        ("floor/1", "mover"),
        ("floor/2", "floor"),
        ("floor/3", "floor"),
    ]
    (put,) = floor.observations([thing(6.0, 3, (3.0, 3.0), since=4.0)])
    (gone,) = floor.observations([Vanished(6.5, 2, 3.0, 6.5)])
    assert 5.0 < at(put) < 5.1 and at(gone) == pytest.approx(6.5)


def test_labels_survive_a_restart_and_are_never_used_again():
    floor = labels()
    floor.observations([mover(1.0, 1, (1.0, 1.0)), thing(2.0, 2, (3.0, 1.0), since=1.5)])
    saved = json.loads(json.dumps(floor.to_dict()))
    again = labels()
    again.restore(saved)
    told = again.observations([Moved(9.0, 1, (2.0, 1.0), COV), Vanished(9.0, 2, 8.0, 9.0)])
    assert {one.label for one in told} == {"floor/1", "floor/2"}
    for broken in ({}, {"things": {"x": 1}, "movers": {}}, {"things": [], "movers": {}}):
        with pytest.raises((KeyError, TypeError, ValueError, AttributeError)):
            labels().restore(broken)
