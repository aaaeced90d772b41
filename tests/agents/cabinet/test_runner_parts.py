"""The parts between devices and estimator, each by its law: frames, clocks, zeros, rounds, whose turn it is, labels."""

from __future__ import annotations

import itertools
import math
from datetime import UTC, datetime

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tms_agents.cabinet import Appeared, Identified, LoadChanged, Moved, Stay, Vanished, Weighed, ZoneRead
from tms_agents.cabinet.continuity import Continuity
from tms_agents.cabinet.field_turns import FieldTurns
from tms_agents.cabinet.frames import BoardPose
from tms_agents.cabinet.labels import Labels
from tms_agents.cabinet.rounds import Rounds
from tms_agents.clocks import Clocks
from tms_agents.devices.tags import Field, RoundEnd, TagRead

angles = st.floats(-7, 7)
lengths = st.floats(-5, 5)
variances = st.floats(1e-6, 1.0)


@given(lengths, lengths, angles, lengths, lengths)
def test_a_pose_keeps_distances_and_turns(x, y, theta, a, b):
    pose = BoardPose(x, y, theta)
    assert math.dist(pose.point((0, 0)), pose.point((a, b))) == pytest.approx(math.hypot(a, b), abs=1e-9)
    assert pose.point((0, 0)) == (x, y)


@given(angles, variances, variances, st.floats(-0.99, 0.99))
def test_a_covariance_turns_with_the_board(theta, xx, yy, correlation):
    xy = correlation * math.sqrt(xx * yy)
    turned = BoardPose(3.0, -1.0, theta).covariance((xx, xy, yy))
    turn = np.array([[math.cos(theta), -math.sin(theta)], [math.sin(theta), math.cos(theta)]])
    expected = turn @ np.array([[xx, xy], [xy, yy]]) @ turn.T
    assert turned == pytest.approx((expected[0, 0], expected[0, 1], expected[1, 1]), abs=1e-12)


@given(st.lists(st.tuples(st.floats(0, 10), st.floats(-1e5, 1e5)), min_size=1, max_size=30))
def test_times_never_go_back_whatever_the_clock_does(steps):
    even, unix = 100.0, 1.7e9
    clocks = Clocks(lambda: unix, lambda: even)
    before, told = clocks.now(), clocks.utc(clocks.now())
    for elapsed, jump in steps:
        even, unix = even + elapsed, unix + elapsed + jump
        assert clocks.now() == pytest.approx(before + elapsed, abs=1e-6)
        at = clocks.utc(clocks.now())
        assert at >= told
        assert at.timestamp() == pytest.approx(unix + clocks.ahead_s, abs=1e-3)
        before, told = clocks.now(), at


def test_sensor_time_goes_on_after_the_last_run():
    assert Clocks(lambda: 1000.0, lambda: 5.0, after=2000.0).now() > 2000.0
    assert Clocks(lambda: 3000.0, lambda: 5.0, after=2000.0).now() == 3000.0


def interrupted(before, after, *, zeroes_itself=False):
    """What a load reads as before and after an interruption."""
    continuity = Continuity(2, zeroes_itself=zeroes_itself)
    for n in range(50):
        last = continuity.take(n * 0.02, before)
    continuity.interrupted()
    later = [continuity.take(9 + n * 0.02, after) for n in range(50)]
    assert later[0] is None and later[-1] is not None
    return last, later[-1]


def test_zeros_that_jump_at_power_on_are_no_change():
    assert interrupted([500.0, 300.0], [508.0, 291.0]) == ([500.0, 300.0], [500.0, 300.0])
    assert interrupted([500.0, 300.0], [1.0, -2.0], zeroes_itself=True) == ([500.0, 300.0], [500.0, 300.0])


def test_what_people_did_meanwhile_is_a_change():
    assert interrupted([500.0, 300.0], [1.0, -2.0])[1] == [1.0, -2.0]
    assert interrupted([500.0, 300.0], [900.0, 300.0], zeroes_itself=True)[1] == [900.0, 300.0]
    assert interrupted([500.0, 300.0], [512.0, 313.0])[1] == [512.0, 313.0]  # a light thing, on both cells


