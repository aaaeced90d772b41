"""One hand: stories with their expected ends, and laws on arbitrary inputs."""

from __future__ import annotations

from collections.abc import Iterable

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tms_agents.hand.events import Carried, Dropped, Grasped, Identified, Released, Spot, Unread
from tms_agents.hand.fingers import FingerSettings, Grip
from tms_agents.hand.grasp import Grasp
from tms_agents.hand.settings import GraspSettings

TEA, CUP = "E00401004E17F97A", "E00401004E17F97B"
WIDE, AROUND, NOTHING = 0.1, 0.04, 0.0


class Play:
    """A hand at work: every step of 0.05 s the fingers and the place, every fourth a round of the reader."""

    def __init__(self, *, width: bool = True, rounds: bool = True, **changed: object) -> None:
        self.hand = Grasp(GraspSettings(**changed))
        self.events: list[object] = []
        self.t, self.x, self.opening, self.rounds, self.width = 1000.0, 0.0, WIDE, rounds, width
        self.reads = True
        self.hand.reader(self.t, True)

    def stay(self, seconds: float, *tags: str) -> Play:
        return self.go(0.0, seconds, *tags)

    def go(self, metres: float, seconds: float, *tags: str) -> Play:
        steps = max(1, round(seconds / 0.05))
        for n in range(steps):
            self.t += 0.05
            self.x += metres / steps
            if self.reads and n % 4 == 3:
                for tag in tags:
                    self.events += self.hand.read(self.t, tag)
                if self.rounds:
                    self.events += self.hand.round_end(self.t)
            width = {"opening_m": self.opening} if self.width else {"closed": self.opening != WIDE}
            self.events += self.hand.grip(self.t, Grip(**width), Spot((self.x, 0.0), 0.8))
        return self

    def fingers(self, opening: float) -> Play:
        self.opening = opening
        return self

    def told(self, *kinds: type) -> list[object]:
        return [
            one for one in self.events if isinstance(one, kinds or (Grasped, Identified, Released, Dropped, Unread))
        ]

    def names(self) -> list[str]:
        return [type(one).__name__ for one in self.told()]


def taken(**changed: object) -> Play:
    """The tea is in the hand, half a metre from where it stood."""
    return Play(**changed).stay(1, TEA).fingers(AROUND).stay(1, TEA).go(0.5, 1, TEA)


def test_grasp_carry_put_down():
    play = taken().go(1.0, 2, TEA).stay(0.5, TEA).fingers(WIDE).stay(0.4, TEA).go(-0.5, 1)
    grasped, released = play.told()
    assert grasped == Grasped(grasped.at, grasped.spot, TEA)
    assert 0.1 < grasped.spot.xy[0] < 0.3 and grasped.at < released.at
    assert isinstance(released, Released) and released.spot.xy[0] == pytest.approx(1.5)
    assert released.at == pytest.approx(1000 + 5.55)
    steps = [one.spot.xy[0] for one in play.told(Carried)]
    assert steps == sorted(steps) and 3 <= len(steps) <= 12


def test_a_reader_without_rounds_is_cut_into_looks():
    assert taken(rounds=False).told() == taken().told()


def test_a_reader_that_tells_only_rounds_without_a_tag():
    """ThingMagic in single mode: while a tag is read no round ends."""
    play = Play(rounds=False)
    play.events += play.hand.round_end(play.t)
    play.stay(1, TEA).fingers(AROUND).stay(2, TEA).go(1.5, 5, TEA)
    assert [one.tag for one in play.told()] == [TEA]


def test_one_missed_read_is_nothing_and_neither_are_many_while_the_fingers_hold_it():
    play = taken()
    for _ in range(20):
        play.go(0.1, 0.2).go(0.1, 0.6, TEA)
    assert play.names() == ["Grasped"]
    play.go(1.0, 60)
    assert play.names() == ["Grasped"]


def test_a_fall_needs_the_fingers_and_the_tag():
    play = taken().fingers(NOTHING).stay(0.3, TEA).go(0.8, 2)
    dropped = play.told()[-1]
    assert isinstance(dropped, Dropped) and play.names() == ["Grasped", "Dropped"]
    assert dropped.at == pytest.approx(1000 + 3.05) and dropped.spot.xy[0] == pytest.approx(0.5, abs=0.05)
    # It is not told to be carried on after it fell.
    assert max(one.at for one in play.told(Carried)) <= dropped.at


def test_something_thin_that_is_still_read_has_not_fallen():
    play = taken().fingers(NOTHING).go(1.0, 3, TEA)
    assert play.names() == ["Grasped"]
    assert play.told(Carried)[-1].spot.xy[0] > 1.2


