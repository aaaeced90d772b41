"""The simulated room: its physical laws, what its floor sensor may say of it, and how scripts are played in it."""

from __future__ import annotations

import contextlib
import itertools
import math
from datetime import UTC, datetime, timedelta

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tms_agents.simulation.catalogue import ITEMS, with_check_digit
from tms_agents.simulation.floor import FloorAgent
from tms_agents.simulation.player import LATE_S, Player
from tms_agents.simulation.room import CABINETS, PERSON, ROBOT, SPOTS, WAYS, description, new_world
from tms_agents.simulation.script import Firm, Script, Told, reach, walk
from tms_agents.simulation.story import STEPS, furnish
from tms_agents.simulation.world import HAND_SPEED, Impossible, Outside, Place, World, Xy
from tms_client.cli import CommandError
from tms_schemas.observation import (
    Inventory,
    LabelAppeared,
    LabelMoved,
    LabelVanished,
    Observation,
    labels_named,
)

START = datetime(2026, 1, 1, tzinfo=UTC)
TAGS = st.sampled_from([item.tag for item in ITEMS])
SPOT = st.sampled_from(list(SPOTS.values()))
CABINET, SLOT = st.sampled_from([one.id for one in CABINETS]), st.integers(0, 4)
ACTIONS = st.one_of(
    st.tuples(st.just("bring"), TAGS, CABINET, SLOT),
    st.tuples(st.just("take"), st.just(PERSON), TAGS),
    st.tuples(st.just("put"), st.just(PERSON), TAGS, CABINET, SLOT),
    st.tuples(st.just("drop"), st.just(PERSON), TAGS, SPOT),
    st.tuples(st.just("give"), st.just(PERSON), TAGS, st.just(ROBOT)),
    st.tuples(st.just("set_down"), st.just(ROBOT), st.just("table/top"), SPOT),
    st.tuples(st.just("walk"), st.sampled_from([PERSON, ROBOT]), SPOT),
)


class Hearsay:
    """Senses without devices: what the floor sensor said, and agents that are never late, or always."""

    def __init__(self, late: str | None = None) -> None:
        self.said: list[Observation] = []
        self.wishes: list[Told | Firm] = []
        self._late = late

    def follow(self, world: World) -> None:
        """There are no devices."""

    def floor(self, observations: list[Observation]) -> None:
        self.said += observations

    def late(self, world: World, wish: Told | Firm) -> str | None:
        self.wishes.append(wish)
        return self._late


class Time:
    """A clock that goes on only where somebody sleeps."""

    def __init__(self) -> None:
        self.seconds = 0.0

    def sleep(self, seconds: float) -> None:
        self.seconds += seconds

    def monotonic(self) -> float:
        return self.seconds

    def now(self) -> datetime:
        return START + timedelta(seconds=self.seconds)


def player(senses: Hearsay, seed: int = 0, world: World | None = None) -> Player:
    numbers, time = itertools.count(1), Time()
    floor = FloorAgent("floor", np.random.default_rng(seed), lambda: f"floor/{next(numbers)}")
    return Player(
        world or new_world(),
        floor,
        senses,
        speed=1.0,
        clock=time.now,
        sleep=time.sleep,
        monotonic=time.monotonic,
    )


def acted(world: World, action: tuple[object, ...]) -> None:
    """Do it as far as the room's laws allow."""
    name, *arguments = action
    if name == "walk":
        mover, xy = arguments
        world.movers[str(mover)].xy = xy  # type: ignore[assignment]  # as if the way were walked
        return
    with contextlib.suppress(Impossible):
        getattr(world, str(name))(*arguments)


def observed(seed: int, actions: list[tuple[object, ...]]) -> tuple[World, list[Observation]]:
    """What the floor sensor says while the actions happen."""
    senses = Hearsay()
    playing = player(senses, seed)
    playing.switch_on()
    for action in actions:
        acted(playing.world, action)
        playing.play(iter([None] * 3))
    return playing.world, senses.said


