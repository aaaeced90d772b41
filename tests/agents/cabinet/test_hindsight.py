"""Everything since the last rest looked at as one: which outcome is most probable, and how the shelf is put right."""

from __future__ import annotations

import math

import numpy as np
import pytest
from cabinet_bench import GEOMETRY, share
from hypothesis import given, settings
from hypothesis import strategies as st

from tms_agents.cabinet import Appeared, Identified, KnownWeight, Vanished
from tms_agents.cabinet.episodes import Episode, Outcome, outcomes
from tms_agents.cabinet.events import CabinetEvent
from tms_agents.cabinet.plans import Known, plans_of
from tms_agents.cabinet.revising import Revision, current, order
from tms_agents.cabinet.stays import Shelf, Thing

NOISE = np.full(4, 2.0)
HERE, AWAY = (0.0, -30.0), (-30.0, 0.0)  # rounds that say: it is there, it is not
WEIGHTS = {"A": 300.0, "B": 150.0, "C": 60.0, "N": 220.0}


def weight(tag: str) -> KnownWeight | None:
    return KnownWeight(WEIGHTS[tag], 3.0) if tag in WEIGHTS else None


def before() -> tuple[Episode, dict[str, Thing]]:
    """Three tagged things on the board at rest."""
    places = {"A": (0.1, 0.1), "B": (0.35, 0.2), "C": (0.2, 0.25)}
    things = [
        Thing(i, WEIGHTS[tag] * share(*at), NOISE.copy(), 0.0, 0.0, tag=tag)
        for i, (tag, at) in enumerate(places.items(), 1)
    ]
    level = sum((thing.load for thing in things), np.zeros(4))
    return Episode(level, NOISE, things, 10.0, 10.0), {str(thing.tag): thing for thing in things}


def known(*there: str, shaking: bool = False) -> Known:
    return Known(there, lambda tag: HERE if tag in there else AWAY, weight, shaking)


def best(episode: Episode, level: np.ndarray, facts: Known) -> Outcome:
    found = outcomes(episode, 20.0, level, NOISE, facts, GEOMETRY, 0.01)
    assert sum(one.score for one in found) == pytest.approx(1.0)
    return found[0]


def test_one_out_and_another_in_at_once_are_told_by_load_and_tags() -> None:
    episode, things = before()
    level = episode.level - things["B"].load + 220 * share(0.3, 0.1)
    found = best(episode, level, known("A", "C", "N"))
    assert (found.gone, found.new) == ({things["B"].id}, ("N",))
    assert found.score > 0.9
    np.testing.assert_allclose(found.load, 220 * share(0.3, 0.1), atol=1e-6)


def test_a_light_thing_that_went_beside_a_heavy_one_is_missed_by_its_tag() -> None:
    episode, things = before()
    level = episode.level - things["C"].load + 220 * share(0.2, 0.2)
    assert best(episode, level, known("A", "B", "N")).gone == {things["C"].id}
    heavy_only = best(episode, episode.level + 220 * share(0.2, 0.2), known("A", "B", "C", "N"))
    assert (heavy_only.gone, heavy_only.new) == (frozenset(), ("N",))


def test_nothing_changed_is_an_outcome_too() -> None:
    episode, _ = before()
    found = best(episode, episode.level + 1.0, known("A", "B", "C"))
    assert (found.gone, found.new, found.known) == (frozenset(), (), True)


@pytest.mark.parametrize(
    ("since", "at", "new"), [(6.0, (0.3, 0.1), ()), (6.0, (0.1, 0.1), (None,)), (0.0, (0.3, 0.1), (None,))]
)
def test_a_little_more_where_something_was_just_put_is_the_rest_of_it(
    since: float, at: tuple[float, float], new: tuple[str | None, ...]
) -> None:
    first = Thing(1, 26 * share(0.3, 0.1), NOISE.copy(), since, since - 1.0)
    episode = Episode(first.load.copy(), NOISE, [first], 10.0, 10.0)
    assert best(episode, episode.level + 18 * share(*at), known()).new == new


def test_what_no_thing_explains_is_not_explained() -> None:
    episode, _ = before()
    found = best(episode, episode.level - 900 * share(0.2, 0.15), known("A", "B", "C"))  # more than stood there
    assert not found.known


