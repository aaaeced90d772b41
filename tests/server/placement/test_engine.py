"""Laws of the engine: determinism, idleness, state files, budgets, the certificate, the registry."""

import json
import math
from random import Random
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pydantic import TypeAdapter

from tms_schemas.events import AnyEvent, Event
from tms_schemas.scenario import Scenario, read_scenario
from tms_server.placement import (
    DrawKey,
    Engine,
    InvalidEvent,
    LabelSpec,
    ObjectSpec,
    ParameterError,
    Parameters,
)
from tms_server.placement.replay import scenario_filter

from .oracle import Oracle
from .worlds import WorldMaker

seeds = st.integers(0, 2**32)
ADAPTER: TypeAdapter[Event] = TypeAdapter(AnyEvent)


def event(name: str, /, **fields: Any) -> Event:
    return ADAPTER.validate_python({"type": name, **fields})


def world(seed: int, events: int = 12) -> Scenario:
    return read_scenario(json.dumps(WorldMaker(Random(seed), events=events).scenario))


def engine_of(scenario: Scenario, budget: int | None) -> Engine:
    engine = scenario_filter(scenario, "exact" if budget is None else "particle", particles=budget)
    assert isinstance(engine, Engine)
    return engine


def key(i: int) -> DrawKey:
    return DrawKey(7, "agent", i)


def small(budget: int | None = None, **params: Any) -> Engine:
    """Three tagged objects in a cabinet, one person beside it and one across the room."""
    return Engine(
        [ObjectSpec(id=n, tag=f"T{n}", weight_g=100.0 * (i + 1)) for i, n in enumerate("abc")],
        [
            *(LabelSpec(id=f"A{n}", kind="cabinet", xy=(0.1 * i, 0.0)) for i, n in enumerate("abc")),
            LabelSpec(id="P", kind="mover", xy=(0.0, 0.3)),
            LabelSpec(id="Q", kind="mover", xy=(1.0, 0.3)),
        ],
        {"type": "known", "placement": {n: f"A{n}" for n in "abc"}},
        Parameters.of(params),
        budget=budget,
    )


@given(seeds, st.sampled_from([None, 1, 3, 10]))
@settings(max_examples=80)
def test_a_restored_engine_goes_on_bit_for_bit(seed: int, budget: int | None) -> None:
    scenario = world(seed)
    engine = engine_of(scenario, budget)
    straight = engine.copy()
    for i, e in enumerate(scenario.events):
        if i % 3 == 1:
            engine = Engine.from_bytes(engine.to_bytes())
        assert engine.apply(e, key(i)) == straight.apply(e, key(i))
        assert engine.marginals() == straight.marginals()
        if engine.n_hypotheses > 5000:
            return
    assert engine.to_bytes() == straight.to_bytes()


@given(seeds, st.sampled_from([1, 4, 20]))
@settings(max_examples=80)
def test_a_budget_is_kept_and_the_belief_stays_a_distribution(seed: int, budget: int) -> None:
    scenario = world(seed, events=20)
    engine = engine_of(scenario, budget)
    start = engine.n_hypotheses
    for i, e in enumerate(scenario.events):
        before = engine.marginals()
        info = engine.apply(e, key(i))
        assert engine.n_hypotheses == info.hypotheses
        assert info.hypotheses <= max(budget, start)  # a start may be larger until it is first thinned
        assert math.isfinite(info.log_evidence)
        after = engine.marginals()
        for o, pie in after.items():
            assert math.fsum(pie.values()) == pytest.approx(1.0, abs=1e-12)
            assert o in info.changed or pie == before[o]


@given(seeds)
@settings(max_examples=40)
def test_idle_events_change_no_bit(seed: int) -> None:
    scenario = world(seed)
    engine = engine_of(scenario, 5)
    for i, e in enumerate(scenario.events):
        engine.apply(e, key(i))
    before = list(engine.hypotheses())
    for i in range(50):
        assert engine.apply(event("tick", n=5), key(100 + i)).changed == frozenset()
        for name, label in engine.labels.items():
            if not label.ghost:
                engine.apply(event("label_moved", label=name, xy=label.xy), key(1000 + i))
    assert list(engine.hypotheses()) == before