@given(st.lists(ACTIONS, max_size=60))
def test_a_thing_is_in_exactly_one_place_and_a_place_holds_one_thing(actions: list[tuple[object, ...]]) -> None:
    world = new_world()
    for action in actions:
        acted(world, action)
        assert world.places.keys() == world.things.keys()
        exclusive: list[Place] = [
            place for place in world.places.values() if not hasattr(place, "by") and place != Outside()
        ]
        gripped = [tag for tag in world.places if tag == world.gripped_by(ROBOT)]
        assert len(set(exclusive)) == len(exclusive)
        assert len(gripped) <= 1


@given(st.lists(ACTIONS, max_size=60))
def test_what_is_in_the_room_does_not_come_in_again(actions: list[tuple[object, ...]]) -> None:
    world = new_world()
    for action in actions:
        before = dict(world.places)
        acted(world, action)
        assert all(world.places[tag] != Outside() for tag, place in before.items() if place != Outside())


@given(st.integers(0, 2**32), st.lists(ACTIONS, max_size=40))
def test_labels_are_the_floor_sensors_own_and_never_used_again(seed: int, actions: list[tuple[object, ...]]) -> None:
    _, said = observed(seed, actions)
    assert [one.seq for one in said] == list(range(len(said)))
    assert [one.observed_at for one in said] == sorted(one.observed_at for one in said)
    born = [label for one in said for label in born_in(one)]
    assert len(set(born)) == len(born)
    alive: set[str] = set()
    for one in said:
        born_now = set(born_in(one))
        assert set(labels_named(one)) <= alive | born_now
        assert all(label.startswith("floor/") for label in labels_named(one))
        alive |= born_now
        if isinstance(one, LabelVanished):
            alive.remove(one.label)


@given(st.integers(0, 2**32), st.lists(ACTIONS, max_size=40))
def test_the_same_seed_says_the_same(seed: int, actions: list[tuple[object, ...]]) -> None:
    assert observed(seed, actions)[1] == observed(seed, actions)[1]


@given(st.lists(ACTIONS, max_size=40))
def test_one_instant_is_told_in_order(actions: list[tuple[object, ...]]) -> None:
    order = {"label_vanished": 0, "mover_entered": 1, "label_moved": 1}
    ranks = [(one.observed_at, order.get(one.type, 2)) for one in observed(0, actions)[1]]
    assert ranks == sorted(ranks)


def test_the_story_can_be_played_and_the_floor_sensor_tells_no_tag_and_no_weight() -> None:
    senses = Hearsay()
    playing = player(senses)
    playing.switch_on()
    for script in (furnish(playing.world), *(step.act(playing.world) for step in STEPS)):
        playing.play(script)
    appeared = [one for one in senses.said if isinstance(one, LabelAppeared)]
    assert [(one.kind, one.tag, one.weight_g) for one in appeared] == [("floor", None, None)]
    assert playing.world.time_s < 40
    assert len(senses.wishes) > len(STEPS)


def test_while_a_script_waits_the_room_stands_still_and_clocks_go_on() -> None:
    senses = Hearsay(late="agent cabinet-a is late: it has told of 1 things on its board, there are 2")
    playing = player(senses)
    playing.switch_on()
    with pytest.raises(CommandError, match=f"agent cabinet-a is late: .* there are 2, for {LATE_S:.0f} s"):
        playing.play(iter([None, Told()]))
    assert playing.world.time_s == pytest.approx(0.1)
    assert playing.now - START > timedelta(seconds=LATE_S)
    assert [one.type for one in senses.said][:3] == ["inventory", "agent_state", "agent_state"], "signs of life"
    playing.play(iter([Told(or_go_on=True)]))


