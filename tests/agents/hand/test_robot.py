"""A robot with two hands: the observations it posts, checked as a server that trusts nothing would."""

from __future__ import annotations

import itertools
import json
from datetime import UTC, datetime, timedelta

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tms_agents.hand.posture import Posture
from tms_agents.hand.robot import Robot
from tms_agents.hand.settings import GraspSettings
from tms_agents.hand.states import StateMessage
from tms_agents.hand.surfaces import Surfaces
from tms_schemas.observation import ObservationBatch
from tms_schemas.rooms import Room

TEA, CUP = "E00401004E17F97A", "E00401004E17F97B"
ZERO = datetime(2026, 1, 1, tzinfo=UTC)
TOP = [(2.0, -1.0), (4.0, -1.0), (4.0, 1.0), (2.0, 1.0)]
ROOM = Room.model_validate(
    {
        "id": "r", "name": "R", "outline": [(0, 0), (9, 0), (9, 9)], "created_at": ZERO, "updated_at": ZERO,
        "furniture": [
            {"id": "table", "name": "Table", "polygon": TOP, "surfaces": [{"id": "top", "polygon": TOP, "z": 0.7}]},
            {"id": "shelf", "name": "Shelf", "agent": "shelf",
             "polygon": [(6, -1), (8, -1), (8, 1), (6, 1)]},
        ],
        "sensors": [{"agent": "laser", "kind": "floor"}],
    }
)  # fmt: skip


class Books:
    """The labels of one agent as its observations make them; complains about what does not fit."""

    def __init__(self) -> None:
        self.live: dict[str, str] = {}
        self.ever: set[str] = set()
        self.seen: list[object] = []

    def take(self, observations: list[object]) -> None:
        if observations:
            numbered = [one.model_copy(update={"seq": n}).model_dump(mode="json", by_alias=True, exclude_none=True)
                        for n, one in enumerate(observations)]  # fmt: skip
            ObservationBatch.model_validate({"agent": "a", "room": "r", "observations": numbered})
        for one in observations:
            self.seen.append(one)
            match one.type:
                case "label_appeared":
                    self._new(one.label, one.kind)
                case "pose":
                    self.live.get(one.label) == "mover" or self._new(one.label, "mover")
                case "label_moved" | "tag_observed" | "tag_missed":
                    assert self.live[one.label] == "robot"
                case "label_vanished":
                    assert self.live.pop(one.label) in ("robot", "table", "floor")
                    assert one.dest is None or self.live[one.dest] == "mover"
                case "transfer":
                    assert self.live.pop(one.from_) in ("robot", "table", "floor")
                    self._new(one.to, one.kind)
                case "inventory":
                    assert {label.label: label.kind for label in one.labels} == self.live
                case other:
                    raise AssertionError(other)

    def _new(self, label: str, kind: str) -> None:
        assert label not in self.ever
        self.ever.add(label)
        self.live[label] = kind

    def kinds(self) -> list[str]:
        return sorted(kind for kind in self.live.values() if kind != "mover")

    def types(self) -> list[str]:
        return [one.type for one in self.seen if one.type not in ("pose", "label_moved")]


class Butler:
    """A robot whose base drives along x; its hands are 0.1 m beside each other unless told otherwise."""

    def __init__(self, state: dict | None = None, numbers: itertools.count | None = None) -> None:
        self.numbers = numbers or itertools.count(1)
        self.robot = Robot(
            {"left": GraspSettings(), "right": GraspSettings()},
            Posture({"left": None, "right": None}),
            lambda: f"a/{next(self.numbers)}",
            Surfaces(ROOM),
        )
        if state is not None:
            self.robot.restore(json.loads(json.dumps(state)))
        self.books = Books()
        self.t, self.x, self.z = 0.0, 0.0, 0.8
        self.widths = {"left": 0.1, "right": 0.1}
        self.apart = 0.1

    @property
    def now(self) -> datetime:
        return ZERO + timedelta(seconds=self.t)

    def go(self, metres: float, seconds: float, **tags: str) -> Butler:
        steps = max(1, round(seconds / 0.1))
        for n in range(steps):
            self.t += 0.1
            self.x += metres / steps
            if n % 2:
                for hand in ("left", "right"):
                    if hand in tags:
                        self.books.take(self.robot.read(hand, self.now, tags[hand]))
                    self.books.take(self.robot.round_end(hand, self.now))
            side = {"left": self.apart / 2, "right": -self.apart / 2}
            gripper = {
                name: {"opening_m": self.widths[name], "position": [0.0, side[name], self.z]} for name in self.widths
            }
            message = StateMessage.model_validate({"base": [self.x, 0.0, 0.0], "gripper": gripper})
            self.books.take(self.robot.message(self.now, message))
        return self

    def close(self, hand: str) -> Butler:
        self.widths[hand] = 0.04
        return self

    def open(self, hand: str) -> Butler:
        self.widths[hand] = 0.1
        return self