@given(st.sampled_from("abc"), st.floats(50.0, 400.0))
@settings(max_examples=30)
def test_a_weight_tells_the_same_with_the_label_and_after_it(left: str, grams: float) -> None:
    at_once, later = (small(p_phantom={"cabinet": 0.1}, p_jump=0.01) for _ in range(2))
    put = {"label": "B1", "kind": "cabinet", "xy": (0.5, 0.3)}
    for engine in (at_once, later):
        for thing in "abc".replace(left, ""):
            engine.apply(event("label_vanished", label=f"A{thing}"), key(0))
    at_once.apply(event("label_appeared", **put, weight_g=grams), key(1))
    later.apply(event("label_appeared", **put), key(1))
    later.apply(event("load_change", labels=["B1"], weight_g=grams), key(2))
    for thing in "abc":
        assert later.marginal(thing) == pytest.approx(at_once.marginal(thing), abs=1e-9)


def test_draws_follow_the_key_alone() -> None:
    def dropped(seed: int) -> bytes:
        engine = small(budget=1)
        for i, n in enumerate("abc"):
            engine.apply(event("label_vanished", label=f"A{n}"), DrawKey(seed, "x", i))
        engine.apply(event("label_appeared", label="F", kind="floor", xy=[0, 0]), DrawKey(seed, "x", 3))
        return engine.to_bytes()

    assert dropped(1) == dropped(1)
    assert len({dropped(seed) for seed in range(10)}) > 1


def test_resampling_is_unbiased() -> None:
    sums: dict[str, float] = {}
    for seed in range(400):
        engine = small(budget=2)
        for i, n in enumerate("abc"):
            engine.apply(event("label_vanished", label=f"A{n}", dest="P"), DrawKey(seed, "x", i))
        info = engine.apply(event("label_appeared", label="F", kind="floor", xy=[0, 0]), DrawKey(seed, "x", 9))
        assert info.resampled
        assert info.hypotheses == 2
        for o in "abc":
            sums[o] = sums.get(o, 0.0) + engine.marginal(o).get("F", 0.0) / 400
    assert all(p == pytest.approx(1 / 3, abs=0.05) for p in sums.values())


@pytest.mark.parametrize("damage", ["cut", "flip", "empty", "other"])
def test_damaged_state_files_are_refused(damage: str) -> None:
    data = small().to_bytes()
    bad = {
        "cut": data[:-3],
        "flip": data[:60] + bytes([data[60] ^ 1]) + data[61:],
        "empty": b"",
        "other": b"something else entirely",
    }[damage]
    with pytest.raises(ValueError, match="state"):
        Engine.from_bytes(bad)


@pytest.mark.parametrize(
    "bad",
    [
        event("label_vanished", label="nowhere"),
        event("label_vanished", label="P"),
        event("label_appeared", label="Aa", kind="floor", xy=[0, 0]),
        event("label_appeared", label="F", kind="floor", xy=[0, 0], source="Aa"),
        event("label_appeared", label="F", kind="floor", xy=[0, 0], source={"xy": [0, 0]}),
        event("mover_entered", label="P", xy=[0, 0]),
        event("mover_left", label="Aa"),
        event("label_moved", label="gone", xy=[0, 0]),
        event("handover", **{"from": "P", "to": "Aa"}),
        event("mover_swap", a="P", b="Z", p=0.5),
        event("transfer", **{"from": "Aa", "to": "Ab"}),
        event("tag_observed", labels=["Aa", "Z"], tag="Ta"),
        event("load_change", labels=["Aa", "P"], weight_g=3.0),
        event("correction", tag="Ta", label="Z"),
    ],
    ids=lambda e: e.type,
)
def test_invalid_events_change_nothing(bad: Event) -> None:
    engine = small(p_jump=0.1, p_return=0.2)
    before = engine.to_bytes()
    with pytest.raises(InvalidEvent):
        engine.apply(bad, key(0))
    assert engine.to_bytes() == before


def test_a_ghost_is_not_active() -> None:
    engine = small(p_occlude={"cabinet": 0.5})
    engine.apply(event("label_vanished", label="Aa"), key(0))
    assert engine.labels["Aa"].ghost
    assert engine.marginal("a")["Aa"] == pytest.approx(0.5)
    for bad in (event("label_moved", label="Aa", xy=[0, 0]), event("label_vanished", label="Aa")):
        with pytest.raises(InvalidEvent):
            engine.apply(bad, key(1))