def test_what_a_stuck_cell_showed_is_forgotten_at_once():
    continuity = Continuity(2, zeroes_itself=False)
    for n in range(150):
        continuity.take(n * 0.02, [500.0, 9000.0 if 50 <= n < 110 else 300.0])
    continuity.interrupted()
    later = [continuity.take(9 + n * 0.02, [508.0, 291.0]) for n in range(50)]
    assert later[-1] is not None and later[-1] == [500.0, 300.0]


def test_what_was_under_way_before_the_interruption_tells_no_level():
    continuity = Continuity(2, zeroes_itself=False)
    for n in range(50):
        continuity.take(n * 0.02, [500.0, 300.0])
    continuity.interrupted()
    assert continuity.take(5.0, [514.0, 286.0]) is None
    later = [continuity.take(6.0 + n * 0.02, [508.0, 291.0]) for n in range(50)]
    assert later[0] is None and later[-1] is not None and later[-1] == [500.0, 300.0]


def test_a_corrected_zero_is_remembered():
    first = Continuity(1, zeroes_itself=True)
    first.take(0.0, [400.0])
    saved = first.to_dict()
    second = Continuity(1, zeroes_itself=True)
    second.restore(saved["shift"], saved["level"])
    found = [second.take(n * 0.1, [0.0]) for n in range(10)]
    assert found[0] is None and found[-1] == [400.0]
    with pytest.raises(ValueError, match="number of cells"):
        second.restore([0.0, 0.0], None)


def read(tag: str, antenna: int = 0) -> TagRead:
    return TagRead(tag=tag, antenna=antenna)


def test_rounds_end_where_the_reader_says():
    rounds = Rounds({0: "left", 1: "right", 2: "right"}, None, 0.5, tells_ends=True)
    assert rounds.take(1.0, [read("A"), read("B", 1)]) == []
    assert rounds.take(1.1, [RoundEnd(0)]) == [(1.1, "left", frozenset("A"))]
    assert rounds.take(1.2, [RoundEnd(1), read("C", 2)]) == []
    # Two antennas of one zone are one round; antennas without a zone are nobody's.
    assert rounds.take(1.3, [RoundEnd(2), read("D", 7), RoundEnd(7)]) == [(1.3, "right", frozenset("BC"))]
    assert rounds.take(1.4, [RoundEnd(0)]) == [(1.4, "left", frozenset())]
    assert rounds.tick(99.0, True) == []


def test_a_failure_ends_no_round():
    rounds = Rounds({}, "shelf", 0.5, tells_ends=True)
    rounds.take(1.0, [read("A")])
    rounds.reset()
    assert rounds.take(2.0, [RoundEnd(0)]) == [(2.0, "shelf", frozenset())]


def test_without_ends_a_window_is_a_round_while_the_reader_delivers():
    rounds = Rounds({}, "shelf", 0.5)
    assert rounds.tick(0.0, False) == []
    rounds.take(0.1, [read("A"), read("A"), read("B" * 65)])
    assert rounds.tick(0.2, False) == [] and rounds.tick(0.3, True) == []
    rounds.take(0.4, [read("A")])
    assert rounds.tick(0.71, True) == [(0.71, "shelf", frozenset("A"))]
    assert rounds.tick(1.3, True) == [(1.3, "shelf", frozenset())]


def test_weighing_and_reading_take_turns():
    field = Field()
    turns = FieldTurns(field, 0.5, 2)
    turns.tick(0.0)
    assert not field.wanted and not turns.quiet(0.0)  # asked, not confirmed
    field.is_off = True
    turns.tick(0.1)
    assert turns.quiet(0.1)
    turns.tick(0.5)
    assert turns.quiet(0.5)
    turns.tick(0.6)
    assert field.wanted and not turns.quiet(0.6)
    turns.round_over(0.7)
    assert field.wanted
    turns.round_over(0.8)  # both antennas
    assert not field.wanted and not turns.quiet(0.8)