def test_a_slip_of_the_fingers_measure_is_no_fall():
    assert taken().fingers(NOTHING).stay(0.3).fingers(AROUND).go(1.0, 5, TEA).names() == ["Grasped"]


def test_with_a_dead_reader_nothing_falls_by_silence():
    play = taken()
    play.reads = False
    play.hand.reader(play.t, False)
    play.go(2.0, 30)
    assert play.names() == ["Grasped"] and play.told(Carried)[-1].spot.xy[0] > 2.3
    play.fingers(NOTHING).stay(3)
    assert play.names() == ["Grasped", "Dropped"]


def test_opening_and_closing_again_on_the_same_thing_is_one_grasp():
    play = taken().fingers(WIDE).stay(0.3, TEA).fingers(AROUND).stay(0.5, TEA).go(1.0, 2, TEA)
    assert play.names() == ["Grasped"]
    play.fingers(WIDE).stay(1.2, TEA)
    assert play.names() == ["Grasped", "Released"]


def test_set_down_and_taken_again_are_two_grasps():
    play = taken().fingers(WIDE).stay(1.5, TEA).fingers(AROUND).stay(1, TEA).go(0.5, 1, TEA)
    assert play.names() == ["Grasped", "Released", "Grasped"] and play.told()[-1].tag == TEA


def test_closing_on_nothing_and_loosening_without_lifting_tell_nothing():
    assert Play().fingers(NOTHING).stay(1, TEA).go(1, 2, TEA).fingers(WIDE).stay(2).names() == []
    assert Play().fingers(AROUND).stay(2, TEA).fingers(WIDE).stay(2, TEA).names() == []


def test_a_neighbour_on_the_shelf_is_not_in_the_hand():
    play = Play().stay(1, TEA, CUP).fingers(AROUND).stay(2, CUP, TEA).go(0.15, 0.4, TEA, CUP).go(0.6, 1.2, TEA)
    assert [one.tag for one in play.told()] == [TEA]


def test_two_tags_that_both_come_along_are_told_as_neither():
    play = Play().stay(1).fingers(AROUND).stay(1, TEA, CUP).go(1.5, 3, TEA, CUP)
    assert play.names() == ["Grasped"] and play.told()[0].tag is None


def test_a_thing_without_a_tag_and_one_whose_tag_is_read_late():
    play = Play().fingers(AROUND).stay(1).go(0.5, 4)
    assert play.names() == ["Grasped", "Unread"] and play.told()[0].tag is None
    play.go(1.0, 2, TEA)
    assert play.names() == ["Grasped", "Unread", "Identified"] and play.told()[-1].tag == TEA


def test_a_wrong_first_guess_is_corrected():
    play = Play().fingers(AROUND).stay(1, CUP).go(0.3, 0.5, CUP).go(0.3, 0.6).go(3.0, 6, TEA)
    assert play.told()[-1] == Identified(play.told()[-1].at, TEA)


def test_what_a_person_puts_into_a_hand_that_stands_still():
    play = Play().stay(1).fingers(AROUND).stay(8, TEA)
    assert play.names() == ["Grasped"]


def test_only_closed_or_open_known_a_tag_must_say_that_something_is_held():
    assert Play(width=False).fingers(AROUND).stay(1).go(1, 4).fingers(WIDE).stay(2).names() == []
    play = taken(width=False).fingers(WIDE).stay(1.2)
    assert play.names() == ["Grasped", "Released"]


def test_only_closed_or_open_known_a_tag_lost_for_long_was_lost_before_the_opening():
    play = taken(width=False)
    last = play.t
    play.go(1.0, 30)
    assert play.names() == ["Grasped"]
    play.fingers(WIDE).stay(1)
    assert play.told()[-1] == Dropped(pytest.approx(last, abs=0.3), None)
    # Its place was not told on after the tag was lost.
    assert max(one.at for one in play.told(Carried)) < last + 1


def test_effort_tells_where_the_width_does_not():
    hand = Grasp(GraspSettings(fingers=FingerSettings(hold_effort=5.0)))
    events = []
    for n in range(200):
        effort = 0.0 if n < 20 else (-8.0 if n < 120 else 0.5)
        grip = Grip(closed=n >= 20, effort=effort)
        events += hand.grip(1000 + n * 0.05, grip, Spot((max(0, n - 30) * 0.02, 0.0)))
    assert [type(one) for one in events if not isinstance(one, Carried)] == [Grasped, Dropped]


