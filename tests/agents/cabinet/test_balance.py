"""What the cells show at rest is the sum of what stands there: wrong explanations are found and put right."""

from __future__ import annotations

import json

import numpy as np
import pytest
from cabinet_bench import GEOMETRY, ZONES, Bench, of, share

from tms_agents.cabinet import Appeared, CabinetEstimator, EstimatorSettings, Vanished
from tms_agents.cabinet.balance import Balance, search
from tms_agents.cabinet.fusion import Evidence
from tms_agents.cabinet.stays import Shelf, Thing

SETTINGS = EstimatorSettings()
NOISE = np.full(4, 1.0)


def shelf_with(*loads: np.ndarray) -> tuple[Shelf, list[Thing]]:
    shelf = Shelf(GEOMETRY)
    return shelf, [shelf.put(load, NOISE, since=1.0, onset=0.5) for load in loads]


def silent(thing: Thing) -> float:
    return 0.0


def test_the_zero_follows_creep_but_no_thing() -> None:
    load = 1000 * share(0.2, 0.15)
    shelf, _ = shelf_with(load)
    balance = Balance(shelf, SETTINGS)
    for second in range(1800):
        crept = load * (1 + 0.01 * second / 3600)
        assert balance.rest(float(second), crept, NOISE) is None
    step = balance.rest(1801.0, load, np.full(4, 1.0))
    assert step is None or abs(step.weight_g) < 10
    missing = balance.rest(1802.0, 0 * load, NOISE)
    assert missing is not None
    assert abs(missing.weight_g + 1000) < 10


@pytest.mark.parametrize("gone", [(0,), (1,), (0, 2), (0, 1, 2)])
def test_stays_that_are_over_are_found(gone: tuple[int, ...]) -> None:
    loads = [300 * share(0.1, 0.1), 320 * share(0.35, 0.2), 700 * share(0.25, 0.25)]
    shelf, things = shelf_with(*loads)
    balance = Balance(shelf, SETTINGS)
    balance.rest(1.0, sum(loads), NOISE)
    step = balance.rest(2.0, sum(loads) - sum(loads[i] for i in gone), NOISE)
    assert step is not None
    best = search(step, balance, shelf, Evidence(silent, {}), SETTINGS)[0]
    assert (best.kind, set(best.removed)) == ("take", {things[i] for i in gone})
    assert best.score > 0.9


def test_one_out_and_another_in_that_nobody_told() -> None:
    old, other, new = 300 * share(0.1, 0.1), 500 * share(0.3, 0.1), 150 * share(0.35, 0.25)
    shelf, (thing, _) = shelf_with(old, other)
    balance = Balance(shelf, SETTINGS)
    balance.rest(1.0, old + other, NOISE)
    step = balance.rest(2.0, other + new, NOISE)
    assert step is not None
    best = search(step, balance, shelf, Evidence(silent, {}), SETTINGS)[0]
    assert best.kind == "swap"
    assert best.removed == (thing,)
    assert best.load == pytest.approx(new, abs=3)


def test_a_tag_left_with_a_stay_that_is_over_goes_to_the_same_thing_elsewhere() -> None:
    old, other, new = 60 * share(0.1, 0.1), 500 * share(0.3, 0.1), 60 * share(0.35, 0.25)
    shelf, (thing, _) = shelf_with(old, other)
    thing.tag = "E00401"
    balance = Balance(shelf, SETTINGS)
    balance.rest(1.0, old + other, NOISE)
    moved = shelf.put(new, NOISE, since=3.0, onset=2.0)
    step = balance.rest(4.0, other + new, NOISE)
    assert step is not None

    def read(one: Thing) -> float:
        return -16.0 if one.tag else 0.0

    best = search(step, balance, shelf, Evidence(read, {}), SETTINGS)[0]
    assert (best.kind, best.removed, best.thing) == ("take", (thing,), moved) and best.score > 0.9
    # Of another weight it is another thing, and the tag that is read speaks for the old one.
    moved.load = 90 * share(0.35, 0.25)
    step = balance.rest(5.0, other + moved.load, NOISE)
    assert step is not None
    best = search(step, balance, shelf, Evidence(read, {}), SETTINGS)[0]
    assert best.thing is not moved or best.score < 0.9


def test_what_is_being_measured_is_told_only_that_it_was_wrong() -> None:
    load = 300 * share(0.2, 0.1)
    shelf, _ = shelf_with()
    balance = Balance(shelf, SETTINGS)
    balance.rest(1.0, 0 * load, NOISE)
    thing = shelf.put(load + 1.0, 9 * NOISE, since=2.0, onset=1.5)
    for second in range(2, 6):
        assert balance.rest(float(second), load, NOISE, measured=thing.id) is None
    assert thing.load == pytest.approx(load + 1.0)
    balance.rest(6.0, load, NOISE)
    assert abs(thing.load - load).max() < 0.5


def test_a_board_that_was_emptied_while_a_cell_was_dead_is_empty() -> None:
    bench = Bench(seed=5)
    for load in (400 * share(0.1, 0.1), 250 * share(0.35, 0.1), 650 * share(0.3, 0.25)):
        bench.change(load, rest=5.0)
    before = {stay.id for stay in bench.estimator.stays()}
    bench.estimator.load(bench.t, np.array([np.nan, 0.0, 0.0, 0.0]))
    bench.load = np.zeros(4)
    events = bench.run(8.0)
    assert {event.stay for event in of(Vanished, events)} == before
    assert not of(Appeared, events)
    assert not bench.estimator.stays()


def test_the_zeros_survive_a_restart() -> None:
    bench = Bench(seed=6)
    bench.change(400 * share(0.1, 0.1), rest=5.0)
    state = json.loads(json.dumps(bench.estimator.to_dict()))
    again = CabinetEstimator.from_dict(state, GEOMETRY, zones=ZONES)
    assert again.to_dict()["balance"]["mean"] == bench.estimator.to_dict()["balance"]["mean"]
    del state["balance"]  # as an earlier version saved it
    assert CabinetEstimator.from_dict(state, GEOMETRY, zones=ZONES).stays()


@pytest.mark.parametrize("away_s", [2.0, 5 * 86400.0])
def test_loads_are_followed_on_after_a_restart(away_s: float) -> None:
    """However long the agent was away: what stands there keeps its load, and what was taken meanwhile is missed."""
    bench = Bench(seed=7)
    bench.change(400 * share(0.1, 0.1), rest=5.0)
    bench.change(700 * share(0.3, 0.2), rest=5.0)
    state = json.loads(json.dumps(bench.estimator.to_dict()))
    light, heavy = bench.estimator.stays()
    bench.estimator = CabinetEstimator.from_dict(state, GEOMETRY, zones=ZONES)
    bench.t += away_s
    bench.run(20.0)
    for stay, before in zip(bench.estimator.stays(), (light, heavy), strict=True):
        assert (stay.id, stay.weight_g) == (before.id, pytest.approx(before.weight_g, abs=8.0))
    bench.estimator = CabinetEstimator.from_dict(state, GEOMETRY, zones=ZONES)
    bench.load = 700 * share(0.3, 0.2)
    bench.t += away_s
    (vanished,) = of(Vanished, bench.run(20.0))
    assert vanished.stay == light.id
