"""The hand's events: what each movement of a hand says, and that no sequence of them contradicts itself."""

from __future__ import annotations

import itertools
import math
from datetime import UTC, datetime, timedelta

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tms_client.grasping import Gripper, Table
from tms_schemas.events import Near
from tms_schemas.observation import LabelAppeared, LabelMoved, LabelVanished, TagMissed, TagObserved, Transfer

ZERO = datetime(2026, 11, 1, tzinfo=UTC)
TEA, CUP = "E00401004E17F97A", "E00401004E17F97B"


def at(seconds: float) -> datetime:
    return ZERO + timedelta(seconds=seconds)


@pytest.fixture
def labels():
    numbers = itertools.count(1)
    return lambda: f"hand/{next(numbers)}"


@pytest.fixture
def hand(labels):
    return Gripper(labels)


def test_fetch_and_put_on_a_table(hand):
    (appeared,) = hand.grasped(at(0), (1, 1), tag=TEA.lower(), z=0.9, weight_g=500)
    assert isinstance(appeared, LabelAppeared) and appeared.kind == "robot" and appeared.tag == TEA
    assert appeared.z == 0.9 and appeared.weight_g == 500
    assert hand.moved(at(1), (1.01, 1)) == []
    (moved,) = hand.moved(at(2), (2, 1))
    assert isinstance(moved, LabelMoved) and moved.label == appeared.label and moved.xy == (2, 1)
    (put,) = hand.released(at(3), (2.1, 1), surface="table/top")
    assert isinstance(put, Transfer) and put.from_ == appeared.label and put.to != appeared.label
    assert (put.kind, put.xy, put.surface) == ("table", (2.1, 1), "table/top")
    assert hand.held is None and hand.released(at(4), (2, 1)) == []


def test_a_grasp_without_reader_says_nothing_of_tags(hand):
    (appeared,) = hand.grasped(at(0), (1, 1))
    assert not appeared.reader_present


@pytest.mark.parametrize(
    ("kind", "watched", "expected"),
    [
        ("table", None, Transfer),
        ("table", True, LabelVanished),
        ("floor", None, LabelVanished),
        ("floor", False, Transfer),
        ("cabinet", None, LabelVanished),
        ("cabinet", False, Transfer),
        ("person", None, LabelVanished),
    ],
)
def test_where_a_sensor_sees_the_thing_the_hand_says_only_that_it_is_gone(hand, kind, watched, expected):
    hand.grasped(at(0), (1, 1), tag=TEA)
    event = hand.released(at(1), (1, 1), kind=kind, watched=watched)[-1]
    assert type(event) is expected
    if expected is Transfer:
        assert event.kind == kind
    assert getattr(event, "dest", None) == (Near(xy=(1, 1)) if kind == "person" else None)


def test_lost_where_it_happened(hand):
    (appeared,) = hand.grasped(at(0), (1, 1), tag=TEA)
    moved, vanished = hand.dropped(at(1), (2, 2))
    assert isinstance(moved, LabelMoved) and moved.xy == (2, 2)
    assert isinstance(vanished, LabelVanished) and vanished.label == appeared.label
    assert hand.dropped(at(2)) == []


def test_again_without_tag_at_the_same_place_it_is_the_same_thing(hand):
    hand.grasped(at(0), (1, 1), tag=TEA)
    (put,) = hand.released(at(1), (2, 1))
    (again,) = hand.grasped(at(2), (2.05, 1))
    assert isinstance(again, Transfer) and again.from_ == put.to and again.kind == "robot"
    assert hand.held.tag == TEA and hand.table.things == {}
    hand.released(at(3), (2, 1))
    (other,) = hand.grasped(at(4), (2.5, 1))  # too far from it
    assert isinstance(other, LabelAppeared) and len(hand.table.things) == 1