def test_after_a_stall_nobody_leaps() -> None:
    time, world, way = Time(), new_world(), list[tuple[float, Xy]]()

    class Watch(Hearsay):
        def follow(self, world: World) -> None:
            way.append((time.seconds, world.movers[PERSON].xy))

    def sleep(seconds: float) -> None:
        time.sleep(seconds + (3.0 if len(way) == 10 else 0.0))

    floor = FloorAgent("floor", np.random.default_rng(0), lambda: "floor/1")
    playing = Player(world, floor, Watch(), speed=1.0, clock=time.now, sleep=sleep, monotonic=time.monotonic)
    playing.play(walk(world, PERSON, "bed", "front of A"))
    assert way[-1][0] > 3.0
    assert playing.now == time.now()
    for (before, here), (after, there) in itertools.pairwise(way):
        assert math.dist(here, there) <= world.movers[PERSON].speed * (after - before) + 1e-9


def test_walking_takes_time_and_arrives() -> None:
    world = new_world()
    person = world.movers[PERSON]
    person.walk([(1.0, 2.0), (3.0, 2.0)])
    way = math.dist(person.xy, (1.0, 2.0)) + 2.0
    steps = 0
    while person.path:
        before = person.xy
        world.step(0.1)
        assert math.dist(before, person.xy) <= person.speed * 0.1 + 1e-9
        steps += 1
    assert person.xy == (3.0, 2.0)
    assert steps == math.ceil(way / (person.speed * 0.1) - 1e-9)


def test_a_hand_takes_its_time_to_reach_out() -> None:
    world = new_world()
    robot = world.movers[ROBOT]
    script: Script = reach(world, ROBOT, (0.7, 0.8))
    for _ in script:
        before = robot.hand
        world.step(0.1)
        assert math.dist(before, robot.hand) <= HAND_SPEED * 0.1 + 1e-9
    assert robot.hand == (0.7, 0.8)
    assert math.dist(robot.gripper, robot.xy) == pytest.approx(0.7)


def test_the_floor_sensor_follows_a_person_who_walks() -> None:
    senses = Hearsay()
    playing = player(senses)
    playing.switch_on()
    playing.world.movers[PERSON].walk([(0.75, 3.3)])
    playing.play(iter([None] * 25))
    moved = [one for one in senses.said if isinstance(one, LabelMoved)]
    assert 5 <= len(moved) <= 9
    assert math.dist(moved[-1].xy, (0.75, 3.3)) < 0.1


def test_ways_touch_no_furniture_but_the_bed_one_lies_on() -> None:
    room = description()
    for a, b in WAYS:
        for i in range(101):
            x = SPOTS[a][0] + i / 100 * (SPOTS[b][0] - SPOTS[a][0])
            y = SPOTS[a][1] + i / 100 * (SPOTS[b][1] - SPOTS[a][1])
            hit = [one.id for one in room.furniture if _in_box((x, y), one.polygon)]
            assert hit == [] or (hit == ["bed"] and "bed" in (a, b)), f"{a} - {b} passes {hit}"


def test_slots_are_on_their_boards() -> None:
    for cabinet in CABINETS:
        assert all(_in_box(slot, cabinet.outline) for slot in cabinet.slots)


def test_tags_and_jans_are_well_formed() -> None:
    assert len({item.tag for item in ITEMS}) == len({item.jan for item in ITEMS}) == 10
    assert all(len(item.tag) == 16 and item.tag.startswith("E00401") for item in ITEMS)
    assert with_check_digit("400638133393") == "4006381333931"


def born_in(one: Observation) -> list[str]:
    if isinstance(one, Inventory):
        return [item.label for item in one.labels]
    return [one.label] if one.type in ("label_appeared", "mover_entered") else []  # type: ignore[union-attr]


def _in_box(xy: Xy, polygon: list[tuple[float, float]]) -> bool:
    xs, ys = zip(*polygon, strict=True)
    return min(xs) < xy[0] < max(xs) and min(ys) < xy[1] < max(ys)