def test_transfer_of_several_things_to_one_place_is_invalid() -> None:
    engine = small()
    for i, n in enumerate("ab"):
        engine.apply(event("label_vanished", label=f"A{n}", dest="P"), key(i))
    with pytest.raises(InvalidEvent):
        engine.apply(event("transfer", **{"from": "P", "to": "T", "kind": "table"}), key(5))


@given(seeds, st.sampled_from([1e-2, 1e-4, 1e-9]))
@settings(max_examples=60)
def test_the_certificate_bounds_what_pruning_lost(seed: int, eps: float) -> None:
    maker = WorldMaker(Random(seed), events=10)
    full = Oracle(maker.scenario)
    pruned = engine_of(
        read_scenario(
            json.dumps({**maker.scenario, "params": {**maker.scenario["params"], "prune_eps": eps, "p_jump": 0.05}})
        ),
        None,
    )
    full.p["p_jump"] = 0.05
    for i, (raw, e) in enumerate(
        zip(maker.scenario["events"], read_scenario(json.dumps(maker.scenario)).events, strict=True)
    ):
        _, impossible = full.apply(raw)
        info = pruned.apply(e, key(i))
        if impossible or len(full.belief) > 5000:
            return
        assert info.pruned <= eps
        exact = full.marginals()
        for o, pie in pruned.marginals().items():
            labels = set(pie) | set(exact[o])
            tv = 0.5 * sum(abs(pie.get(x, 0.0) - exact[o].get(x, 0.0)) for x in labels)
            assert tv <= info.tv_bound + 1e-9


def test_contradictions_leave_a_usable_belief() -> None:
    engine = small()
    for i in range(3):  # nobody holds anything, so nothing can have been put down
        info = engine.apply(event("label_appeared", label=f"F{i}", kind="floor", xy=[0, 0]), key(i))
        assert info.contradiction
        assert info.log_evidence == 0.0
    assert engine.marginal("a") == {"Aa": 1.0}
    engine.apply(event("label_vanished", label="Aa", dest="P"), key(9))
    assert engine.marginal("a") == {"P": 1.0}


def test_objects_come_change_and_go() -> None:
    engine = small()
    for i, n in enumerate("abc"):
        engine.apply(event("label_vanished", label=f"A{n}"), key(i))
    engine.apply(event("label_appeared", label="F", kind="floor", xy=[0, 0]), key(3))
    before = engine.marginals()
    engine.add_object(ObjectSpec(id="d", tag="TD"))
    assert engine.marginals() == {**before, "d": {"OUT": 1.0}}
    engine.remove_object("b")
    for o in "ac":
        assert engine.marginal(o) == pytest.approx(before[o])
    with pytest.raises(KeyError):
        engine.marginal("b")
    with pytest.raises(ValueError, match="tag"):
        engine.add_object(ObjectSpec(id="e", tag="Td"))
    engine.change_object(ObjectSpec(id="c", tag="NEW"))
    engine.apply(event("tag_observed", label="F", tag="NEW"), key(4))
    assert engine.marginal("c")["F"] > before["c"]["F"] + 0.2


def test_a_live_room_learns_where_an_unseen_object_is() -> None:
    labels = [LabelSpec(id="P", kind="mover", xy=(0.0, 0.0))]
    engine = Engine(
        [ObjectSpec(id="a", tag="TA")], labels, {"type": "known"}, Parameters.of(profile="live"), budget=100
    )
    info = engine.apply(event("label_appeared", label="L", kind="cabinet", xy=[0, 0], tag="TA"), key(0))
    assert not info.contradiction
    assert engine.marginal("a")["L"] > 0.6
    engine.apply(event("tag_observed", label="L", tag="TA"), key(1))
    assert engine.marginal("a")["L"] > 0.99


def test_what_was_outside_is_found_by_a_jump_of_its_own() -> None:
    """``p_jump`` of an event moves what is outside; what stands in a cabinet stays there."""
    engine = small()
    engine.add_object(ObjectSpec(id="d", tag="Td"))
    found = event("label_appeared", label="L", kind="cabinet", xy=[0, 0], tag="Td")
    assert not engine.apply(found, key(0), p_jump=1.0).contradiction
    assert engine.marginal("d")["L"] == 1.0
    assert all(engine.marginal(n) == {f"A{n}": 1.0} for n in "abc")