def test_a_gap_in_which_the_hand_opened_leaves_no_place():
    play = taken()
    play.t += 60
    play.x += 3
    play.fingers(WIDE).stay(2)
    assert play.told()[-1] == Dropped(pytest.approx(play.t - 1.95), None)


def test_a_gap_in_which_nothing_changed_is_nothing():
    play = taken()
    play.t += 60
    play.hand.interrupted()
    assert play.go(1, 2, TEA).names() == ["Grasped"]


@pytest.mark.parametrize(("opening", "expected"), [(WIDE, ["Dropped"]), (AROUND, []), (NOTHING, ["Dropped"])])
def test_after_a_restart_the_fingers_tell_whether_it_is_still_there(opening, expected):
    play = Play()
    play.hand.restore(TEA)
    assert play.fingers(opening).stay(4).names() == expected


def test_without_a_place_nothing_is_told():
    hand, events = Grasp(), []
    for n in range(200):
        events += hand.grip(1000 + n * 0.05, Grip(opening_m=AROUND if n < 150 else WIDE), None)
    assert events == []


# laws

GRIPS = st.builds(
    Grip,
    closed=st.none() | st.booleans(),
    opening_m=st.none() | st.sampled_from([0.0, 0.003, 0.005, 0.03, 0.05, 0.09]),
    effort=st.none() | st.sampled_from([0.0, 3.0, 9.0]),
)
SPOTS = st.none() | st.builds(
    lambda x, z: Spot((x, 0.0), z), st.sampled_from([0.0, 0.05, 0.3, 1.0]), st.none() | st.sampled_from([0.5, 0.9])
)
INPUTS = st.tuples(
    st.sampled_from([0.02, 0.1, 0.3, 1.0, 7.0]),
    st.one_of(
        st.tuples(st.just("grip"), GRIPS, SPOTS),
        st.tuples(st.just("grip"), GRIPS, SPOTS),
        st.tuples(st.just("read"), st.sampled_from([TEA, CUP])),
        st.tuples(st.just("round_end")),
        st.tuples(st.just("reader"), st.booleans()),
        st.tuples(st.just("interrupted")),
    ),
)


def feed(hand: Grasp, inputs: Iterable[tuple[float, tuple]]) -> list[object]:
    t, events = 1000.0, []
    for wait, (name, *values) in inputs:
        t += wait
        arguments = values if name == "interrupted" else [t, *values]
        events += getattr(hand, name)(*arguments) or []
    return events


@settings(max_examples=300)
@given(st.lists(INPUTS, max_size=60), st.booleans())
def test_a_hand_holds_one_thing_at_most_and_every_grasp_ends_once(inputs, effort):
    hand = Grasp(GraspSettings(fingers=FingerSettings(hold_effort=5.0 if effort else None)))
    events = feed(hand, inputs)
    holding, began = False, 0.0
    for one in events:
        if isinstance(one, Grasped):
            assert not holding
            holding, began = True, one.at
        else:
            assert holding and one.at >= began
            holding = not isinstance(one, Released | Dropped)
    assert hand.told == holding
    # Any story ends: an open hand for long holds nothing.
    t = 1000 + sum(wait for wait, _ in inputs)
    for n in range(40):
        events += hand.grip(t + n, Grip(closed=False, opening_m=0.09), None)
    assert not hand.told
    assert sum(isinstance(one, Grasped) for one in events) == sum(isinstance(one, Released | Dropped) for one in events)


@given(st.lists(st.integers(1, 6), min_size=1, max_size=30), st.integers(0, 1))
def test_single_missed_reads_never_end_a_grasp(runs, width):
    """However often one look misses the tag between looks that read it, with or without a measure of the width."""
    play = taken(width=bool(width))
    for reads in runs:
        play.go(0.05, 0.2)
        play.go(0.05, 0.2 * reads, TEA)
    assert play.names() == ["Grasped"]


@given(st.lists(st.tuples(st.sampled_from("sgf"), st.sampled_from([TEA, CUP, ""]), st.integers(0, 2)), max_size=25))
def test_moves_are_told_of_what_is_held_only(story):
    play = Play()
    for kind, tag, opening in story:
        if kind == "f":
            play.fingers([WIDE, AROUND, NOTHING][opening])
        tags = [tag] if tag else []
        play.go(0.3 if kind == "g" else 0.0, 0.6, *tags)
    ends = [one for one in play.events if isinstance(one, Released | Dropped)]
    carried = [one for one in play.events if isinstance(one, Carried)]
    for end in ends:
        index = play.events.index(end)
        before = [one for one in play.events[:index] if isinstance(one, Carried | Grasped)]
        assert all(one.at <= end.at for one in before)
    assert len(carried) <= 2 * (play.t - 1000) + 1