def carrying() -> Butler:
    return Butler().go(0, 1).close("left").go(0, 1, left=TEA).go(1.0, 2, left=TEA)


def test_to_the_table_and_back_into_the_hand():
    butler = carrying().go(2.0, 4, left=TEA).open("left").go(0, 1.5, left=TEA)
    assert butler.books.kinds() == ["table"]
    put = butler.books.seen[-1]
    assert (put.type, put.surface, put.z) == ("transfer", "table/top", 0.7) and put.xy == pytest.approx((3.0, 0.05))
    butler.go(-0.5, 1).go(0.5, 1, left=TEA).close("left").go(0, 1, left=TEA).go(1.0, 2, left=TEA)
    assert butler.books.kinds() == ["robot"]
    assert butler.books.types() == ["label_appeared", "transfer", "label_vanished", "label_appeared"]


def test_into_a_smart_cabinet_it_goes_through_no_other_hands():
    butler = carrying().go(6.0, 12, left=TEA).open("left").go(0, 1.5)
    gone = butler.books.seen[-1]
    assert gone.type == "label_vanished" and butler.books.live[gone.dest] == "mover"


def test_in_mid_air_nobody_knows_who_took_it():
    butler = carrying()
    butler.z = 1.2
    butler.go(4.0, 8, left=TEA).open("left").go(0, 1.5)
    assert butler.books.seen[-1].type == "label_vanished" and butler.books.seen[-1].dest is None


def test_onto_a_floor_under_a_laser_it_vanishes_and_elsewhere_it_lies_there():
    for watched, kinds in ((None, []), (False, ["floor"])):
        butler = carrying()
        butler.robot.surfaces, butler.z = Surfaces(ROOM, floor_watched=watched), 0.1
        butler.go(0, 0.5, left=TEA).open("left").go(0, 1.5)
        assert butler.books.kinds() == kinds


def test_from_one_hand_to_the_other_is_one_transfer():
    butler = carrying().close("right").go(0, 1, left=TEA, right=TEA).open("left").go(0.5, 1.5, right=TEA)
    assert butler.books.types() == ["label_appeared", "transfer"] and butler.books.kinds() == ["robot"]
    butler.books.take([butler.robot.inventory(butler.now)])
    butler.go(1.5, 3, right=TEA).open("right").go(0, 1.5)
    assert butler.books.types()[3:] == ["transfer"] and butler.books.kinds() == ["table"]


def test_a_second_hand_that_only_helps_tells_nothing():
    butler = carrying().close("right").go(0.5, 2, left=TEA, right=TEA).open("right").go(0.5, 2, left=TEA)
    assert butler.books.types() == ["label_appeared"] and butler.books.kinds() == ["robot"]


def test_two_hands_two_things():
    butler = carrying().close("right").go(0, 0.5, left=TEA, right=CUP).go(1.0, 2, left=TEA, right=CUP)
    tags = [one.tag for one in butler.books.seen if one.type == "label_appeared"]
    assert tags == [TEA, CUP] and butler.books.kinds() == ["robot", "robot"]
    assert butler.robot.holds(TEA) and butler.robot.holds(CUP)


def test_two_hands_that_part_hold_two_things():
    butler = carrying().close("right").go(0.5, 3, left=TEA)
    butler.apart = 1.0
    assert butler.go(0.5, 3, left=TEA).books.kinds() == ["robot", "robot"]


def test_what_is_held_survives_a_restart():
    before = carrying().go(2.0, 4, left=TEA).open("left").go(-1, 1.5).close("right").go(-1, 3, right=CUP)
    after = Butler(before.robot.to_dict(), before.numbers)
    after.books, after.t, after.x, after.widths = before.books, before.t + 30, before.x, before.widths
    after.go(-0.5, 2, right=CUP)
    after.books.take([after.robot.inventory(after.now)])
    assert after.books.kinds() == ["robot", "table"]
    after.open("right").go(0, 2)
    assert after.books.kinds() == ["table"]