@given(seeds, st.floats(0.01, 0.33))
@settings(max_examples=40)
def test_an_object_may_join_at_several_places(seed: int, p: float) -> None:
    """The prior is respected, occupied labels are refused, the others' marginals stay, and all still sums to 1."""
    scenario = world(seed)
    engine = engine_of(scenario, None)
    for e in scenario.events[:5]:
        engine.apply(e, key(0))
    before, free = engine.marginals(), {}
    places = [name for name, state in engine.labels.items() if not state.ghost][:3]
    for name in places:
        occupied = sum(m.get(name, 0.0) for m in before.values()) if engine.labels[name].kind != "mover" else 0.0
        free[name] = p * (1.0 - occupied)
    engine.add_object(ObjectSpec(id="new", tag="NEW"), dict.fromkeys(places, p))
    after = engine.marginals()
    mine = after.pop("new")
    assert after == {o: pytest.approx(m) for o, m in before.items()}
    assert mine.get("OUT", 0.0) == pytest.approx(1.0 - sum(free.values()))
    assert all(mine.get(name, 0.0) == pytest.approx(q, abs=1e-12) for name, q in free.items())


def test_a_person_corrects_the_belief() -> None:
    engine = small(p_jump=0.01)
    engine.apply(event("label_appeared", label="T", kind="table", xy=[5, 5]), key(0))
    for i in range(3):
        engine.apply(event("correction", tag="Ta", label="T"), key(i))
    assert engine.marginal("a")["T"] > 0.99
    engine = small()
    engine.apply(event("label_vanished", label="Aa"), key(0))
    engine.apply(event("correction", tag="Ta", label="P", present=False), key(1))
    assert engine.marginal("a")["P"] < 0.05


@pytest.mark.parametrize(
    ("bad", "named"),
    [
        ({"sigma": 1}, "sigma"),
        ({"p_jump": 2}, "p_jump"),
        ({"p_read": "x"}, "p_read"),
        ({"alpha": {"shelf": 0.5}}, "shelf"),
        ({"alpha": 0.5}, "alpha"),
        ({"mover_choice": "any"}, "mover_choice"),
        ({"use_weight": 1}, "use_weight"),
        ({"p_phantom": {"floor": 0.8}, "p_jump": 0.3}, "p_phantom"),
        ({"sigma_m": float("nan")}, "sigma_m"),
    ],
)
def test_bad_parameters_are_named(bad: dict[str, Any], named: str) -> None:
    with pytest.raises(ParameterError, match=named):
        Parameters.of(bad)


def test_parameters_survive_their_json_form() -> None:
    p = Parameters.of({"gate_m": 2.0}, profile="live")
    assert Parameters.of(json.loads(json.dumps(p.to_dict()))) == p


@pytest.mark.parametrize(
    "initial",
    [
        {"type": "known", "placement": {"z": "Aa"}},
        {"type": "known", "placement": {"a": "nowhere"}},
        {"type": "known", "placement": {"a": "Aa", "b": "Aa"}},
        {"type": "list", "hypotheses": []},
        {"type": "other"},
    ],
)
def test_impossible_starts_are_refused(initial: dict[str, Any]) -> None:
    objects = [ObjectSpec(id=n) for n in "ab"]
    labels = [LabelSpec(id="Aa", kind="cabinet", xy=(0.0, 0.0))]
    with pytest.raises(ValueError, match=r"initial|list|unknown"):
        Engine(objects, labels, initial, Parameters.of(), budget=None)


def test_a_huge_uniform_start_is_sampled_within_the_budget() -> None:
    objects = [ObjectSpec(id=str(i)) for i in range(25)]
    labels = [LabelSpec(id=f"L{i}", kind="cabinet", xy=(0.0, 0.0)) for i in range(20)]
    engine = Engine(objects, labels, {"type": "uniform"}, Parameters.of(), budget=200)
    assert engine.n_hypotheses == 200
    for _, placement in engine.hypotheses():
        assert sorted(p for p in placement.values() if p != "OUT") == sorted(x.id for x in labels)
    with pytest.raises(ValueError, match="uniform"):
        Engine(objects, labels, {"type": "uniform"}, Parameters.of(), budget=None)
