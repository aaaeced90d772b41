"""The simulated room: its physical laws, and what its sensor agents may say of it."""

from __future__ import annotations

import contextlib
import math
from datetime import UTC, datetime

from hypothesis import given
from hypothesis import strategies as st

from tms_agents.simulation.catalogue import ITEMS, with_check_digit
from tms_agents.simulation.player import Player, Watched, agents
from tms_agents.simulation.room import PERSON, ROBOT, SPOTS, WAYS, description, new_world
from tms_agents.simulation.story import STEPS
from tms_agents.simulation.world import Impossible, InCabinet, Place, World, Xy
from tms_schemas.observation import (
    Inventory,
    LabelAppeared,
    LabelVanished,
    Observation,
    TagObserved,
    Transfer,
    labels_named,
)

START = datetime(2026, 1, 1, tzinfo=UTC)
TAGS = st.sampled_from([item.tag for item in ITEMS])
SPOT = st.sampled_from(list(SPOTS.values()))
ACTIONS = st.one_of(
    st.tuples(st.just("take"), st.just(PERSON), TAGS),
    st.tuples(
        st.just("put"),
        st.just(PERSON),
        TAGS,
        st.sampled_from(["cabinet-a", "cabinet-b", "cabinet-c"]),
        st.integers(0, 4),
    ),
    st.tuples(st.just("drop"), st.just(PERSON), TAGS, SPOT),
    st.tuples(st.just("give"), st.just(PERSON), TAGS, st.just(ROBOT)),
    st.tuples(st.just("set_down"), st.just(ROBOT), st.just("table/top"), SPOT),
    st.tuples(st.just("walk"), st.sampled_from([PERSON, ROBOT]), SPOT),
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


def observed(seed: int, actions: list[tuple[object, ...]]) -> tuple[World, dict[str, list[Observation]]]:
    """What every agent says while the actions happen."""
    world = new_world()
    said: dict[str, list[Observation]] = {agent.agent: [] for agent in agents(seed, weigh=True)}
    watching = agents(seed, weigh=True)
    player = Player(
        world,
        [Watched(agent, said[agent.agent].extend) for agent in watching],
        speed=1.0,
        clock=lambda: START,
        sleep=lambda _: None,
    )
    player.switch_on()
    for action in actions:
        acted(world, action)
        player.play(iter([None] * 3))
    return world, said


@given(st.lists(ACTIONS, max_size=60))
def test_a_thing_is_in_exactly_one_place_and_a_place_holds_one_thing(actions: list[tuple[object, ...]]) -> None:
    world = new_world()
    for action in actions:
        acted(world, action)
        assert world.places.keys() == world.things.keys()
        exclusive: list[Place] = [place for place in world.places.values() if not hasattr(place, "by")]
        gripped = [tag for tag in world.places if tag == world.gripped_by(ROBOT)]
        assert len(set(exclusive)) == len(exclusive)
        assert len(gripped) <= 1


@given(st.integers(0, 2**32), st.lists(ACTIONS, max_size=40))
def test_labels_are_the_agents_own_and_never_used_again(seed: int, actions: list[tuple[object, ...]]) -> None:
    _, said = observed(seed, actions)
    for agent, observations in said.items():
        assert [one.seq for one in observations] == list(range(len(observations)))
        assert [one.observed_at for one in observations] == sorted(one.observed_at for one in observations)
        born = [label for one in observations for label in born_in(one)]
        assert len(set(born)) == len(born)
        alive: set[str] = set()
        for one in observations:
            born_now = set(born_in(one))
            assert set(labels_named(one)) <= alive | born_now
            assert all(label.startswith(f"{agent}/") for label in labels_named(one))
            alive |= born_now
            if isinstance(one, LabelVanished):
                alive.remove(one.label)
            if isinstance(one, Transfer):
                alive.remove(one.from_)


@given(st.integers(0, 2**32), st.lists(ACTIONS, max_size=40))
def test_the_cabinets_labels_are_what_stands_in_it(seed: int, actions: list[tuple[object, ...]]) -> None:
    world, said = observed(seed, actions)
    for cabinet in world.cabinets:
        alive = set()
        for one in said[cabinet]:
            alive |= set(born_in(one))
            if isinstance(one, LabelVanished):
                alive.remove(one.label)
        inside = [place for place in world.places.values() if isinstance(place, InCabinet) and place.cabinet == cabinet]
        assert len(alive) == len(inside)


@given(st.integers(0, 2**32), st.lists(ACTIONS, max_size=40))
def test_the_same_seed_says_the_same(seed: int, actions: list[tuple[object, ...]]) -> None:
    assert observed(seed, actions)[1] == observed(seed, actions)[1]


@given(st.lists(ACTIONS, max_size=40))
def test_one_instant_is_told_in_order(actions: list[tuple[object, ...]]) -> None:
    order = {"label_vanished": 0, "transfer": 0, "mover_entered": 1, "label_moved": 1, "pose": 1}
    for observations in observed(0, actions)[1].values():
        ranks = [
            (one.observed_at, order.get(one.type, 3 if isinstance(one, TagObserved) else 2)) for one in observations
        ]
        assert ranks == sorted(ranks)


def test_the_floor_sensor_tells_no_tag_and_without_scales_no_weight() -> None:
    world = new_world()
    said: list[Observation] = []
    player = Player(
        world,
        [Watched(agent, said.extend) for agent in agents(1, weigh=False)],
        speed=1.0,
        clock=lambda: START,
        sleep=lambda _: None,
    )
    player.switch_on()
    for step in STEPS:
        player.play(step.act(world))
    appeared = [one for one in said if isinstance(one, LabelAppeared)]
    assert [one.kind for one in appeared] == ["floor", "robot", "cabinet"]
    assert [one.reader_present for one in appeared] == [False, True, False]
    assert all(one.weight_g is None for one in said if isinstance(one, LabelAppeared | LabelVanished))
    assert world.time_s < 40


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


def test_ways_touch_no_furniture_but_the_bed_one_lies_on() -> None:
    room = description()
    for a, b in WAYS:
        for i in range(101):
            x = SPOTS[a][0] + i / 100 * (SPOTS[b][0] - SPOTS[a][0])
            y = SPOTS[a][1] + i / 100 * (SPOTS[b][1] - SPOTS[a][1])
            hit = [one.id for one in room.furniture if _in_box((x, y), one.polygon)]
            assert hit == [] or (hit == ["bed"] and "bed" in (a, b)), f"{a} - {b} passes {hit}"


def test_tags_and_jans_are_well_formed() -> None:
    assert len({item.tag for item in ITEMS}) == len({item.jan for item in ITEMS}) == 10
    assert all(len(item.tag) == 16 and item.tag.startswith("E00401") for item in ITEMS)
    assert with_check_digit("400638133393") == "4006381333931"


def born_in(one: Observation) -> list[str]:
    if isinstance(one, Inventory):
        return [item.label for item in one.labels]
    if isinstance(one, Transfer):
        return [one.to]
    return [one.label] if one.type in ("label_appeared", "mover_entered") else []  # type: ignore[union-attr]


def _in_box(xy: Xy, polygon: list[tuple[float, float]]) -> bool:
    xs, ys = zip(*polygon, strict=True)
    return min(xs) < xy[0] < max(xs) and min(ys) < xy[1] < max(ys)