def test_again_with_its_tag_it_is_taken_from_wherever_it_is(hand):
    hand.grasped(at(0), (1, 1), tag=TEA)
    (put,) = hand.released(at(1), (2, 1))
    gone, appeared = hand.grasped(at(2), (2, 1), tag=TEA)
    assert isinstance(gone, LabelVanished) and gone.label == put.to
    assert isinstance(appeared, LabelAppeared) and appeared.tag == TEA


def test_another_thing_at_the_place_of_one_put_down(hand):
    hand.grasped(at(0), (1, 1), tag=TEA)
    (put,) = hand.released(at(1), (2, 1))
    (again,) = hand.grasped(at(2), (2, 1))
    vanished, appeared = hand.read(at(3), CUP)
    assert isinstance(vanished, LabelVanished) and vanished.label == again.to != put.to
    assert isinstance(appeared, LabelAppeared) and appeared.tag == CUP and hand.held.label == appeared.label


def test_a_thing_put_down_and_moved_by_someone_is_known_by_its_tag(hand):
    hand.grasped(at(0), (1, 1), tag=TEA)
    (put,) = hand.released(at(1), (2, 1))
    (unread,) = hand.grasped(at(2), (3, 1))
    told = hand.read(at(3), TEA)
    assert [event.type for event in told] == ["label_vanished", "label_vanished", "label_appeared"]
    assert {told[0].label, told[1].label} == {unread.label, put.to} and hand.table.things == {}


def test_two_hands_share_what_they_put_down(labels):
    table = Table()
    left, right = Gripper(labels, table=table), Gripper(labels, table=table)
    left.grasped(at(0), (1, 1), tag=TEA)
    (put,) = left.released(at(1), (2, 1))
    (again,) = right.grasped(at(2), (2, 1))
    assert again.from_ == put.to


def test_reads_confirm_the_grasp_once(hand):
    assert hand.read(at(0), TEA) == [] and hand.missed(at(0)) == []
    (appeared,) = hand.grasped(at(0), (1, 1), tag=TEA)
    (read,) = hand.read(at(1), TEA.lower())
    assert read == TagObserved(seq=0, observed_at=at(1), label=appeared.label, tag=TEA)
    assert hand.read(at(2), TEA) == [] and hand.missed(at(2)) == []
    assert [one.tag for one in hand.read(at(2), CUP)] == [CUP]


def test_a_reader_that_sees_nothing_and_then_the_tag(hand):
    (appeared,) = hand.grasped(at(0), (1, 1))
    (missed,) = hand.missed(at(1))
    assert isinstance(missed, TagMissed) and missed.label == appeared.label
    assert hand.missed(at(2)) == []
    (read,) = hand.grasped(at(3), (1, 1), tag=TEA)  # the caller says late what it is
    assert isinstance(read, TagObserved) and read.label == appeared.label and hand.held.tag == TEA


def test_grasp_while_holding(hand):
    (first,) = hand.grasped(at(0), (1, 1), tag=TEA)
    assert hand.grasped(at(1), (1, 1), tag=TEA) == [] and hand.grasped(at(1), (1, 1)) == []
    lost, second = hand.grasped(at(2), (1, 1), tag=CUP)
    assert isinstance(lost, LabelVanished) and lost.label == first.label
    assert isinstance(second, LabelAppeared) and second.tag == CUP


@pytest.mark.parametrize("bad", [{"tag": "no tag"}, {"xy": (math.nan, 0)}, {"at": datetime(2026, 1, 1)}, {"z": 1e9}])
def test_bad_input_changes_nothing(hand, bad):
    hand.grasped(at(0), (1, 1), tag=TEA)
    before = hand.to_dict()
    given = {"at": at(1), "xy": (1, 1), "tag": CUP} | bad
    with pytest.raises(ValueError):
        hand.grasped(**given)
    assert hand.to_dict() == before


def test_a_clock_set_back_does_not_reorder(hand):
    (appeared,) = hand.grasped(at(100), (1, 1), tag=TEA)
    (put,) = hand.released(at(50), (2, 1))
    assert put.observed_at >= appeared.observed_at