def test_a_shaken_board_is_given_the_benefit_of_the_doubt() -> None:
    episode, _ = before()
    swing = episode.level + np.array([9.0, 7.0, -6.0, 8.0])
    calm = outcomes(episode, 20.0, swing, NOISE, known("A", "B", "C"), GEOMETRY, 0.01)
    shaken = outcomes(episode, 20.0, swing, NOISE, known("A", "B", "C", shaking=True), GEOMETRY, 0.01)

    def nothing(found: list[Outcome]) -> float:
        return sum(one.score for one in found if one.known and not one.gone and not one.new)

    assert nothing(shaken) > nothing(calm)


@given(st.permutations(["A", "B", "C"]), st.permutations(["N", "X"]))
def test_the_order_of_things_and_tags_does_not_matter(things: list[str], tags: list[str]) -> None:
    episode, by_tag = before()
    level = episode.level - by_tag["A"].load + 220 * share(0.3, 0.1)
    usual = outcomes(episode, 20.0, level, NOISE, known("B", "C", "N", "X"), GEOMETRY, 0.01)
    mixed = Episode(episode.level, NOISE, [by_tag[tag] for tag in things], 10.0, 10.0)
    other = outcomes(mixed, 20.0, level, NOISE, known("C", *tags, "B"), GEOMETRY, 0.01)
    assert (usual[0].gone, order(usual[0].new)) == (other[0].gone, order(other[0].new))
    assert usual[0].score == pytest.approx(other[0].score, abs=1e-6)


@settings(max_examples=50)
@given(st.integers(0, 5), st.lists(st.sampled_from(["N", "X", "Y"]), unique=True), st.booleans())
def test_every_plan_is_there_once_and_possible(count: int, tags: list[str], shaking: bool) -> None:
    things = [Thing(i, 100 * share(0.2, 0.2), NOISE, 0.0, 0.0, tag="ABC"[i] if i < 3 else None) for i in range(count)]
    plans = list(plans_of(things, Known(tags, lambda _: (-1.0, -2.0), weight, shaking)))
    assert len({(plan.gone, order(plan.new)) for plan in plans}) == len(plans)
    for prior, gone, new in plans:
        assert math.isfinite(prior) and gone <= {thing.id for thing in things} and len(new) <= 2
        own = {thing.tag for thing in things if thing.id not in gone}
        assert not own & {tag for tag in new if tag is not None}, "what stands there has not come"


@settings(max_examples=100)
@given(st.data())
def test_a_revised_shelf_is_what_the_outcome_says(data: st.DataObject) -> None:
    episode, things = before()
    shelf = Shelf(GEOMETRY)
    for thing in episode.things:
        shelf.put(thing.load.copy(), NOISE.copy(), 0.0, 0.0).tag = thing.tag
    for i in data.draw(st.sets(st.sampled_from([1, 2, 3]))):  # told before, rightly or wrongly
        del shelf.things[i]
    for tag in data.draw(st.lists(st.sampled_from(["N", None]), max_size=2, unique=True)):
        shelf.put(100 * share(0.3, 0.15), NOISE.copy(), 10.0, 10.0).tag = tag
    standing = set(shelf.things)
    gone = frozenset(data.draw(st.sets(st.sampled_from([1, 2, 3]), max_size=2)))
    lifted = [thing.tag for thing in things.values() if thing.id in gone]
    new = tuple(data.draw(st.lists(st.sampled_from(["N", None, *lifted]), max_size=2, unique=True)))
    load = 250 * share(0.3, 0.1) if new else np.zeros(4)

    def pin(now: float, thing: Thing, tag: str) -> CabinetEvent:
        thing.tag = tag
        return Identified(now, thing.id, tag)

    outcome = Outcome(gone, new, 1.0, load, NOISE)
    events = Revision(shelf, episode, outcome, 20.0, pin=pin, left=lambda _: None, weight=weight).events()
    assert current(episode, shelf)[0] - gone == frozenset()
    tags = [thing.tag for thing in episode.things if thing.id not in gone]
    assert order(thing.tag for thing in shelf.things.values()) == order([*tags, *new])
    for event in events:  # a stay appears once, after it was not there, and vanishes only while it stands
        if isinstance(event, Appeared):
            assert event.stay not in standing
            standing.add(event.stay)
        elif isinstance(event, Vanished):
            standing.remove(event.stay)
        elif isinstance(event, Identified):
            assert event.stay in standing
    assert standing == set(shelf.things)