def test_what_was_lost_while_the_agent_was_away_is_gone():
    before = carrying()
    after = Butler(before.robot.to_dict(), before.numbers)
    after.books, after.t = before.books, before.t + 30
    after.go(0, 1)
    after.books.take([after.robot.inventory(after.now)])
    assert after.books.kinds() == []


@pytest.mark.parametrize("state", [{}, {"hands": 3, "body": None}, {"hands": {"left": {}}, "body": None}, []])
def test_a_damaged_state_is_refused(state):
    with pytest.raises(ValueError, match=r"state|validation"):
        Butler(state)


def test_a_tag_too_long_for_the_wire_is_none():
    butler = Butler().close("left").go(0, 1, left="AB" * 40).go(1, 4, left="AB" * 40)
    assert butler.books.types() == ["label_appeared", "tag_missed"]


@pytest.mark.parametrize("jump", [-3600, 3600])
def test_a_clock_that_is_set_loses_nothing(jump):
    butler = carrying()
    butler.t += jump
    butler.go(2.0, 4, left=TEA).open("left").go(0, 1.5, left=TEA)
    assert butler.books.types() == ["label_appeared", "transfer"] and butler.books.kinds() == ["table"]


STEP = st.tuples(
    st.sampled_from([0.0, 0.05, 0.3, -0.5]),
    st.sampled_from([0.3, 1.2]),
    st.sampled_from([0.0, 0.03, 0.1]),
    st.sampled_from([0.0, 0.03, 0.1]),
    st.dictionaries(st.sampled_from(["left", "right"]), st.sampled_from([TEA, CUP])),
    st.sampled_from([0.1, 1.0]),
    st.sampled_from(["", "", "", "", "restart", "interrupted", "blind", "inventory"]),
)


@settings(max_examples=80)
@given(st.lists(STEP, max_size=25))
def test_every_label_appears_once_and_goes_once_whatever_happens(steps):
    butler = Butler()
    for metres, seconds, left, right, tags, apart, event in steps:
        butler.widths, butler.apart = {"left": left, "right": right}, apart
        if event == "restart":
            again = Butler(butler.robot.to_dict(), butler.numbers)
            again.books, again.t, again.x = butler.books, butler.t + 20, butler.x
            butler = again
            butler.widths, butler.apart = {"left": left, "right": right}, apart
        elif event == "interrupted":
            butler.robot.interrupted()
        elif event == "inventory":
            butler.books.take([butler.robot.inventory(butler.now)])
        butler.robot.reader("left", butler.now, event != "blind")
        butler.go(metres, seconds, **({} if event == "blind" else tags))
        assert butler.books.kinds().count("robot") <= 2
    butler.widths = {"left": 0.1, "right": 0.1}
    butler.go(0, 30)
    assert "robot" not in butler.books.kinds()


NUMBER = st.floats(-1e4, 1e4) | st.sampled_from([0.0, 1e4, -1e4, 1e-300])
GRIPPER = st.fixed_dictionaries(
    {},
    optional={
        "closed": st.booleans(),
        "opening_m": st.floats(-1, 5),
        "effort": st.floats(-1e6, 1e6),
        "position": st.tuples(NUMBER, NUMBER, NUMBER),
    },
)
MESSAGE = st.fixed_dictionaries(
    {},
    optional={
        "joints": st.dictionaries(st.sampled_from(["a", "b"]), NUMBER),
        "base": st.tuples(NUMBER, NUMBER, st.floats(-1e3, 1e3)),
        "base_sd": st.tuples(st.floats(0, 100), st.floats(0, 7)),
        "gripper": st.dictionaries(st.sampled_from(["left", "right", "third"]), GRIPPER),
    },
)


@given(st.lists(st.tuples(MESSAGE, st.floats(-10, 10), st.sampled_from([TEA, CUP, ""])), max_size=30))
def test_any_valid_message_is_taken(messages):
    butler = Butler()
    for message, wait, tag in messages:
        butler.t += wait
        if tag:
            butler.books.take(butler.robot.read("left", butler.now, tag))
        butler.books.take(butler.robot.message(butler.now, StateMessage.model_validate(message)))
    butler.books.take([butler.robot.inventory(butler.now)])