def test_no_state_is_refused(hand):
    with pytest.raises(ValueError):
        hand.restore({"held": 5})


def test_a_tag_that_two_hands_read_is_where_it_was_put_down_last():
    """Both things lie there; a grasp of the tag takes the second, and of the first nobody knows what it is."""
    numbers, table = itertools.count(1), Table()
    one, other = (Gripper(lambda: f"hand/{next(numbers)}", table=table) for _ in range(2))
    one.grasped(at(0), (0, 0), tag=TEA)
    other.grasped(at(1), (1, 0), tag=TEA)
    (first,) = one.released(at(2), (0, 1))
    (second,) = other.released(at(3), (2, 1))
    assert {thing.label: thing.tag for thing in table.things.values()} == {first.to: None, second.to: TEA}
    vanished, _ = one.grasped(at(4), (2, 1), tag=TEA)
    assert vanished.label == second.to
    assert list(table.things) == [first.to]


XY = st.tuples(st.sampled_from([0.0, 0.05, 1.0, 2.0]), st.sampled_from([0.0, 1.0]))
TAGS = st.sampled_from([None, "A1", "B2", "C3"])
ACTION = st.one_of(
    st.tuples(st.just("grasped"), XY, TAGS),
    st.tuples(st.just("moved"), XY),
    st.tuples(st.just("read"), st.sampled_from(["A1", "B2", "C3"])),
    st.tuples(st.just("missed")),
    st.tuples(st.just("dropped"), st.none() | XY),
    st.tuples(st.just("released"), XY, st.sampled_from(["table", "floor", "cabinet", "person"]), st.booleans()),
    st.tuples(st.just("restart")),
)


@settings(max_examples=200)
@given(st.lists(st.tuples(st.integers(0, 1), st.floats(-5, 5), ACTION), max_size=40))
def test_whatever_two_hands_do_the_events_fit_each_other(actions):
    """As the server sees it: labels appear once, exist while named, are never used again; times never go back."""
    numbers, table = itertools.count(1), Table()

    def label() -> str:
        return f"hand/{next(numbers)}"

    hands = [Gripper(label, table=table) for _ in range(2)]
    present: dict[str, str] = {}
    ever: set[str] = set()
    last = ZERO - timedelta(days=1)
    for now, (which, drift, action) in enumerate(actions):
        hand, (name, *arguments) = hands[which], action
        if name == "restart":
            states = [one.to_dict() for one in hands]
            table = Table()
            hands = [Gripper(label, table=table) for _ in states]
            for one, state in zip(hands, states, strict=True):
                one.restore(state)
            continue
        when = at(now + drift)
        if name == "grasped":
            events = hand.grasped(when, arguments[0], tag=arguments[1])
        elif name == "released":
            events = hand.released(when, arguments[0], kind=arguments[1], watched=arguments[2])
        else:
            events = getattr(hand, name)(when, *arguments)
        for event in events:
            assert event.observed_at >= last
            last = event.observed_at
            match event:
                case LabelAppeared(label=new, kind=kind):
                    assert new not in ever
                    present[new] = kind
                case LabelVanished(label=old):
                    del present[old]
                case Transfer(from_=old, to=new, kind=kind):
                    assert new not in ever
                    del present[old]
                    present[new] = kind
                case LabelMoved(label=old) | TagObserved(label=old) | TagMissed(label=old):
                    assert present[old] == "robot"
            ever |= present.keys()
        held = {one.held.label for one in hands if one.held}
        assert held == {name for name, kind in present.items() if name not in table.things}
        assert table.things.keys() == present.keys() - held
        listed = {item.label for one in hands for item in one.labels()}
        assert listed == present.keys()
        things = [one.tag for one in table.things.values() if one.tag]
        assert len(set(things)) == len(things), "one thing lies at one place"