def test_a_reader_that_never_confirms_or_never_ends_does_not_stop_the_weighing():
    field = Field()
    turns = FieldTurns(field, 0.5, 1)
    quiet = []
    for n in range(100):
        turns.tick(n * 0.1)
        quiet.append(turns.quiet(n * 0.1))
    assert 0.1 < np.mean(quiet) < 0.5


def labels(**options) -> Labels:
    numbers = itertools.count(1)
    pose = BoardPose(2.0, 1.0, math.pi / 2, 0.8, "cabinet/shelf")
    return Labels(pose, lambda: f"a/{next(numbers)}", lambda t: datetime.fromtimestamp(t, UTC), **options)


COV = (1e-4, 0.0, 4e-4)


def test_one_instant_is_told_in_the_order_of_the_wire():
    made = labels()
    made.observations([Appeared(1.0, 1, (0.1, 0.2), COV, 500.0, 1.0), Appeared(1.0, 2, (0.3, 0.2), COV, 200.0, 1.0)])
    events = [
        ZoneRead(2.0, "shelf", None),
        Identified(2.0, 2, "B"),
        LoadChanged(2.0, (3,), 50.0, 1.0),
        Appeared(2.0, 3, (0.2, 0.1), COV, 50.0, 1.0),
        Moved(2.0, 2, (0.3, 0.1), COV),
        Vanished(2.0, 1, 500.0, 1.0),
        LoadChanged(2.0, (1,), -500.0, 1.0),
        Appeared(1.5, 4, (0.2, 0.2), COV, 70.0, 1.0),
        Identified(2.0, 3, "C"),
    ]
    told = made.observations(events)
    assert [one.type for one in told] == [
        *("label_appeared", "load_change", "label_vanished", "label_moved"),
        *("label_appeared", "load_change", "tag_observed", "raw_read"),
    ]
    assert told[4].tag == "C"  # known at that moment: it comes with the appearance
    assert "tag" not in told[0].model_fields_set  # a zone reader says nothing about a single label
    assert (told[1].labels, told[5].labels) == (["a/1"], ["a/4"])
    assert told[0].xy == pytest.approx((1.8, 1.2)) and told[0].cov == pytest.approx((4e-4, 0.0, 1e-4))
    assert set(made.of) == {2, 3, 4}


def test_what_a_hand_may_still_press_on_is_weighed_later():
    made = labels()
    early = Appeared(1.0, 1, (0.1, 0.2), COV, 540.0, 1.0, pressed=True)
    told = made.observations([early, Weighed(2.0, 1, 500.0, 1.0)])
    assert told[0].weight_g is None
    assert (told[1].type, told[1].labels, told[1].weight_g) == ("load_change", ["a/1"], 500.0)


def test_an_event_about_a_stay_that_nobody_knows_is_not_told():
    assert labels().observations([Vanished(1.0, 9, 5.0, 1.0), Identified(1.0, 9, "A")]) == []


def test_an_inventory_names_every_stay_once_and_for_all():
    made = labels()
    stays = [Stay(n, (0.1, 0.1), COV, 100.0, 1.0, "A" if n == 1 else None, 0.0) for n in (1, 2)]
    first, second = made.inventory(stays), made.inventory(stays[1:])
    assert [(one.label, one.tag) for one in first] == [("a/1", "A"), ("a/2", None)]
    assert [one.label for one in second] == ["a/2"] and list(made.of) == [2]


def test_a_single_scale_says_how_little_it_knows_of_places():
    made = labels(anywhere=(0.03, 0.0, 0.01))
    (told,) = made.observations([Appeared(1.0, 1, (0.2, 0.1), (1e-9, 0.0, 1e-9), 500.0, 1.0)])
    assert told.cov == pytest.approx((0.01, 0.0, 0.03))
